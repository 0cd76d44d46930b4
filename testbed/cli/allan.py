"""An Allan deviation on the terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.measure import Measurement

from testbed.cli.console import ruled, terminal
from testbed.judging.allan_analysis import TERMS
from testbed.judging.allan_words import data_sheet_lines, remarks_on

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from rich.table import Table

    from testbed.judging.allan_analysis import Analysis, Term


def print_allan(analyses: Sequence[Analysis], figure: Path) -> None:
    """Print the coefficients with their intervals, limits as limits, or why there are none."""
    console = terminal()
    for analysis in analyses:
        console.print(analysis.record.content, style="bold", soft_wrap=True)
        console.print(f"{analysis.record.rate.size} samples at {analysis.record.sample_rate_hz:.6g} Hz")
        if analysis.given:
            whole, short = _table(analysis, 7), _table(analysis, 5)
            fits = Measurement.get(console, console.options.update(width=1000), whole).maximum <= console.width
            console.print(whole if fits else short)
        sheet = data_sheet_lines(analysis) if analysis.given else []
        for line in (*sheet, analysis.verdict(), *remarks_on(analysis)):
            console.print(line, soft_wrap=True)
    console.print(f"wrote {figure}", soft_wrap=True)


def _table(analysis: Analysis, n_column: int) -> Table:
    """Return the coefficients in the first columns; SI comes last, for a narrow terminal has no room for it."""
    headings = ("", "term", "value", "95 % interval", "unit", "value in SI", "SI unit")
    table = ruled(*headings[:n_column])
    for term in TERMS:
        table.add_row(*_allan_row(analysis, term)[:n_column])
    return table


def _allan_row(analysis: Analysis, term: Term) -> tuple[str, ...]:
    found, name = analysis.coefficient(term), term.name.replace("_", " ")
    if not found.identified:
        limit = f"< {term.text(found.upper)}"
        return term.letter, name, limit, "not identified", term.unit, f"< {found.upper:.3g}", term.si
    interval = f"{term.text(found.lower)} to {term.text(found.upper)}"
    return term.letter, name, term.text(found.value), interval, term.unit, f"{found.value:.4g}", term.si
