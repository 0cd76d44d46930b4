"""The page of paper 3: Table 2 by both protocols, the Allan curves and the surviving rate of all methods together."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import matplotlib as mpl
from matplotlib.figure import Figure

from testbed.drift.figures import SIZE_IN, residual_allan_figure
from testbed.drift.findings import DRIFT_PERIOD, LEAST_GAIN
from testbed.pages.axes import marked
from testbed.pages.palette import COMMANDED, FILTERS, SENSORS, SOLID, TRUTH, Mark
from testbed.pages.svg import STYLE
from testbed.pages.template import render

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from testbed.drift.findings import Audit
    from testbed.pages.palette import Dash

# Colour and line of the methods, in the order of the table; the oracle last.
_STYLES: tuple[tuple[str, Dash], ...] = (
    (SENSORS[0], (0, None)),
    (COMMANDED, (0, (1.2, 1.6))),
    (COMMANDED, (0, (5, 2))),
    (SENSORS[2], (0, None)),
    (SENSORS[2], (0, (5, 2))),
    (SENSORS[2], (0, (1.2, 1.6))),
    (FILTERS[2], (0, None)),
    (FILTERS[3], (0, (7, 1.2, 1.5, 1.2))),
    (SENSORS[1], (0, (3, 1.2))),
    (FILTERS[4], (0, (3, 1.2))),
    (FILTERS[1], (0, (5, 2))),
    (FILTERS[0], (0, None)),
)


def page(rows: Sequence[Mapping[str, Any]], audits: Mapping[str, Audit], folders: Sequence[str], seeds: int) -> str:
    """Return the page as text.

    Parameters
    ----------
    rows : sequence of mapping
        Of the table: the columns of table_2.csv, None where there is no figure, and the paper's `paper_b`, `paper_n`.
    audits : mapping of str to Audit
        Of the first seed, by what the figures call them, in the order of the table.
    folders : sequence of str
        Where their own pages are.
    seeds : int
        Over which the rows are medians.
    """
    styles: dict[str, tuple[str, Dash]] = dict(zip(audits, _STYLES, strict=True))
    oracle = next(iter(audits.values())).oracle
    qualities = {name: audit.after for name, audit in audits.items()}
    if oracle is not None:
        qualities["oracle"] = oracle
    drawn = {
        "allan": residual_allan_figure(qualities, {**styles, "oracle": (TRUTH, (0, (1.2, 1.6)))}),
        "gain": _gain_figure(audits, styles),
    }
    return render("paper3.html.j2", drawn, rows=rows, seeds=seeds, folders=folders)


def _gain_figure(audits: Mapping[str, Audit], styles: Mapping[str, tuple[str, Dash]]) -> Figure:
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(SIZE_IN[0], 3.8), layout="constrained")
        axes = figure.subplots()
        for turn, (name, audit) in enumerate(audits.items()):
            color, dash = styles[name]
            period = [found.period for found in audit.gains]
            style = marked(Mark(dash, SOLID[turn % len(SOLID)], turn), color, len(period))
            axes.plot(period, [found.gain for found in audit.gains], color=color, label=name, **style)
        last = period[-1] * 1.2
        axes.axvspan(DRIFT_PERIOD, last, color=SENSORS[3], alpha=0.10, linewidth=0)
        axes.plot([DRIFT_PERIOD, last], [LEAST_GAIN] * 2, color="#c00000", linewidth=0.9)
        axes.set(xscale="log", xlabel="period of the true rate [s]", ylabel="gain [-]", ylim=(0.0, 1.08))
        axes.set_xlim(period[0] / 1.2, last)
        axes.grid(visible=True)
        figure.legend(loc="outside upper left", ncols=3, fontsize=8)
    return figure
