"""``leaderboard.html``: the filters in their order, what moved, and how errors went from version to version."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from testbed.campaigns.regression.leaderboard import standings
from testbed.pages.axes import WIDTH_IN, arrange, label, marked
from testbed.pages.palette import color_of, series_marks
from testbed.pages.svg import STYLE
from testbed.pages.template import render
from testbed.runs.atomic import write_text

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    from testbed.campaigns.regression.compare import Move
    from testbed.campaigns.regression.leaderboard import Standing
    from testbed.campaigns.study import Study

PAGE = "leaderboard.html"


def write_leaderboard(
    folder: Path,
    study: Study,
    order: Sequence[Standing],
    moved: Sequence[Move],
    history: Sequence[Mapping[str, Any]],
    campaign: str,
) -> None:
    """Write the page.

    Parameters
    ----------
    folder : Path
        Of the campaign.
    study : Study
        What was played.
    order : sequence of Standing
        The filters from the best on.
    moved : sequence of Move
        Against the baseline.
    history, campaign : sequence of mapping, str
        What is stored, and which of it is meant.
    """
    entries = entries_of(history, campaign)
    figures = {"history": history_figure(history, campaign)} if entries else {}
    text = render(
        "leaderboard.html.j2", figures, study=study, standings=order, moves=moved, entries=entries, campaign=campaign
    )
    write_text(folder / PAGE, text)


def entries_of(history: Sequence[Mapping[str, Any]], campaign: str) -> list[tuple[int, str, str]]:
    """Return number, version and reason of each entry of a campaign, the oldest first.

    Parameters
    ----------
    history, campaign : sequence of mapping, str
        What is stored, and which of it.
    """
    return sorted({(row["entry"], row["version"], row["reason"]) for row in history if row["campaign"] == campaign})


def history_figure(history: Sequence[Mapping[str, Any]], campaign: str) -> Figure:
    """Return the error over the optimum of every filter against the entries of a campaign.

    Parameters
    ----------
    history, campaign : sequence of mapping, str
        What is stored, and which of it.
    """
    entries = entries_of(history, campaign)
    found = [
        {
            one.name: one
            for one in standings([row for row in history if row["entry"] == number and row["campaign"] == campaign], {})
        }
        for number, _, _ in entries
    ]
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(WIDTH_IN, 3.6))
        axes = figure.subplots()
        handles: list[Line2D | Patch] = []
        names = dict.fromkeys(name for one in found for name in one)
        marks = series_marks(f"fusion/{name}" for name in names)
        for name in names:
            values = [one[name].over_optimum if name in one else np.nan for one in found]
            color = color_of(f"fusion/{name}")
            style = marked(marks[f"fusion/{name}"], color)
            handles += axes.plot(range(1, len(entries) + 1), values, color=color, label=label(name), **style)
        axes.set_yscale("log")
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        axes.set_xlabel("entry")
        axes.set_ylabel("error over optimum [-]")
        axes.grid(visible=True)
        arrange(figure, handles)
    return figure
