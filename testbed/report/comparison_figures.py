"""The figures of two runs side by side."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from testbed.pages.axes import DEGREE, WIDTH_IN, arrange, draw, label, marked, on_area, time_axis
from testbed.pages.decades import decade_axis, frequency_axis
from testbed.pages.palette import series_marks
from testbed.pages.svg import INK, STYLE

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from matplotlib.axes import Axes
    from matplotlib.patches import Patch

    from testbed.report.digest import Digest, ErrorTrace
    from testbed.report.figures import Unit
    from testbed.runs.metrics import FloorDensity

_FLOOR = "#8a8a8a"
_STYLES: tuple[tuple[str, Any], ...] = (("A", "-"), ("B", (0, (4.0, 1.6))))


def errors_beside(
    digests: tuple[Digest, Digest], names: Sequence[str], colors: Mapping[str, str], unit: Unit
) -> Figure:
    """Draw the error of each filter over time, A on the left and B on the right of a row with one scale.

    Parameters
    ----------
    digests : tuple of Digest
        Traces of A and of B.
    names : sequence of str
        Filters of either.
    colors : Mapping
        Group (``fusion/kalman``, ...) to color.
    unit : tuple of str and float
        Unit of the rates, and what deg/s is multiplied by for it.
    """
    scale = unit[1] * DEGREE
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(WIDTH_IN, 1.0 + 1.7 * len(names)))
        rows = figure.subplots(len(names), 2, sharey="row", sharex="col", squeeze=False)
        for name, row in zip(names, rows, strict=True):
            limit = max(_extreme(digest, name, scale) for digest in digests)
            for side, digest, axes in zip("AB", digests, row, strict=True):
                axes.set_title(f"{side}: {label(name)}", loc="left")
                axes.grid(visible=True)
                axes.set_ylim(-1.15 * limit, 1.15 * limit)
                axes.set_xlim(0.0, digest.duration_s)
                if name in digest.filter_errors:
                    _draw_error(axes, digest.filter_errors[name], colors[f"fusion/{name}"], scale)
                else:
                    axes.text(0.5, 0.5, "not run", transform=axes.transAxes, ha="center")
            row[0].set_ylabel(f"error [{unit[0]}]")
        for axes, digest in zip(rows[-1], digests, strict=True):
            time_axis(axes, digest.duration_s)
        arrange(figure, [Line2D([], [], color=INK, linewidth=1.1, linestyle=(0, (5, 2)), label="±2 std claimed")])
        figure.subplots_adjust(wspace=0.12)
    return figure


def _draw_error(axes: Axes, trace: ErrorTrace, color: str, scale: float) -> None:
    draw(axes, trace.whole, color, 0.6, scale=scale)
    if trace.std is not None:
        for sign in (-2.0, 2.0):
            axes.plot(trace.std.time, sign * scale * trace.std.high, color=INK, linewidth=1.1, linestyle=(0, (5, 2)))


def _extreme(digest: Digest, name: str, scale: float) -> float:
    """Return the largest |error| after settle; a thousandth of a unit where there is none."""
    trace = digest.filter_errors.get(name)
    if trace is None:
        return 1e-3
    late = trace.whole.time >= digest.settle_s
    sizes = scale * np.abs(np.concatenate([trace.whole.low[late], trace.whole.high[late]]))
    return float(np.max(sizes, where=np.isfinite(sizes), initial=1e-12))


def spectra_beside(
    digests: tuple[Digest, Digest],
    names: Sequence[str],
    colors: Mapping[str, str],
    floors: tuple[FloorDensity | None, FloorDensity | None],
    unit: Unit,
) -> Figure:
    """Draw the root density of each filter's error, A full and B dashed, with the floors of both.

    Parameters
    ----------
    digests : tuple of Digest
        Traces of A and of B.
    names : sequence of str
        Filters of both.
    colors : Mapping
        Group (``fusion/kalman``, ...) to color.
    floors : tuple of FloorDensity
        Of A and of B, None where unknown.
    unit : tuple of str and float
        Unit of the rates, and what deg/s is multiplied by for it.
    """
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(WIDTH_IN, 4.6))
        axes = figure.subplots()
        marks = series_marks(f"fusion/{name}" for name in names)
        for digest, floor, (_, style) in zip(digests, floors, _STYLES, strict=True):
            for name in names:
                trace = digest.filter_errors[name]
                root = unit[1] * np.degrees(np.sqrt(trace.density))
                color = colors[f"fusion/{name}"]
                look = marked(marks[f"fusion/{name}"], color, root.size) | {"linestyle": style}
                axes.plot(trace.freq_hz, root, color=color, linewidth=1.5, **look)
            if floor is not None:
                density = unit[1] * np.array(floor.density)
                axes.plot(floor.frequency_hz, density, color=_FLOOR, linewidth=1.1, linestyle=style)
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.set_xlabel("frequency [Hz]")
        axes.set_ylabel(f"error root density, two-sided [{unit[0]}/√Hz]")
        frequency_axis(axes)
        decade_axis(axes)
        freq = np.concatenate([digest.filter_errors[name].freq_hz for digest in digests for name in names])
        if freq.size:
            axes.set_xlim(0.8 * freq.min(), 1.25 * freq.max())
        axes.grid(visible=True)
        handles: list[Line2D | Patch] = [
            Line2D(
                [], [], color=colors[group], linewidth=2.2, label=label(group),
                **on_area(mark, colors[group]),
            )
            for group, mark in marks.items()
        ]  # fmt: skip
        if any(floors):
            handles.append(Line2D([], [], color=_FLOOR, linewidth=1.1, label="noise floor"))
        handles += [Line2D([], [], color=INK, linewidth=1.5, linestyle=style, label=side) for side, style in _STYLES]
        arrange(figure, handles)
    return figure
