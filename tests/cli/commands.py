"""The commands as the command-line library knows them, for what holds of all of them."""

from __future__ import annotations

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


def arguments(command: Any) -> list[Any]:
    return [part for part in command.params if part.param_type_name == "argument"]


def options(command: Any) -> dict[str, Any]:
    return {part.opts[0]: part for part in command.params if part.param_type_name == "option"}
