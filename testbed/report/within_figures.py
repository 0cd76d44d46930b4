"""The figures of what happened inside the filters."""

from __future__ import annotations

from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from testbed.pages.axes import DEGREE, WIDTH_IN, arrange, draw, label, marked, on_area, time_axis
from testbed.pages.decades import decade_axis
from testbed.pages.palette import series_marks
from testbed.pages.svg import INK, STYLE
from testbed.report.figures import DEG_S, Unit
from testbed.report.within import LAGS

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Mapping, Sequence

    from matplotlib.axes import Axes
    from matplotlib.patches import Patch

    from testbed.pages.envelope import Envelope
    from testbed.report.within import Correlations
    from testbed.signals import FloatArray

_NAMES = {"R_": "R of", "N_": "N of", "gated_": "gated readings of", "frequency_": "frequency that is seen by"}
# What is no variance of a rate: its unit.
_PLAIN = {"gated_": "readings", "frequency_": "Hz"}
# More decades than this above the lowest hide what the filter does most of the time.
_DECADES = 6.0


def adapted_figure(
    traces: Mapping[str, Mapping[str, Envelope]],
    colors: Mapping[str, str],
    duration_s: float,
    settle_s: float,
    unit: Unit = DEG_S,
) -> Figure:
    """Draw what the filters adapted over time, a panel for each quantity: variances and frequencies on a logarithmic
    axis, whose scale is set by what comes after settle.

    Parameters
    ----------
    traces : Mapping
        By diagnostic and filter, variances in rad^2/s^2.
    colors : Mapping
        Group (``fusion/kalman``, ...) to color.
    duration_s, settle_s : float
        Length of the run, and start of the part that is judged [s].
    unit : tuple of str and float, optional
        Unit of the rates, and what deg/s is multiplied by for it.
    """
    filters = list(dict.fromkeys(name for by_filter in traces.values() for name in by_filter))
    marks = series_marks(f"fusion/{name}" for name in filters)
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(WIDTH_IN, 1.0 + 1.55 * len(traces)))
        panels = figure.subplots(len(traces), 1, sharex=True, squeeze=False)[:, 0]
        for axes, (key, by_filter) in zip(panels, traces.items(), strict=True):
            plain = next((of for stem, of in _PLAIN.items() if key.startswith(stem)), None)
            scale = (unit[1] * DEGREE) ** 2 if plain is None else 1.0
            for i, name in enumerate(filters):
                if name in by_filter:
                    group = f"fusion/{name}"
                    draw(axes, by_filter[name], colors[group], 1.6 * 0.8**i, scale=scale, mark=marks[group])
            axes.set_title(_title(key), loc="left")
            axes.set_ylabel(plain or f"({unit[0]})²")
            axes.grid(visible=True)
            if plain != "readings":
                _logarithmic(axes, by_filter.values(), scale, settle_s)
        panels[-1].set_xlim(0.0, duration_s)
        time_axis(panels[-1], duration_s)
        arrange(figure, _handles(filters, colors))
    return figure


def _title(key: str) -> str:
    for stem, words in _NAMES.items():
        if key.startswith(stem):
            return f"{words} {label(key.removeprefix(stem))}"
    return "Q, variance that a step adds to the rate"


def _logarithmic(axes: Axes, envelopes: Collection[Envelope], scale: float, settle_s: float) -> None:
    """Give the axis decades, one at the least: of the values after settle, or of all where there is none after it, down
    to the lowest above zero but not below what six of them show.
    """
    known = _above_zero(envelopes, settle_s)
    known = scale * (known if known.size else _above_zero(envelopes, 0.0))
    if known.size:
        low, high = max(float(known.min()), float(known.max()) * 10.0**-_DECADES), float(known.max())
        margin = max(1.6, np.sqrt(10.0 * low / high))
        axes.set_yscale("log")
        axes.set_ylim(low / margin, high * margin)
        decade_axis(axes)


def _above_zero(envelopes: Iterable[Envelope], from_s: float) -> FloatArray:
    """Return the extremes above zero, of the bins from `from_s` on [s]."""
    ends = [side[one.time >= from_s] for one in envelopes for side in (one.low, one.high)]
    values = np.concatenate(ends)
    return values[np.isfinite(values) & (values > 0.0)]


def _handles(filters: Iterable[str], colors: Mapping[str, str]) -> list[Line2D | Patch]:
    marks = series_marks(f"fusion/{name}" for name in filters)
    return [
        Line2D(
            [], [], color=colors[group], linewidth=2.2, label=label(group),
            **on_area(mark, colors[group]),
        )
        for group, mark in marks.items()
    ]  # fmt: skip


def whiteness_figure(found: Mapping[str, Mapping[str, Correlations]], colors: Mapping[str, str]) -> Figure:
    """Draw the correlation of the innovations with those before, a panel for each sensor, with what chance allows.

    Parameters
    ----------
    found : Mapping
        By sensor and filter.
    colors : Mapping
        Group (``fusion/kalman``, ...) to color.
    """
    filters = list(dict.fromkeys(name for by_filter in found.values() for name in by_filter))
    marks = series_marks(f"fusion/{name}" for name in filters)
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(WIDTH_IN, 1.0 + 1.9 * len(found)))
        panels = figure.subplots(len(found), 1, sharex=True, squeeze=False)[:, 0]
        for axes, (sensor, by_filter) in zip(panels, found.items(), strict=True):
            bound = 1.96 / np.sqrt(min(one.n for one in by_filter.values()))
            axes.axhspan(-bound, bound, color=INK, alpha=0.13, linewidth=0)
            axes.axhline(0.0, color=INK, linewidth=0.6)
            for name, one in by_filter.items():
                lags, color = np.arange(1, len(one.values) + 1), colors[f"fusion/{name}"]
                axes.plot(lags, one.values, color=color, linewidth=1.1, **marked(marks[f"fusion/{name}"], color, LAGS))
            axes.set_title(f"innovations of {label(sensor)}", loc="left")
            axes.set_ylabel("correlation")
            axes.grid(visible=True)
        panels[-1].set_xlabel("lag [readings]")
        arrange(figure, _style_handles(filters, colors))
    return figure


def _style_handles(filters: Sequence[str], colors: Mapping[str, str]) -> list[Line2D | Patch]:
    marks = series_marks(f"fusion/{name}" for name in filters)
    handles: list[Line2D | Patch] = [
        Line2D([], [], color=colors[group], linewidth=1.4, label=label(group), **marked(mark, colors[group]))
        for group, mark in marks.items()
    ]
    handles.append(Line2D([], [], color=INK, alpha=0.3, linewidth=6.0, label="95 % of chance, if white"))
    return handles
