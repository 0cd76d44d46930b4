"""The figures of a campaign."""

from __future__ import annotations

from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from testbed.campaigns.rows import RESIDUAL
from testbed.pages.axes import WIDTH_IN, arrange, label, marked
from testbed.pages.palette import Mark, color_of, series_marks
from testbed.pages.svg import INK, STYLE

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from matplotlib.axes import Axes
    from matplotlib.patches import Patch

    from testbed.campaigns.curves import Point, Summary

_DOTTED = (0, (1.2, 2.2))
_ROOMS = {"sensor": "sensors", "filter": "fusion"}
# Ends of an axis that are further apart than this ratio are drawn on a logarithmic one.
_LOGARITHMIC = 9.0


def figures_of(found: Summary, axes: Mapping[str, str]) -> dict[str, Figure]:
    """Return the figures that a campaign has: curves over its first axis of numbers, a map over two of them.

    Parameters
    ----------
    found : Summary
        What the rows say.
    axes : mapping of str to str
        Varied keys with the SI units of their values.
    """
    numeric = [(key, f"{key} [{unit}]") for key, unit in axes.items() if _values(found, key).size > 1]
    drawn = {}
    with mpl.rc_context(STYLE):
        if numeric:
            drawn["errors"] = _curves(found, *numeric[0])
            if any(point.sight for points in found.points.values() for point in points):
                drawn["sight"] = _sight(found, *numeric[0])
            if any(np.isfinite(point.gain[1]) for points in found.points.values() for point in points):
                drawn["response"] = _response(found, *numeric[0])
        if len(numeric) > 1 and any(kind == "filter" for kind, _ in found.points):
            drawn["map"] = _map(found, *numeric[0], *numeric[1])
    return drawn


def _values(found: Summary, key: str) -> np.ndarray:
    """Return the distinct numbers that an axis takes, none if it takes something else."""
    values = {point.axes[key] for points in found.points.values() for point in points}
    return np.array(sorted(values)) if values and all(isinstance(one, float) for one in values) else np.empty(0)


def _along(points: Sequence[Point], key: str) -> list[tuple[float, list[Point]]]:
    """Return the points by their value at an axis, rising; several where another axis varies too."""
    groups: dict[float, list[Point]] = {}
    for point in points:
        groups.setdefault(point.axes[key], []).append(point)
    return sorted(groups.items())


