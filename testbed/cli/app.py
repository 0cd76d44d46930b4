"""The commands in the order of `testbed --help`. Imports here are light."""

from __future__ import annotations

from typing import Annotated

import typer

from testbed._version import __version__
from testbed.cli.commands import (
    allan,
    compensate,
    design,
    folder,
    identify,
    log,
    parts,
    playback,
    pointing,
    psd,
    regress,
    reproduce,
    scenario,
    sweep,
)
from testbed.cli.status import OK

app = typer.Typer(
    name="testbed",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

app.command()(scenario.run)
app.command()(scenario.check)
app.command("list")(parts.list_parts)
app.command()(scenario.schema)
app.command()(folder.view)
app.command()(folder.report)
app.command()(allan.allan)
app.command()(psd.psd)
app.command()(playback.replay)
app.command()(playback.export)
app.command()(identify.identify)
app.command()(pointing.pointing)
app.command()(design.design)
app.command()(reproduce.reproduce)
app.command()(sweep.sweep)
app.command()(regress.regress)
app.add_typer(compensate.app)
app.add_typer(log.app)


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"testbed {__version__}")
        raise typer.Exit(OK)


@app.callback()
def _testbed(
    _version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Physics testbed for wide-band angular-rate sensing."""
