"""Errors that users see: what was wrong, where, and what to do about it."""

from __future__ import annotations

import difflib
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable


@dataclass(frozen=True)
class Problem:
    """One finding about an input file: place, key and what was expected."""

    message: str
    key: str = ""
    file: str = ""
    line: int | None = None

    def __str__(self) -> str:
        place = self.file + (f":{self.line}" if self.line is not None else "")
        return ": ".join(part for part in (place, self.key, self.message) if part)


class ScenarioError(ValueError):
    """The input is bad; `problems` lists every finding with file, line, key and expectation."""

    def __init__(self, problems: Iterable[Problem] | str) -> None:
        self.problems = [Problem(problems)] if isinstance(problems, str) else list(problems)
        super().__init__("\n".join(str(problem) for problem in self.problems))


class RunError(RuntimeError):
    """The run failed after it started (diverged, saturated, disk full); says how far it got."""


class UnknownNameError(ValueError):
    """A name that no registry knows; the message lists the known ones and the nearest, or says why it fails to load."""

    def __init__(self, kind: str, name: str, known: Iterable[str], reason: str = "") -> None:
        names = sorted(known)
        near = difflib.get_close_matches(name, names, n=1)
        hint = f"; did you mean {near[0]!r}?" if near else ""
        hint = f": {reason}" if reason else hint
        super().__init__(f"unknown {kind} {name!r}{hint} (known: {', '.join(names) or 'none'})")
