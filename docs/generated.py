"""The pages of the reference that follow from the code: commands, keys, instruments, formats of a run, Python names."""

from __future__ import annotations

import inspect
import json
import math
import re
from importlib import resources
from typing import TYPE_CHECKING, Any

import typer.main
from numpydoc.docscrape import NumpyDocString
from typer.cli import get_docs_for_click

import testbed
from testbed.campaigns.regression.history import latest, read_history
from testbed.campaigns.regression.leaderboard import standings
from testbed.campaigns.regression.page import entries_of
from testbed.campaigns.regression.standard import AXES, STANDARD
from testbed.cli.app import app
from testbed.scenario.frame import Frame
from testbed.scenario.schema import schema

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from pathlib import Path

_LONGEST = 60
_STANDINGS = (
    *("filter", "error over optimum", "95 %", "worst", "where", "claims hold", "error over claim"),
    *("time over kalman's", "line of sight [urad]"),
)
_OTHERS = re.compile(r"\n(?:Examples|Raises|References|Notes)\n---")
# A bar outside of a formula, and the mark of a reference.
_BAR, _CITED = re.compile(r"(?<![`\\])\|(?![^`\n]*`)"), re.compile(r"\s*\[\d+\]_")
_MATH = re.compile(r":math:`([^`]*)`")


def write_pages(folder: Path) -> None:
    """Write every page that is not there as it should be; an unchanged one keeps its time, so that it is not built."""
    folder.mkdir(parents=True, exist_ok=True)
    pages = {
        "commands.md": commands(),
        "keys.md": keys(),
        "presets.md": presets(),
        "api.md": api(),
        "standings.md": leaderboard(),
    }
    for name, text in pages.items():
        path = folder / name
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")


def commands() -> str:
    """Return the reference of the commands, by typer's own generator."""
    group = typer.main.get_command(app)
    text = get_docs_for_click(obj=group, ctx=typer.Context(group), name="testbed", title="Commands")
    for name, summary in _summaries(group):
        # The generator ends a summary after 45 letters.
        whole = f"* `{name}`: {summary}"
        text = re.sub(rf"^\* `{name}`: .*\.\.\.$", lambda _, whole=whole: whole, text, flags=re.MULTILINE)
    return text


def _summaries(group: Any) -> Iterator[tuple[str, str]]:
    for name, command in group.commands.items():
        yield name, inspect.cleandoc(command.help or "").split("\n\n")[0].replace("\n", " ")
        yield from _summaries(command) if hasattr(command, "commands") else ()


def leaderboard() -> str:
    """Return the filters in their order, from the baseline of the standard campaign, and its entries."""
    history = read_history()
    rows = latest(history, STANDARD)
    order = standings(rows, {row["source"]: row["cost"] for row in rows if row["cost"] is not None})
    parts = [
        "# Leaderboard: the table\n",
        "What the columns mean, how a filter enters and how the table is cited: [leaderboard](../../leaderboard.md).\n",
        f"| {' | '.join(_STANDINGS)} |",
        f"|{'---|' * len(_STANDINGS)}",
    ]
    for one in order:
        claims = f"{100 * one.honest:.0f} % | {one.error_over_claim:.3g}"
        cost = "" if one.cost is None else f"{one.cost:.2g}"
        error = f"{one.over_optimum:.3g} | {one.lower:.3g} to {one.upper:.3g} | {one.worst:.3g} | {one.worst_case}"
        sight = "" if math.isnan(one.residual) else f"{one.residual:.3g}"
        parts.append(f"| `{one.name}` | {error} | {claims} | {cost} | {sight} |")
    cases, seeds = {tuple(row[axis] for axis in AXES) for row in rows}, {row["seed"] for row in rows}
    parts += ["", f"{len(cases)} cases, {len(seeds)} seeds each.\n", "## Entries\n"]
    parts += [
        f"{place}. {version}: {reason}" for place, (_, version, reason) in enumerate(entries_of(history, STANDARD), 1)
    ]
    return "\n".join(parts) + "\n"


def presets() -> str:
    """Return every shipped instrument as its file has it: the comments are its sources."""
    folder = resources.files("testbed.sensors") / "presets"
    parts = [
        "# Instruments\n",
        "Every preset as it is shipped. The comments say where each figure is from, or that it is assumed.\n",
    ]
    for name in testbed.list_presets():
        text = (folder / f"{name}.yaml").read_text(encoding="utf-8").rstrip()
        parts.append(f"## {name}\n\n```yaml\n{text}\n```\n")
    return "\n".join(parts)


