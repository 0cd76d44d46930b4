"""Recordings: what one holds, before it is used."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from testbed.cli.options import Output, expanded
from testbed.logs.selection import TextOptions

app = typer.Typer(name="log", help="Look at recordings before they are used.", no_args_is_help=True)


@app.callback()
def _log() -> None:
    """Look at recordings before they are used."""


@app.command()
@expanded
def inspect(
    source: Annotated[Path, typer.Argument(metavar="FILE", help="Recording of any format.")],
    output: Output,
    text: TextOptions,
    out: Annotated[Path | None, typer.Option(metavar="LOG.yaml", help="Map to write; default none.")] = None,
) -> None:
    """Say what a recording holds, channel by channel, and propose the map that reads it."""
    from testbed.cli.recordings import document, print_reports
    from testbed.logs.formats import open_table
    from testbed.logs.inspection import inspect as look
    from testbed.logs.proposal import propose, write_map

    table = open_table(source, text)
    proposed = propose(table)
    reports = look(proposed.plans)
    if out is not None:
        write_map(out, source, proposed)
    found = {**document(table, reports, proposed), "written": None if out is None else str(out)}
    output.show(found, lambda: print_reports(table, reports, proposed))
    if out is not None:
        output.say(f"wrote {out}")
