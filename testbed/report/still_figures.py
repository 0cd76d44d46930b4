"""The figures without an axis of time or frequency: errors over the time of averaging, a fluid over its height."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from testbed.pages.axes import WIDTH_IN, arrange, label, marked
from testbed.pages.decades import decade_axis, label_powers
from testbed.pages.numbers import significant
from testbed.pages.palette import DASHES, Mark, mix, series_marks
from testbed.pages.svg import INK, STYLE
from testbed.report.figures import DEG_S, Unit, by_group

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.axes import Axes
    from matplotlib.patches import Patch

    from testbed.allan import AllanCurve
    from testbed.report.digest import Digest
    from testbed.runs.metrics import ProfileMetrics

_MARKERS = ("o", "s", "^", "D", "v", "P")
_MM = 1e3


def allan_curves(digest: Digest) -> dict[str, AllanCurve]:
    """Return by group, such as ``sensors/mhd_ars``, the Allan deviation of the error, where the record has one.

    Parameters
    ----------
    digest : Digest
        Traces of the run.
    """
    return {group: trace.allan for group, trace in by_group(digest).items() if trace.allan is not None}


def errors_allan_figure(digest: Digest, colors: Mapping[str, str], unit: Unit = DEG_S) -> Figure:
    """Draw the Allan deviation of the errors after settle, with its 95 % band; of the rates where there is no truth.

    Parameters
    ----------
    digest : Digest
        Traces of the run.
    colors : Mapping
        Group (``sensors/mhd_ars``, ``fusion/kalman``, ...) to color.
    unit : tuple of str and float, optional
        Unit of the rates, and what deg/s is multiplied by for it.

    Returns
    -------
    Figure
        One axes, log-log, deviation against averaging time [s].
    """
    curves = allan_curves(digest)
    marks = series_marks(curves)
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(WIDTH_IN, 4.6))
        axes = figure.subplots()
        axes.set(xscale="log", yscale="log", xlabel="averaging time τ [s]")
        handles: list[Line2D | Patch] = []
        for group, curve in curves.items():
            color, width = colors[group], 0.9 if group.startswith("sensors/") else 1.9
            low, middle, high = (unit[1] * np.degrees(one) for one in (curve.lower, curve.deviation, curve.upper))
            axes.fill_between(curve.tau, low, high, color=color, alpha=0.15, linewidth=0)
            style = marked(marks[group], color, curve.tau.size)
            handles += axes.plot(curve.tau, middle, color=color, linewidth=width, label=label(group), **style)
        axes.set_ylabel(f"Allan deviation of the {'error' if digest.has_truth else 'rate'} [{unit[0]}]")
        label_powers(axes.xaxis, most=20)
        decade_axis(axes)
        axes.grid(visible=True)
        arrange(figure, handles)
    return figure


def profile_figure(profiles: Mapping[str, ProfileMetrics], colors: Mapping[str, str], unit: Unit = DEG_S) -> Figure:
    """Draw the velocity of the fluid over the height of each channel at some instants.

    Parameters
    ----------
    profiles : Mapping
        By sensor.
    colors : Mapping
        Group (``sensors/mhd_ars``, ...) to color.
    unit : tuple of str and float, optional
        Unit of the rates, and what deg/s is multiplied by for it.

    Returns
    -------
    Figure
        One axes a sensor: height [mm] against velocity relative to the wall, per radius.
    """
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(WIDTH_IN, 4.6))
        panels = figure.subplots(1, len(profiles), squeeze=False)[0]
        for axes, (name, profile) in zip(panels, profiles.items(), strict=True):
            _draw_profiles(axes, profile, colors[f"sensors/{name}"], unit)
            axes.set_title(label(name), loc="left")
            axes.set_xlabel(f"fluid minus wall, per radius [{unit[0]}]")
            axes.grid(visible=True)
        panels[0].set_ylabel("height above the lower wall [mm]")
        first, name = next(iter(profiles.values())), next(iter(profiles))
        arrange(figure, _instants(first, colors[f"sensors/{name}"], unit, walls=len(profiles) == 1))
    return figure


def _draw_profiles(axes: Axes, profile: ProfileMetrics, color: str, unit: Unit) -> None:
    height = _MM * np.array(profile.height_m)
    for i, slip in enumerate(profile.slip_deg_s):
        axes.plot(unit[1] * np.array(slip), height, linewidth=1.5, **_look(i, color, height.size))
    for wall in height[[0, -1]]:
        axes.axhline(wall, color=INK, linewidth=1.6)
    axes.axvline(0.0, color=INK, linewidth=0.6)


def _look(turn: int, color: str, n_points: int | None = None) -> dict[str, Any]:
    """Return the style of an instant: from the sensor's colour to amber."""
    mark = Mark(DASHES[turn % len(DASHES)], _MARKERS[turn % len(_MARKERS)], turn)
    shade = mix(color, "#d98a2b", turn / (len(_MARKERS) - 1))
    return {"color": shade, **marked(mark, shade, n_points)}


def _instants(profile: ProfileMetrics, color: str, unit: Unit, *, walls: bool) -> list[Line2D | Patch]:
    handles: list[Line2D | Patch] = []
    for i, (time, wall) in enumerate(zip(profile.time_s, profile.wall_deg_s, strict=True)):
        words = f"{time:.5g} s, wall at {significant(unit[1] * wall, 2)} {unit[0]}" if walls else f"{time:.5g} s"
        handles.append(Line2D([], [], linewidth=1.5, label=words, **_look(i, color)))
    return handles
