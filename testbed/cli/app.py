"""The commands in the order of `testbed --help`, and the exit status. Imports here are light."""

from __future__ import annotations

import signal
import sys
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer

from testbed._version import __version__
from testbed.cli.commands import allan, compensate, folder, parts, reproduce, scenario
from testbed.cli.status import BAD_INPUT, FAILED, INTERRUPTED, OK
from testbed.errors import RunError, ScenarioError

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import FrameType

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
app.command()(reproduce.reproduce)
app.add_typer(compensate.app)


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


def main() -> None:
    """Run the command line; errors become one clear message and the exit status of the contract."""
    signal.signal(signal.SIGTERM, _interrupt)
    try:
        status = app(standalone_mode=False)
    except ScenarioError as error:
        _fail(str(error), BAD_INPUT)
    except RunError as error:
        _fail(str(error), FAILED)
    except Exception as error:  # noqa: BLE001 - told apart by _usage, which raises what it does not know
        _usage(error)
    # The command-line library turns an interrupt into its own exit status.
    if status == INTERRUPTED:
        _fail("interrupted; nothing was left behind", INTERRUPTED)
    sys.exit(status if isinstance(status, int) else OK)


def _usage(error: Exception) -> NoReturn:
    """Show what is wrong with the call; anything else is a fault of ours and keeps its traceback."""
    show: Callable[[], None] | None = getattr(error, "show", None)
    if show is None:
        raise error
    show()
    sys.exit(BAD_INPUT)


def _interrupt(_signal: int, _frame: FrameType | None) -> NoReturn:
    raise KeyboardInterrupt


def _fail(message: str, status: int) -> NoReturn:
    typer.echo(message if status == INTERRUPTED else f"error: {message}", err=True)
    sys.exit(status)
