"""What figures share: envelopes, legend and margins, units and the axis of time."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.ticker import FuncFormatter, MultipleLocator

from testbed.pages.numbers import plain
from testbed.pages.palette import marked_every
from testbed.pages.svg import INK

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    from testbed.pages.envelope import Envelope
    from testbed.pages.palette import Mark

WIDTH_IN = 9.2
DEGREE = float(np.degrees(1.0))
# Longer than this is read in hours [s].
HOURS_FROM = 7200.0
# Hours between two marks, the first that leaves at most twelve of them.
HOUR_STEPS = (0.5, 1.0, 2.0, 3.0, 6.0, 12.0, 24.0)


def draw(
    axes: Axes,
    envelope: Envelope,
    color: str,
    width: float,
    alpha: float = 1.0,
    scale: float = DEGREE,
    mark: Mark | None = None,
) -> None:
    """Fill between the extremes, times `scale`, with an outline so that a quiet signal is still a line; a few marks,
    dark so that they stand out of the area, tell it from others where there is no colour.
    """
    low, high = scale * envelope.low, scale * envelope.high
    axes.fill_between(
        envelope.time, low, high, facecolor=color, edgecolor=color, linewidth=width, alpha=alpha, joinstyle="round"
    )
    if mark is not None:
        style = on_area(mark, color, envelope.time.size) | {"linestyle": "none"}
        axes.plot(envelope.time, (low + high) / 2.0, color=color, **style)


def marked(mark: Mark, color: str, n_points: int | None = None) -> dict[str, Any]:
    """Return dashes and mark of a line as matplotlib takes them; of many points a few are marked, each line elsewhere.

    Parameters
    ----------
    mark : Mark
        Of the name.
    color : str
        Of the line; a rim in the colour of the text sets a solid mark off from a filled area.
    n_points : int, optional
        Points of the line; without it every one has a mark, as in a legend.
    """
    rimmed = mark.marker not in "x+12"
    style: dict[str, Any] = {
        "linestyle": mark.dash,
        "marker": mark.marker,
        "markersize": 4.5 if rimmed else 6.0,
        "markeredgecolor": INK if rimmed else color,
        "markeredgewidth": 0.6 if rimmed else 1.3,
        "markerfacecolor": color,
    }
    if n_points is not None:
        style["markevery"] = marked_every(mark, n_points)
    return style


def on_area(mark: Mark, color: str, n_points: int | None = None) -> dict[str, Any]:
    """Return the look of the edge of a filled area, as `marked`: full, for an area has no dashes, and with dark marks.

    Parameters
    ----------
    mark : Mark
        Of the name.
    color : str
        Of the area.
    n_points : int, optional
        As of `marked`.
    """
    return marked(mark, color, n_points) | {"linestyle": "-", "markeredgecolor": INK}


def arrange(figure: Figure, handles: list[Line2D | Patch], gap_in: float = 0.42) -> None:
    """Put the legend above the axes, in equal rows as wide as its longest name allows, and set the margins in inches.

    Solving for the layout would cost as much time as drawing the figure.
    """
    entry_pt = 45.0 + 5.4 * max(len(str(handle.get_label())) for handle in handles)
    n_rows = -(-len(handles) // max(1, int(72.0 * WIDTH_IN / entry_pt)))
    n_columns = -(-len(handles) // n_rows)
    width, height = figure.get_size_inches()
    top = height - 0.08 - 0.2 * n_rows
    figure.legend(
        # The library fills column by column; people read row by row.
        handles=[handle for column in range(n_columns) for handle in handles[column::n_columns]],
        loc="lower left",
        bbox_to_anchor=(0.0, top / height),
        ncols=n_columns,
        borderaxespad=0.0,
    )
    figure.align_ylabels()
    place = figure.axes[0].get_subplotspec()
    rows = len(figure.axes) if place is None else place.get_gridspec().nrows
    each = (top - 0.3 - 0.48) / rows
    figure.subplots_adjust(
        left=0.82 / width,
        right=1.0 - 0.2 / width,
        bottom=0.48 / height,
        top=(top - 0.3) / height,
        hspace=min(gap_in / max(each - gap_in, 0.1), 1.0),
    )


def label(group: str) -> str:
    """Return the instance's name; a dollar sign would start a formula."""
    return group.split("/", 1)[-1].replace("$", r"\$")


def time_axis(axes: Axes, span_s: float, *, named: bool = True) -> None:
    """Mark the axis of time, whose data are seconds: in hours if it spans two or more.

    Parameters
    ----------
    axes : Axes
        Whose x axis it is.
    span_s : float
        What it shows [s].
    named : bool
        Whether it gets a label.
    """
    if span_s >= HOURS_FROM:
        step = next((h for h in HOUR_STEPS if span_s <= 12.0 * 3600.0 * h), span_s / 3600.0)
        axes.xaxis.set_major_locator(MultipleLocator(3600.0 * step))
        axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: plain(value / 3600.0)))
    if named:
        axes.set_xlabel("time [h]" if span_s >= HOURS_FROM else "time [s]")
