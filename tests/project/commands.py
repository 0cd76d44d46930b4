"""Write the table of commands into docs/commands.md: `python -m tests.project.commands`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from tests.cli.commands import COMMANDS, arguments, options

PAGE = Path(__file__).parents[2] / "docs" / "commands.md"
BEGIN, END = "<!-- commands, written by `make commands` -->\n", "<!-- end of the commands -->\n"


def row(words: str, command: Any) -> str:
    """Return the row of a command: arguments, options but --json and --quiet, groups of options, summary."""
    parts = [words, *(_placeholder(part) for part in arguments(command))]
    mine = {word: part for word, part in options(command).items() if word not in ("--json", "--quiet", "--help")}
    own = [word for word, part in mine.items() if part.rich_help_panel is None]
    groups = dict.fromkeys(part.rich_help_panel for part in mine.values() if part.rich_help_panel)
    usage = " ".join([*parts, *([f"[{' '.join(own)}]"] if own else []), *(f"[{name.lower()}]" for name in groups)])
    return f"| `{usage}` | {' '.join(command.help.split())} |"


def _placeholder(part: Any) -> str:
    word = part.metavar + ("..." if part.nargs == -1 else "")
    return word if part.required else f"[{word}]"


def table() -> str:
    """Return the table of commands."""
    return "\n".join(["| command | does |", "|---|---|", *(row(*item) for item in COMMANDS.items())]) + "\n"


def with_table(text: str) -> str:
    """Return the text of the page with the table as the commands are."""
    head, rest = text.split(BEGIN)
    return head + BEGIN + table() + END + rest.split(END)[1]


if __name__ == "__main__":
    PAGE.write_text(with_table(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
