"""What a chain costs and what it leaves: all candidates, and those worth their cost."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import matplotlib as mpl
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from testbed.pages.axes import WIDTH_IN, arrange
from testbed.pages.decades import decade_axis
from testbed.pages.svg import INK, STYLE

if TYPE_CHECKING:
    from testbed.design.search import Design

_FRONT = "#1f5fa8"
# Whether a candidate is enough is told by more than the colour.
_ENOUGH: dict[str, Any] = {"color": "#1a7f4b", "marker": "o", "linestyle": "none", "markersize": 5.5}
_NOT_ENOUGH: dict[str, Any] = {**_ENOUGH, "color": "#8a8a8a", "marker": "x", "markeredgewidth": 1.3}


def pareto_figure(design: Design, metric: str, limit: float, words: str) -> Figure:
    """Draw cost against error of every candidate, the front of those worth their cost, and what is asked.

    Parameters
    ----------
    design : Design
        The candidates.
    metric : str
        Which error [urad].
    limit : float
        What is asked [urad].
    words : str
        Name of the error.

    Returns
    -------
    Figure
        One axes, error on a logarithmic axis.
    """
    front = design.pareto(metric)
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(WIDTH_IN, 4.6))
        axes = figure.subplots()
        axes.set_yscale("log")
        for met, look in ((False, _NOT_ENOUGH), (True, _ENOUGH)):
            some = [one for one in design.candidates if one.met == met]
            axes.plot([one.cost for one in some], [one.values[metric] for one in some], **look)
        axes.step(
            [one.cost for one in front],
            [one.values[metric] for one in front],
            where="post",
            color=_FRONT,
            linewidth=1.4,
        )
        axes.axhline(limit, color=INK, linewidth=0.9, linestyle=(0, (5, 2)))
        if (chosen := design.chosen) is not None:
            place = chosen.cost, chosen.values[metric]
            axes.plot(*place, "o", color=_FRONT, markersize=12, fillstyle="none", markeredgewidth=1.6)
            axes.annotate(chosen.name, place, xytext=(-11, -3), textcoords="offset points", ha="right", va="top")
        axes.set_xlabel("cost")
        axes.set_ylabel(f"{words} [µrad]")
        axes.margins(x=0.08, y=0.16)
        decade_axis(axes)
        axes.grid(visible=True)
        arrange(
            figure,
            [
                Line2D([], [], label="is enough", **_ENOUGH),
                Line2D([], [], label="is not", **_NOT_ENOUGH),
                Line2D([], [], color=_FRONT, linewidth=1.4, label="none cheaper is as good"),
                Line2D([], [], color=INK, linewidth=0.9, linestyle=(0, (5, 2)), label="asked"),
            ],
        )
    return figure
