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
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.patches import Patch

    from testbed.campaigns.curves import Point, Summary

_DOTTED = (0, (1.2, 2.2))
_ROOMS = {"sensor": "sensors", "filter": "fusion"}
# Ends of an axis that are further apart than this ratio are drawn on a logarithmic one.
_LOGARITHMIC = 9.0


def figures_of(found: Summary, axes: Sequence[str]) -> dict[str, Figure]:
    """Return the figures that a campaign has: curves over its first axis of numbers, a map over two of them.

    Parameters
    ----------
    found : Summary
        What the rows say.
    axes : sequence of str
        Varied keys.
    """
    numeric = [key for key in axes if _values(found, key).size > 1]
    drawn = {}
    with mpl.rc_context(STYLE):
        if numeric:
            drawn["errors"] = _curves(found, numeric[0])
            if any(point.sight for points in found.points.values() for point in points):
                drawn["sight"] = _sight(found, numeric[0])
            if any(np.isfinite(point.gain[1]) for points in found.points.values() for point in points):
                drawn["response"] = _response(found, numeric[0])
        if len(numeric) > 1 and any(kind == "filter" for kind, _ in found.points):
            drawn["map"] = _map(found, numeric[0], numeric[1])
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


def _curves(found: Summary, key: str) -> Figure:
    figure = Figure(figsize=(WIDTH_IN, 4.8))
    axes = figure.subplots()
    handles: list[Line2D | Patch] = []
    bounds: dict[str, list[float]] = {}
    marks = _marks(found)
    for (kind, name), points in found.points.items():
        along = _along(points, key)
        x = [value for value, _ in along]
        color, width = color_of(f"{_ROOMS[kind]}/{name}"), 0.9 if kind == "sensor" else 1.9
        columns = [
            [_rms([getattr(point, end) for point in group]) for _, group in along] for end in ("rmse", "lower", "upper")
        ]
        style = marked(marks[kind, name], color, len(x))
        handles += axes.plot(x, columns[0], color=color, linewidth=width, label=label(name), **style)
        if np.isfinite(columns[1]).all():
            axes.fill_between(x, columns[1], columns[2], color=color, alpha=0.18, linewidth=0)
        if kind == "filter":
            for bound in ("floor", "optimum"):
                bounds.setdefault(bound, [_rms([getattr(point, bound) for point in group]) for _, group in along])
    for (bound, values), dash in zip(bounds.items(), (_DOTTED, (0, (4, 2))), strict=False):
        if np.isfinite(values).any():
            axes.plot(x, values, color=INK, linewidth=1.4, linestyle=dash)
            words = {"floor": "noise floor", "optimum": "optimum of each case"}[bound]
            handles.append(Line2D([], [], color=INK, linewidth=1.4, linestyle=dash, label=words))
    _scale(axes, key, x)
    axes.set_yscale("log")
    axes.set_ylabel("RMSE [deg/s]")
    axes.grid(visible=True)
    arrange(figure, handles)
    return figure


def _sight(found: Summary, key: str) -> Figure:
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
        color = color_of(f"{_ROOMS[kind]}/{name}")
        style = marked(marks[kind, name], color, len(x))
        handles += axes.plot(x, ends[1], color=color, linewidth=1.9, label=label(name), **style)
        if np.isfinite(ends[0]).all():
            axes.fill_between(x, ends[0], ends[2], color=color, alpha=0.18, linewidth=0)
    _scale(axes, key, x)
    axes.set_yscale("log")
    axes.set_ylabel("residual [µrad]")
    axes.grid(visible=True)
    arrange(figure, handles)
    return figure


def _marks(found: Summary) -> dict[tuple[str, str], Mark]:
    """Return dashes and marker of every source."""
    groups = {(kind, name): f"{_ROOMS[kind]}/{name}" for kind, name in found.points}
    marks = series_marks(groups.values())
    return {key: marks[group] for key, group in groups.items()}


def _response(found: Summary, key: str) -> Figure:
    figure = Figure(figsize=(WIDTH_IN, 5.6))
    panels = figure.subplots(2, 1, sharex=True)
    handles: list[Line2D | Patch] = []
    marks = _marks(found)
    for (kind, name), points in found.points.items():
        along = _along(points, key)
        x = [value for value, _ in along]
        color = color_of(f"{_ROOMS[kind]}/{name}")
        style = marked(marks[kind, name], color, len(x))
        for axes, part in zip(panels, ("gain", "phase"), strict=True):
            ends = [
                [float(np.mean([getattr(point, part)[k] for point in group])) for _, group in along] for k in range(3)
            ]
            lines = axes.plot(x, ends[1], color=color, linewidth=1.5, label=label(name), **style)
            if np.isfinite(ends[0]).all():
                axes.fill_between(x, ends[0], ends[2], color=color, alpha=0.18, linewidth=0)
        handles += lines
    for axes, words in zip(panels, ("gain of the first line [-]", "its phase [deg]"), strict=True):
        axes.set_ylabel(words)
        axes.grid(visible=True)
    _scale(panels[1], key, x)
    arrange(figure, handles)
    return figure


def _map(found: Summary, first: str, second: str) -> Figure:
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
        axes.set_xlabel(first, fontsize=7.5)
    panels[0].set_ylabel(second, fontsize=7.5)
    figure.colorbar(image, ax=list(panels), label="log10 of the RMSE in deg/s")
    return figure


def _scale(axes: Axes, key: str, x: Sequence[float]) -> None:
    positive = min(x) > 0.0
    if positive and max(x) / min(x) >= _LOGARITHMIC:
        axes.set_xscale("log")
        axes.xaxis.set_major_formatter("{x:g}")
    axes.set_xlabel(f"{key} [SI]")
