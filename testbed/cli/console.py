"""Where tables and lines are printed."""

from __future__ import annotations

from rich.console import Console


def terminal() -> Console:
    """Return standard output: text as it is, for a name or a path may hold brackets and a number needs no colour."""
    console = Console(markup=False, highlight=False)
    # Without a terminal there is no width to respect: a log keeps whole lines.
    return console if console.is_terminal else Console(markup=False, highlight=False, width=180)
