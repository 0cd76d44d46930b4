"""Plots over time as the layout of a recording has them: where the legend stands, and what sets the scale."""

from __future__ import annotations

from typing import TYPE_CHECKING

import rerun as rr
import rerun.blueprint as rrb

from testbed.recording.stream import TIMELINE

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from testbed.units import RateUnit

LEGEND = 0.25  # room for the legend, as a share of the span
MARGIN = 0.05  # room on the right, as a share of the span, in which the last time on the axis stands whole
BESIDE = 4  # plots of errors that stand beside each other, as wide as their titles
FLAT = 4.0  # times smaller than the largest is flat in its scale

# Least and largest value after settle, None where none is known.
Extremes = tuple[float, float] | None


def _absolute(seconds: float) -> rrb.TimeRangeBoundary:
    return rrb.TimeRangeBoundary.absolute(seconds=seconds)


def plot(
    name: str,
    contents: Iterable[str],
    span: tuple[float, float],
    legend: float = LEGEND,
    extremes: Extremes = None,
) -> rrb.TimeSeriesView:
    """Return a plot over a part of the run.

    Parameters
    ----------
    name : str
        Title, with the unit.
    contents : iterable of str
        Paths of the signals.
    span : tuple of float
        Start and end of the part [s].
    legend : float, optional
        Room for the legend as a share of the span; without room there is none.
    extremes : tuple of float, optional
        What sets the scale [unit]; else all that is in the plot does.
    """
    data = rr.TimeRange(start=_absolute(span[0]), end=_absolute(span[1]))
    # The legend stands in an empty margin, not on the curves.
    length = span[1] - span[0]
    shown = rr.TimeRange(start=_absolute(span[0] - legend * length), end=_absolute(span[1] + MARGIN * length))
    return _series(name, contents, data, shown, legend=legend > 0.0, extremes=extremes)


def at_cursor(name: str, contents: Iterable[str], around: tuple[float, float]) -> rrb.TimeSeriesView:
    """Return a plot that goes along with the time cursor.

    Parameters
    ----------
    name : str
        Title, with the unit.
    contents : iterable of str
        Paths of the signals.
    around : tuple of float
        Start and end from the cursor on [s].
    """
    at, (before, behind) = rrb.TimeRangeBoundary.cursor_relative, around
    length = behind - before
    data = rr.TimeRange(start=at(seconds=before), end=at(seconds=behind))
    shown = rr.TimeRange(start=at(seconds=before - LEGEND * length), end=at(seconds=behind + MARGIN * length))
    return _series(name, contents, data, shown)


def _series(
    name: str,
    contents: Iterable[str],
    data: rr.TimeRange,
    shown: rr.TimeRange,
    *,
    legend: bool = True,
    extremes: Extremes = None,
) -> rrb.TimeSeriesView:
    low, high = extremes or (0.0, 0.0)
    edge = 0.05 * (high - low)
    return rrb.TimeSeriesView(
        origin="/",
        contents=list(contents),
        name=name,
        axis_x=rrb.TimeAxis(view_range=shown),
        time_ranges=[rrb.VisibleTimeRange(TIMELINE, range=data)],
        axis_y=rrb.ScalarAxis(range=(low - edge, high + edge)) if high > low else None,
        plot_legend=rrb.PlotLegend("LeftTop", visible=legend),
    )


def errors_in_row(
    title: str, words: str, errors: Mapping[str, Extremes], span: tuple[float, float], unit: RateUnit
) -> rrb.Container:
    """Return the errors beside each other, for they would hide each other in one plot; in one scale but for those that
    would be flat in it.

    Parameters
    ----------
    title : str
        Of all.
    words : str
        Title of one, {} where its filter stands.
    errors : mapping of str to tuple of float or None
        Path of each error, and its extremes [unit] where they are to set its scale.
    span : tuple of float
        Start and end of the part of the run [s].
    unit : str
        Of the errors.
    """
    sizes = {entity: max(map(abs, found)) for entity, found in errors.items() if found is not None}
    largest = max(sizes.values(), default=0.0)
    plots = []
    for entity in errors:
        shared = largest if sizes.get(entity, 0.0) > largest / FLAT else None
        name = f"{words.format(entity.split('/')[2])} [{unit}]"
        plots.append(plot(name, [entity], span, 0.0, None if shared is None else (-shared, shared)))
    if len(plots) <= BESIDE:
        return rrb.Horizontal(*plots, name=title)
    return rrb.Grid(*plots, grid_columns=-(-len(plots) // 2), name=title)
