"""The figures of a campaign."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from testbed.campaigns.maps import map_of
from testbed.campaigns.rows import RESIDUAL
from testbed.pages.chart import INK, ChartLine, Panel, chart
from testbed.pages.palette import Mark, color_of, series_marks

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from markupsafe import Markup

    from testbed.campaigns.curves import Point, Summary

    Ends = Callable[[Point], tuple[float, float, float]]

_ROOMS = {"sensor": "sensors", "filter": "fusion"}
_WIDTHS = {"sensor": 0.9, "filter": 1.9}
_BOUNDS = {
    "floor": ("noise floor", Mark((0, (1.2, 2.2)), "|", 0)),
    "optimum": ("optimum of each case", Mark((0, (4, 2)), "_", 1)),
}
# Ends of an axis that are further apart than this ratio are drawn on a logarithmic one.
_LOGARITHMIC = 9.0


def figures_of(found: Summary, axes: Mapping[str, str]) -> dict[str, Markup]:
    """Return the figures that a campaign has: curves over its first axis of numbers, a map over two of them.

    Parameters
    ----------
    found : Summary
        What the rows say.
    axes : mapping of str to str
        Varied keys with the units of their values.
    """
    numeric = {key: values for key in axes if (values := values_along(found, key)).size > 1}
    words = {key: f"{key} [{axes[key]}]" for key in numeric}
    if not numeric:
        return {}
    key, *others = numeric
    log = {key: by_ratios(values) for key, values in numeric.items()}
    drawn = {name: chart(panels, words[key], height, log=log[key]) for name, panels, height in panels_of(found, key)}
    if others and any(kind == "filter" for kind, _ in found.points):
        drawn["map"] = map_of(found, numeric, words, log)
    return drawn


def panels_of(found: Summary, key: str) -> list[tuple[str, list[Panel], float]]:
    """Return name, panels and height of the figures over an axis.

    Parameters
    ----------
    found : Summary
        What the rows say.
    key : str
        Of the axis.
    """
    points = [point for points in found.points.values() for point in points]
    errors = _series(found, key, lambda one: (one.lower, one.rmse, one.upper), _rms)
    figures = [("errors", [Panel("RMSE [deg/s]", [*errors, *_bounds(found, key)], log=True)], 346.0)]
    if any(point.sight for point in points):
        sight = _series(found, key, lambda one: one.sight.get(RESIDUAL, (np.nan,) * 3), _rms)
        seen = [one for one in sight if np.isfinite(one.y).any()]
        figures.append(("sight", [Panel("residual [µrad]", seen, log=True)], 274.0))
    if any(np.isfinite(point.gain[1]) for point in points):
        gain = _series(found, key, lambda one: one.gain, np.mean)
        phase = _series(found, key, lambda one: one.phase, np.mean)
        panels = [Panel("gain of the first line [-]", gain, log=False), Panel("its phase [deg]", phase, log=False)]
        figures.append(("response", panels, 403.0))
    return figures


def values_along(found: Summary, key: str) -> np.ndarray:
    """Return the distinct numbers that an axis takes, none if it takes something else.

    Parameters
    ----------
    found : Summary
        What the rows say.
    key : str
        Of the axis.
    """
    values = {point.axes[key] for points in found.points.values() for point in points}
    return np.array(sorted(values)) if values and all(isinstance(one, float) for one in values) else np.empty(0)


def by_ratios(values: np.ndarray) -> bool:
    """Return whether an axis is drawn as a logarithmic one: its ends are far apart, and the middle one of its values
    is nearer to that of their ratios.

    Parameters
    ----------
    values : ndarray, shape (n,)
        That it takes, rising.
    """
    low, middle, high = values[0], np.median(values), values[-1]
    return bool(low > 0.0 and high / low >= _LOGARITHMIC and middle < (low + high + 2.0 * np.sqrt(low * high)) / 4.0)


def _along(points: Sequence[Point], key: str) -> list[tuple[float, list[Point]]]:
    """Return the points by their value at an axis, rising; several where another axis varies too."""
    groups: dict[float, list[Point]] = {}
    for point in points:
        groups.setdefault(point.axes[key], []).append(point)
    return sorted(groups.items())


def _rms(values: Sequence[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def _series(found: Summary, key: str, ends: Ends, mean: Callable[[Sequence[float]], float]) -> list[ChartLine]:
    """Return what each source has over an axis; where another axis varies too, the mean over it."""
    groups = {(kind, name): f"{_ROOMS[kind]}/{name}" for kind, name in found.points}
    marks, series = series_marks(groups.values()), []
    for (kind, name), points in found.points.items():
        along = _along(points, key)
        low, middle, high = (np.array([mean([ends(one)[k] for one in group]) for _, group in along]) for k in range(3))
        mark = marks[groups[kind, name]]
        dash = mark.dash if makes_curve(points, key) else None
        color, x = color_of(groups[kind, name]), np.array([value for value, _ in along])
        series.append(ChartLine(name, color, dash, mark, _WIDTHS[kind], x, middle, low, high))
    return series


def makes_curve(points: Sequence[Point], key: str) -> bool:
    """Return whether the points of a source make a curve over an axis: not where a further one was drawn beside it, so
    that each point has its own value of both.

    Parameters
    ----------
    points : sequence of Point
        Of the source.
    key : str
        Of the axis.
    """
    others = {tuple(value for name, value in point.axes.items() if name != key) for point in points}
    alone = len({point.axes[key] for point in points}) == len(points)
    return not (alone and 1 < len(others) == len(points))


def _bounds(found: Summary, key: str) -> list[ChartLine]:
    """Return floor and optimum, the same for all filters of a case."""
    points = next((points for (kind, _), points in found.points.items() if kind == "filter"), [])
    along, series = _along(points, key), []
    x, curve = np.array([value for value, _ in along]), makes_curve(points, key)
    for bound, (words, mark) in _BOUNDS.items():
        y = np.array([_rms([getattr(point, bound) for point in group]) for _, group in along])
        if np.isfinite(y).any():
            dash, shown = (mark.dash, None) if curve else (None, mark)
            series.append(ChartLine(words, INK, dash, shown, 1.4, x, y))
    return series
