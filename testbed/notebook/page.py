"""The error table of a run as HTML, as a notebook shows it."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING

from testbed.runs.table import HEADINGS, NOTHING, error_cells, error_title, error_unit

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from testbed.runs.metrics import RunMetrics


def error_page(metrics: RunMetrics) -> str:
    """Return the table of errors, the expectations below it.

    Parameters
    ----------
    metrics : RunMetrics
        Of the run.
    """
    _, scale = error_unit(metrics)
    rows = {name: error_cells(source, scale) for name, source in metrics.sources.items()}
    shown = [i for i in range(len(HEADINGS)) if not i or any(cells[i] != NOTHING for cells in rows.values())]
    head = "".join(f"<th>{escape(HEADINGS[i])}</th>" for i in shown)
    body = "".join(_row(name, [cells[i] for i in shown]) for name, cells in rows.items())
    return (
        f"<table><caption>{escape(error_title(metrics))}</caption>"
        f"<thead><tr><th></th>{head}</tr></thead><tbody>{body}</tbody></table>{_expectations(metrics)}"
    )


def _row(name: str, cells: Sequence[str]) -> str:
    return f"<tr><th>{escape(name)}</th>{''.join(f'<td>{escape(cell)}</td>' for cell in cells)}</tr>"


def _expectations(metrics: RunMetrics) -> str:
    verdict: Mapping[bool, str] = {True: "met", False: "MISSED"}
    lines = (f"{one.subject} {one.metric} {one.bound}: {verdict[one.met]}" for one in metrics.expectations)
    return "".join(f"<div>expected {escape(line)}</div>" for line in lines)
