"""Where tables and lines are printed."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.console import Console
from rich.table import Column, Table

if TYPE_CHECKING:
    from pathlib import Path


def terminal() -> Console:
    """Return standard output: text as it is, for a name or a path may hold brackets and a number needs no colour."""
    console = Console(markup=False, highlight=False)
    # Without a terminal there is no width to respect: a log keeps whole lines.
    return console if console.is_terminal else Console(markup=False, highlight=False, width=180)


def ruled(*headings: str, title: str | None = None) -> Table:
    """Return an empty table whose cells are folded where the terminal is narrow, never cut."""
    return Table(*(Column(heading, overflow="fold") for heading in headings), title=title, title_justify="left")


def print_written(place: Path) -> None:
    """Print where something was written.

    Parameters
    ----------
    place : Path
        A file or a folder.
    """
    terminal().print(f"wrote {place}", soft_wrap=True)
