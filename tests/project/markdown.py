"""Give the pages one sentence a line, of at most 120 characters: `python -m tests.project.markdown`.

Tables, code, directives with their options, and HTML stay as they are; what a page says does not change.
"""

from __future__ import annotations

import re
import textwrap
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

ROOT = Path(__file__).parents[2]
PAGES = sorted([*ROOT.glob("docs/*.md"), *ROOT.glob("docs/[!_]*/*.md"), *ROOT.glob("*.md")])
WIDTH = 120
# Code, links and formulas are not broken; a blank inside one is held by this.
_HELD = re.compile(r"`[^`]*`|\[[^\]]*\]\([^)]*\)|\$[^$]*\$")
_BLANK = "\u2060"
_ABBREVIATED = (r"e\.g", r"i\.e", "et al", "vs", "cf", "Trans", "Instrum", "Meas", "J", "Sound Vib", "no", "eq")
_SHORT = "".join(rf"(?<!\b{word}\.)" for word in _ABBREVIATED)
_END = re.compile(rf"(?:(?<=[.!?])|(?<=[.!?]\))){_SHORT} +(?=[A-Z`*\[(\"0-9])")
_ITEM = re.compile(r"^(\s*)(?:[-*]|\d+\.|:)\s+")
_VERBATIM = re.compile(r"^\s*(?:\||#|<|>|:{3,}|:[a-z][a-z-]*:|\([\w-]+\)=|\[[^\]]+\]:|---|={3,}|$)")


def sentences(text: str, width: int) -> list[str]:
    """Return the sentences of a paragraph, each in lines of at most `width` characters where a blank allows it."""
    held = _HELD.sub(lambda part: part[0].replace(" ", _BLANK), " ".join(text.split()))
    lines = []
    for sentence in _END.split(held):
        lines += textwrap.wrap(sentence, width, break_long_words=False, break_on_hyphens=False)
    return [line.replace(_BLANK, " ") for line in lines]


def blocks(text: str) -> Iterator[tuple[bool, list[str]]]:
    """Yield pieces of a page: whether each is prose, and its lines."""
    prose: list[str] = []
    fence = ""
    for line in text.splitlines():
        mark = re.match(r"^\s*(`{3,}|~{3,})", line)
        if mark and (not fence or (line.strip().startswith(fence) and line.strip() == mark[1])):
            fence = "" if fence else mark[1]
            plain = False
        else:
            # Four blanks begin code, unless they go on with an item.
            plain = not fence and not _VERBATIM.match(line) and (bool(prose) or not line.startswith("    "))
        if plain and _ITEM.match(line) and prose:
            yield True, prose
            prose = []
        if plain:
            prose.append(line)
            continue
        if prose:
            yield True, prose
            prose = []
        yield False, [line]
    if prose:
        yield True, prose


def reflowed(text: str) -> str:
    """Return a page with one sentence a line."""
    out: list[str] = []
    for prose, lines in blocks(text):
        if not prose:
            out += lines
            continue
        item = _ITEM.match(lines[0])
        head = item[0] if item else re.match(r"^\s*", lines[0])[0]
        rest = " " * len(head)
        body = " ".join([lines[0][len(head) :], *lines[1:]])
        out += [f"{rest if i else head}{line}" for i, line in enumerate(sentences(body, WIDTH - len(head)))]
    return "\n".join(out) + "\n"


if __name__ == "__main__":
    for page in PAGES:
        page.write_text(reflowed(page.read_text(encoding="utf-8")), encoding="utf-8")