def api() -> str:
    """Return the public names of `testbed` with their docstrings."""
    parts = [
        "# Python names\n",
        "What `import testbed` offers. Everything else is in the rooms of the [house](../../architecture.md).\n",
    ]
    for name in sorted(set(testbed.__all__) - {"__version__"}, key=str.lower):
        kind = "autoclass" if isinstance(getattr(testbed, name), type) else "autofunction"
        parts.append(f"## {name}\n\n```{{eval-rst}}\n.. {kind}:: testbed.{name}\n```\n")
    return "\n".join(parts)


def keys() -> str:
    """Return the keys of a scenario and of all its parts, from the schema that `testbed schema` prints."""
    whole = schema()
    parts = [
        "# Keys of a scenario\n",
        "From the schema that `testbed schema` prints; an editor that knows it completes keys and marks mistakes.",
        "Every dimensional value is a number with its unit, such as `20 s`.\n",
        "## Top level\n",
        _table(whole, Frame.__doc__ or ""),
    ]
    for title, found in _groups(whole):
        parts.append(f"## {title}\n")
        for name, entry in found:
            text = inspect.cleandoc(entry.get("description", ""))
            parts += [f"### {name}\n", _summary(text), _table(entry, text)]
    return "\n".join(parts)


def _groups(whole: Mapping[str, Any]) -> Iterator[tuple[str, list[tuple[str, Mapping[str, Any]]]]]:
    top = whole["properties"]
    yield "Turntable", [("turntable", top["turntable"])]
    yield "Motions", [next(iter(one["properties"].items())) for one in top["motion"]["items"]["oneOf"]]
    yield "Sensors", [(one["title"], one) for one in top["sensors"]["additionalProperties"]["anyOf"]]
    yield "Filters", list(top["fusion"]["properties"].items())
    yield "Pointing", [("pointing", top["pointing"])]
    yield "Parts of these", sorted(whole["$defs"].items())


def _summary(text: str) -> str:
    """Return what stands before the first section of a docstring, as the block that Sphinx understands."""
    head = text.split("\nParameters\n---", maxsplit=1)[0].strip()
    # Bars are magnitudes, which reStructuredText takes for substitutions, and the references stand in the docstring.
    head = _CITED.sub("", _BAR.sub(r"\\|", head))
    return f"```{{eval-rst}}\n{head}\n```\n" if head else ""


def _table(entry: Mapping[str, Any], text: str) -> str:
    """Return the keys of one part: what each is, what it may be, and what it is if it is not given."""
    said = {}
    for one in NumpyDocString(inspect.cleandoc(text).split("\nExamples\n---")[0].split("\nRaises\n---")[0])[
        "Parameters"
    ]:
        said.update(dict.fromkeys(one.name.split(", "), " ".join(one.desc)))
    rows = [
        f"| `{name}` | {_cell(said.get(name, ''))} | {_cell(_kind(value))} | {_default(name, value, entry)} |"
        for name, value in _properties(entry).items()
    ]
    if not rows:
        return "No keys.\n"
    return "\n".join(["| key | what it is | value | default |", "|---|---|---|---|", *rows, ""])


def _properties(entry: Mapping[str, Any]) -> dict[str, Any]:
    """Return the keys of a part, of all its forms if it has several."""
    found = dict(entry.get("properties", {}))
    for one in entry.get("anyOf", ()):
        found |= {name: value for name, value in one.get("properties", {}).items() if name not in found}
    return found


def _cell(text: str) -> str:
    return _MATH.sub(r"$\1$", text).replace("|", "\\|").replace("\n", " ")


def _kind(value: Mapping[str, Any]) -> str:
    """Return what a value may be, in a few words."""
    words = str(value.get("description") or value.get("type") or "")
    if "enum" in value:
        words = " or ".join(f"`{one}`" for one in value["enum"] if not isinstance(one, bool))
    elif "$ref" in value:
        name = value["$ref"].rsplit("/")[-1]
        words = f"[{name}](#{name.lower()})"
    elif "properties" in value or value.get("type") == "object":
        words = "a mapping, see below"
    elif "anyOf" in value:
        words = ", or ".join(dict.fromkeys(_kind(one) for one in value["anyOf"] if one.get("type") != "null"))
    elif value.get("type") == "array":
        inner = value.get("items") or value.get("prefixItems", [{}])[0]
        words = "a list, see below" if "oneOf" in inner else f"list of {_kind(inner) or 'entries'}"
    elif isinstance(value.get("examples", [None])[0], str):
        words = f"{words}, `{value['examples'][0]}`"
    return words


def _default(name: str, value: Mapping[str, Any], entry: Mapping[str, Any]) -> str:
    if name in entry.get("required", ()):
        return "required"
    if value.get("default") is None:
        return "none"
    unit = value.get("description", "") if not isinstance(value["default"], list | dict) else ""
    text = json.dumps(value["default"])
    if len(text) > _LONGEST:
        return "see below"
    return f"`{text}`" + (f" {unit.removeprefix('quantity in ')}" if unit.startswith("quantity in ") else "")