def _rms(values: Sequence[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def _curves(found: Summary, key: str, words: str) -> Figure:
    figure = Figure(figsize=(WIDTH_IN, 4.8))
    axes = figure.subplots()
    handles: list[Line2D | Patch] = []
    bounds: dict[str, list[float]] = {}
    marks = _marks(found)
    for (kind, name), points in found.points.items():
        along = _along(points, key)
        x = [value for value, _ in along]
        ends = [
            [_rms([getattr(point, end) for point in group]) for _, group in along] for end in ("lower", "rmse", "upper")
        ]
        handles += _banded(axes, (kind, name), marks, x, ends, 0.9 if kind == "sensor" else 1.9)
        if kind == "filter":
            for bound in ("floor", "optimum"):
                bounds.setdefault(bound, [_rms([getattr(point, bound) for point in group]) for _, group in along])
    for (bound, values), dash in zip(bounds.items(), (_DOTTED, (0, (4, 2))), strict=False):
        if np.isfinite(values).any():
            axes.plot(x, values, color=INK, linewidth=1.4, linestyle=dash)
            called = {"floor": "noise floor", "optimum": "optimum of each case"}[bound]
            handles.append(Line2D([], [], color=INK, linewidth=1.4, linestyle=dash, label=called))
    return _finished(axes, words, x, "RMSE [deg/s]", handles)


def _sight(found: Summary, key: str, words: str) -> Figure:
    """Draw what each filter leaves of the line of sight, with its interval."""
    figure = Figure(figsize=(WIDTH_IN, 3.8))
    axes = figure.subplots()
    handles: list[Line2D | Patch] = []
    marks = _marks(found)
    for (kind, name), points in found.points.items():
        along = _along([point for point in points if RESIDUAL in point.sight], key)
        if not along:
            continue
        x = [value for value, _ in along]
        ends = [[_rms([point.sight[RESIDUAL][k] for point in group]) for _, group in along] for k in range(3)]
        handles += _banded(axes, (kind, name), marks, x, ends)
    return _finished(axes, words, x, "residual [µrad]", handles)


def _banded(
    axes: Axes,
    source: tuple[str, str],
    marks: Mapping[tuple[str, str], Mark],
    x: Sequence[float],
    ends: Sequence[Sequence[float]],
    width: float = 1.9,
) -> list[Line2D]:
    """Draw lower end, value and upper end of a source, and return its entry of the legend."""
    kind, name = source
    color = color_of(f"{_ROOMS[kind]}/{name}")
    style = marked(marks[source], color, len(x))
    if np.isfinite(ends[0]).all():
        axes.fill_between(x, ends[0], ends[2], color=color, alpha=0.18, linewidth=0)
    return axes.plot(x, ends[1], color=color, linewidth=width, label=label(name), **style)


def _finished(axes: Axes, words: str, x: Sequence[float], upright: str, handles: list[Line2D | Patch]) -> Figure:
    """Return the figure of axes over a varied key, with scales, words and legend."""
    figure = axes.get_figure(root=True)
    assert figure is not None
    _scale(axes, words, x)
    axes.set_yscale("log")
    axes.set_ylabel(upright)
    axes.grid(visible=True)
    arrange(figure, handles)
    return figure


def _marks(found: Summary) -> dict[tuple[str, str], Mark]:
    """Return dashes and marker of every source."""
    groups = {(kind, name): f"{_ROOMS[kind]}/{name}" for kind, name in found.points}
    marks = series_marks(groups.values())
    return {key: marks[group] for key, group in groups.items()}


def _response(found: Summary, key: str, words: str) -> Figure:
    figure = Figure(figsize=(WIDTH_IN, 5.6))
    panels = figure.subplots(2, 1, sharex=True)
    handles: list[Line2D | Patch] = []
    marks = _marks(found)
    for (kind, name), points in found.points.items():
        along = _along(points, key)
        x = [value for value, _ in along]
        for axes, part in zip(panels, ("gain", "phase"), strict=True):
            ends = [
                [float(np.mean([getattr(point, part)[k] for point in group])) for _, group in along] for k in range(3)
            ]
            lines = _banded(axes, (kind, name), marks, x, ends, 1.5)
        handles += lines
    for axes, upright in zip(panels, ("gain of the first line [-]", "its phase [deg]"), strict=True):
        axes.set_ylabel(upright)
        axes.grid(visible=True)
    _scale(panels[1], words, x)
    arrange(figure, handles)
    return figure


def _map(found: Summary, first: str, words: str, second: str, upright: str) -> Figure:
    """Draw the RMSE of every filter over two axes, all in one scale."""
    names = [name for kind, name in found.points if kind == "filter"]
    x, y = _values(found, first), _values(found, second)
    grids = {}
    for name in names:
        cells: dict[tuple[float, float], list[float]] = {}
        for point in found.points["filter", name]:
            cells.setdefault((point.axes[second], point.axes[first]), []).append(point.rmse)
        grids[name] = np.array([[_rms(cells[b, a]) if (b, a) in cells else np.nan for a in x] for b in y])
    figure = Figure(figsize=(WIDTH_IN, 2.9), layout="constrained")
    panels = figure.subplots(1, len(names), squeeze=False, sharey=True)[0]
    logs = {name: np.log10(grid) for name, grid in grids.items()}
    low = min(float(np.nanmin(one)) for one in logs.values())
    high = max(float(np.nanmax(one)) for one in logs.values())
    for axes, name in zip(panels, names, strict=True):
        image = axes.imshow(logs[name], origin="lower", aspect="auto", vmin=low, vmax=high, cmap="cividis")
        axes.set_title(label(name), loc="left")
        for axis, values in ((axes.xaxis, x), (axes.yaxis, y)):
            at = np.unique(np.linspace(0, values.size - 1, min(values.size, 5)).round().astype(int))
            axis.set_ticks(at, [f"{values[k]:.3g}" for k in at])
        axes.set_xlabel(words, fontsize=7.5)
    panels[0].set_ylabel(upright, fontsize=7.5)
    figure.colorbar(image, ax=list(panels), label="log10 of the RMSE in deg/s")
    return figure


def _scale(axes: Axes, words: str, x: Sequence[float]) -> None:
    positive = min(x) > 0.0
    if positive and max(x) / min(x) >= _LOGARITHMIC:
        axes.set_xscale("log")
        axes.xaxis.set_major_formatter("{x:g}")
    axes.set_xlabel(words)
