"""The grammar of the command line: options that commands share, and where their words go."""

from __future__ import annotations

import dataclasses
import functools
import inspect
import json as encoder
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

import typer

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping

ScenarioFile = Annotated[Path, typer.Argument(metavar="SCENARIO.yaml", help="Scenario file.")]
PluginModules = Annotated[
    list[str] | None,
    typer.Option(
        "--plugin",
        metavar="MODULE",
        help="Module, dotted or as the path of a .py, to load first: it runs with your rights. May be repeated.",
    ),
]
AllowOutside = Annotated[
    bool, typer.Option("--allow-outside", help="Let a recorded motion lie outside the scenario's folder.")
]
WantedOutputs = Annotated[
    str | None,
    typer.Option("--outputs", metavar="LIST", help="What to write, of metrics,netcdf,recording,report; default all."),
]
RunDir = Annotated[Path, typer.Argument(metavar="RUN_DIR", help="Run folder.")]


@dataclass(frozen=True)
class Output:
    """Where the words of a command go: its result to standard output, all else to standard error.

    Parameters
    ----------
    json : bool
        One document instead of tables.
    quiet : bool
        Neither progress nor tables.
    """

    json: bool = field(default=False, metadata={"option": "--json", "help": "Print one JSON document, no tables."})
    quiet: bool = field(default=False, metadata={"option": "--quiet", "help": "Print no progress and no tables."})

    def note(self, text: str) -> None:
        """Say what is being done."""
        if not self.quiet:
            typer.echo(text, err=True)

    def warn(self, doubts: Iterable[str]) -> None:
        """Say what may be wrong, even where all else is quiet."""
        for doubt in doubts:
            typer.echo(f"warning: {doubt}", err=True)

    def say(self, text: str) -> None:
        """Print a line of the result for people; beside a document it is progress."""
        if not self.quiet:
            typer.echo(text, err=self.json)

    def show(self, document: Mapping[str, Any], tables: Callable[[], object]) -> None:
        """Print the result: `document` for a program, or what `tables` prints for people.

        Parameters
        ----------
        document : mapping
            Keys carry their units, as in metrics.json; None stands for what is undefined.
        tables : callable
            Prints.
        """
        if self.json:
            typer.echo(encoder.dumps(document, indent=2, allow_nan=False))
        elif not self.quiet:
            tables()

    @contextmanager
    def progress(self, name: str, duration: float) -> Iterator[Callable[[float], None]]:
        """Show how much of `duration` [s] is done, by what is yielded, on standard error."""
        from testbed.cli.progress import progress

        if self.quiet:
            yield lambda _done: None
        else:
            with progress(name, duration) as tick:
                yield tick


def expanded(command: Callable[..., None]) -> Callable[..., None]:
    """Replace each parameter of a command that is a dataclass by an option for each of its fields.

    So options that several commands share are written once. The metadata of a field give its `option` and its `help`,
    and may give its `metavar`; a class may name the `PANEL` of the help in which its options stand together.

    Parameters
    ----------
    command : callable
        With annotated parameters.

    Returns
    -------
    callable
        What the command-line library reads: the parameters of `command` and, after them, the options.
    """
    hints = get_type_hints(command, include_extras=True)
    groups = {name: hints[name] for name in inspect.signature(command).parameters if _is_group(hints[name])}
    options = {part.name: (group, part) for group, kind in groups.items() for part in dataclasses.fields(kind)}

    @functools.wraps(command)
    def call(**given: Any) -> None:
        for group, kind in groups.items():
            given[group] = kind(**{name: given.pop(name) for name, (owner, _) in options.items() if owner == group})
        command(**given)

    own = [
        parameter.replace(kind=inspect.Parameter.KEYWORD_ONLY, annotation=hints[parameter.name])
        for parameter in inspect.signature(command).parameters.values()
        if parameter.name not in groups
    ]
    shared = [_option(part, groups[group]) for group, part in options.values()]
    call.__signature__ = inspect.Signature([*own, *shared])  # type: ignore[attr-defined]
    call.__annotations__ = {parameter.name: parameter.annotation for parameter in [*own, *shared]}
    return call


def _is_group(hint: Any) -> bool:
    return isinstance(hint, type) and dataclasses.is_dataclass(hint)


def _option(part: dataclasses.Field[Any], kind: type) -> inspect.Parameter:
    words = part.metadata
    panel = getattr(kind, "PANEL", None)
    option = typer.Option(words["option"], help=words["help"], metavar=words.get("metavar"), rich_help_panel=panel)
    annotation: Any = Annotated[get_type_hints(kind)[part.name], option]
    return inspect.Parameter(part.name, inspect.Parameter.KEYWORD_ONLY, default=part.default, annotation=annotation)
