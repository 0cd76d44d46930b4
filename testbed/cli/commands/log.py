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
    map_: Annotated[
        Path | None, typer.Option("--map", metavar="LOG.yaml", help="Map to read it by; default what its words say.")
    ] = None,
    out: Annotated[Path | None, typer.Option(metavar="LOG.yaml", help="Map to write; default none.")] = None,
) -> None:
    """Say what a recording holds, channel by channel, and propose the map that reads it."""
    from testbed.cli.recordings import document, print_reports
    from testbed.logs.formats import open_table
    from testbed.logs.inspection import inspect as look
    from testbed.logs.logmap import load_map
    from testbed.logs.proposal import Proposal, propose, write_map
    from testbed.logs.reader import plans_of

    proposed = propose(open_table(source, text)) if map_ is None else Proposal(plans_of(source, load_map(map_)), ())
    table = proposed.plans[0].table
    reports = look(proposed.plans)
    if out is not None:
        write_map(out, source, proposed)
    found = {**document(table, reports, proposed), "written": None if out is None else str(out)}
    output.show(found, lambda: print_reports(table, reports, proposed))
    if out is not None:
        output.say(f"wrote {out}")
