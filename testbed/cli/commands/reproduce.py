"""The papers' measurements again."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from testbed.cli.options import Output, expanded
from testbed.reproduce import PAPERS, paper_tables, run_paper


@expanded
def reproduce(
    paper: Annotated[
        str,
        typer.Argument(
            metavar="PAPER",
            help=f"Which paper: {', '.join(PAPERS)}.",
            autocompletion=lambda incomplete: [name for name in PAPERS if name.startswith(incomplete)],
        ),
    ],
    output: Output,
    seeds: Annotated[
        int | None, typer.Option(min=1, help="Seeds to take the median over; default 10 for paper1, 1 for the others.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Folder for tables and figures; default runs/<paper>.")] = None,
) -> None:
    """Repeat the measurements of paper1, paper2 or paper3 and print its numbers beside ours."""
    from testbed.cli.console import print_written

    folder = out or Path("runs") / paper
    for line in run_paper(paper, seeds, folder):
        output.say(line)
    output.show(
        {"paper": paper, "tables": paper_tables(paper, folder), "written": str(folder)}, lambda: print_written(folder)
    )
