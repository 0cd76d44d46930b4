"""Command line of recordings: the options that say what a file does not, and `testbed log inspect`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from testbed.logs.options import TextOptions
    from testbed.logs.selection import Selection

app = typer.Typer(name="log", help="Look at recordings before they are used.", no_args_is_help=True)

Column = Annotated[
    list[str] | None,
    typer.Option(help="Column by name, or by number from 1 on; several times for several. Default: all rates."),
]
Unit = Annotated[str | None, typer.Option(help="Unit of the column, such as deg/s; default that in the file.")]
Scale = Annotated[str | None, typer.Option(help="What a count is, instead of the unit, such as '0.07 deg/s'.")]
Kind = Annotated[str | None, typer.Option(help="rate, increment (angle since the sample before) or angle.")]
Rate = Annotated[str | None, typer.Option(metavar="HZ", help="Sample rate of even samples, instead of --time.")]
Time = Annotated[str | None, typer.Option(help="Column of the time; default the one whose name says so.")]
TimeUnit = Annotated[str | None, typer.Option(help="Unit of the time; default that in the file, or s.")]
Map = Annotated[Path | None, typer.Option("--map", metavar="LOG.yaml", help="Map of the recording, instead of these.")]
Separator = Annotated[str | None, typer.Option(help="Between the fields of a text: , ; | tab or blank.")]
Decimal = Annotated[str | None, typer.Option(help="Decimal mark of a text: . or ,")]
Encoding = Annotated[str | None, typer.Option(help="Encoding of a text, such as cp1252.")]
Skip = Annotated[int | None, typer.Option(min=0, metavar="LINES", help="Lines of a text to leave out at its head.")]


def text_options(separator: str | None, decimal: str | None, encoding: str | None, skip: int | None) -> TextOptions:
    """Return how a text file is written."""
    from testbed.logs.options import TextOptions

    return TextOptions(separator, decimal, encoding, skip)


def selection(
    column: list[str] | None,
    unit: str | None,
    scale: str | None,
    kind: str | None,
    rate: str | None,
    time: str | None,
    time_unit: str | None,
    map_: Path | None,
    text: TextOptions,
) -> Selection:
    """Return what the options say of a recording."""
    from testbed.logs.selection import Selection

    return Selection(tuple(column or ()), unit, scale, kind, rate, time, time_unit, map_, text)


@app.command()
def inspect(
    source: Annotated[Path, typer.Argument(metavar="FILE", help="Recording of any format.")],
    out: Annotated[Path | None, typer.Option(help="Map to write, such as log.yaml.")] = None,
    json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
    separator: Separator = None,
    decimal: Decimal = None,
    encoding: Encoding = None,
    skip: Skip = None,
) -> None:
    """Say what a recording holds, channel by channel, and propose the map that reads it."""
    from testbed.cli.terminal_log import print_json, print_reports
    from testbed.logs.formats import open_table
    from testbed.logs.inspection import inspect as look
    from testbed.logs.proposal import propose, write_map

    table = open_table(source, text_options(separator, decimal, encoding, skip))
    proposed = propose(table)
    reports = look(proposed.plans)
    if json:
        print_json(table, reports, proposed)
    else:
        print_reports(table, reports, proposed)
    if out is not None:
        write_map(out, source, proposed)
        typer.echo(f"wrote {out}", err=json)
