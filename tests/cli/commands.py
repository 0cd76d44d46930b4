"""The commands as the command-line library knows them, for what holds of all of them."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from testbed.cli.app import app

if TYPE_CHECKING:
    from collections.abc import Iterator


def leaves(group: Any, words: tuple[str, ...] = ("testbed",)) -> Iterator[tuple[str, Any]]:
    """Yield each command with its words, those of a group one by one."""
    for name, command in group.commands.items():
        if hasattr(command, "commands"):
            yield from leaves(command, (*words, name))
        else:
            yield " ".join((*words, name)), command


COMMANDS = dict(leaves(typer.main.get_command(app)))


def documented() -> dict[str, set[str]]:
    """Return what docs/commands.md says are the keys of each command's document."""
    page = (Path(__file__).parents[2] / "docs" / "commands.md").read_text(encoding="utf-8")
    section = page.split("## Documents of `--json`")[1]
    rows = re.findall(r"^\| `(testbed [^`]*)` \| (.*) \|$", section, flags=re.MULTILINE)
    # What is said in brackets is inside of a value.
    return {words: set(re.findall(r"`([^`]*)`", re.sub(r"\([^)]*\)", "", keys))) for words, keys in rows}


def arguments(command: Any) -> list[Any]:
    return [part for part in command.params if part.param_type_name == "argument"]


def options(command: Any) -> dict[str, Any]:
    return {part.opts[0]: part for part in command.params if part.param_type_name == "option"}
