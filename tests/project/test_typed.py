"""Every command that a page shows is one that there is, and so is every option of it; scripts have theirs too."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

from tests.cli.commands import COMMANDS, options

ROOT = Path(__file__).parents[2]
PAGES = sorted([*ROOT.glob("docs/*.md"), *ROOT.glob("docs/*/*.md"), ROOT / "README.md", ROOT / "CONTRIBUTING.md"])
# In the text between backticks, and a line of a block each.
INLINE = re.compile(r"`((?:testbed|python) [^`\n]+)`")
BLOCK = re.compile(r"^```(?:sh|console)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
# Options of the interpreter and of what it is asked to be.
FOREIGN = ("python -m", "python -c")


def typed(text):
    """Yield what a page shows to be typed, without what stands behind a # or a pipe."""
    yield from INLINE.findall(BLOCK.sub("", text))
    for block in BLOCK.findall(text):
        for line in block.replace("\\\n", " ").splitlines():
            if line.removeprefix("$ ").startswith(("testbed ", "python ")):
                yield line.removeprefix("$ ")


def strange(line):
    """Return what of a line is neither a command, nor a script, nor an option of it."""
    # Brackets stand around what may be left out, capitals for what is to be put in.
    words = shlex.split(re.sub(r"[\[\]]|\.\.\.", "", line), comments=True)
    words = words[: words.index("|")] if "|" in words else words
    if line.startswith(FOREIGN) or words[1].isupper():
        return []
    asked = {word.partition("=")[0] for word in words if word.startswith("--")}
    if words[0] == "python":
        script = ROOT / words[1]
        if not script.is_file():
            return [words[1]]
        return sorted(option for option in asked if f'"{option}"' not in script.read_text(encoding="utf-8"))
    name = next((one for k in (3, 2) if (one := " ".join(words[:k])) in COMMANDS), None)
    if name is None:
        # A group of commands, or an option of all.
        return [] if any(one.startswith(" ".join(words[:2]) + " ") for one in COMMANDS) or asked else [line]
    kept = [word for word in words if word.startswith(("scenarios/", "studies/", "examples/"))]
    missing = [word for word in kept if not (ROOT / word).exists()]
    return sorted(asked - set(options(COMMANDS[name])) - {"--help"}) + missing


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.stem)
def test_every_command_and_option_that_a_page_shows_is_there(page):
    found = {line: odd for line in typed(page.read_text(encoding="utf-8")) if (odd := strange(line))}
    assert found == {}


def test_a_strange_word_is_found():
    assert strange("testbed run a.yaml --outt b") == ["--outt"]
    assert strange("testbed rum a.yaml") == ["testbed rum a.yaml"]
    assert strange("testbed run scenarios/no_such.yaml") == ["scenarios/no_such.yaml"]
    assert strange("python examples/no_such.py") == ["examples/no_such.py"]
    assert strange('testbed run "a b.yaml" --out b --json | python -c "print(1)"  # --x') == []
