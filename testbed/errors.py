"""Errors that users see: what was wrong, where, and what to do about it."""

from __future__ import annotations

import difflib
import reprlib
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterable

# Characters of what a user gave that a message repeats.
MOST_QUOTED = 80
_REPR = reprlib.Repr()
_REPR.maxlevel, _REPR.maxstring, _REPR.maxlong, _REPR.maxother = 3, MOST_QUOTED, 40, MOST_QUOTED


def shortened(text: str) -> str:
    """Return a text for a message: at most 80 characters of it, the last three dots if there were more."""
    return text if len(text) <= MOST_QUOTED else f"{text[: MOST_QUOTED - 3]}..."


def shortened_path(path: object) -> str:
    """Return a path for a message: of a long one the end, which tells files apart."""
    text = str(path)
    return text if len(text) <= MOST_QUOTED else f"...{text[3 - MOST_QUOTED :]}"


def quoted(value: Any) -> str:
    """Return a value that a user gave as a message shows it, at most 80 characters.

    Parameters
    ----------
    value : Any
        However large or deep.
    """
    if isinstance(value, int) and value.bit_length() > 1000:
        return f"a whole number of {value.bit_length()} bits"
    try:
        return shortened(_REPR.repr(value))
    except Exception:  # noqa: BLE001 - a user's own class may fail to describe itself
        return f"a {shortened(type(value).__name__)}"


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
    """The input is bad; `problems` lists every finding with file, line, key and expectation.

    Examples
    --------
    >>> error = ScenarioError([Problem("is required", "duration", "mine.yaml", 3)])
    >>> print(error)
    mine.yaml:3: duration: is required
    >>> error.problems[0].key
    'duration'
    """

    def __init__(self, problems: Iterable[Problem] | str) -> None:
        self.problems = [Problem(problems)] if isinstance(problems, str) else list(problems)
        super().__init__("\n".join(str(problem) for problem in self.problems))

    def __reduce__(self) -> tuple[type[ScenarioError], tuple[list[Problem]]]:
        return type(self), (self.problems,)


class VerdictWarning(UserWarning):
    """Readings contradict each other, or what is believed of their sensors; says which, and what to do about it."""


class RunError(RuntimeError):
    """The run failed after it started (diverged, saturated, disk full); says how far it got."""


class UnknownNameError(ValueError):
    """A name that no registry knows; the message lists the known ones and the nearest, or says why it fails to load."""

    def __init__(self, kind: str, name: str, known: Iterable[str], reason: str = "") -> None:
        names = sorted(known)
        self._given = (kind, name, names, reason)
        near = difflib.get_close_matches(shortened(name), names, n=1)
        hint = f"; did you mean {near[0]!r}?" if near else ""
        hint = f": {reason}" if reason else hint
        super().__init__(f"unknown {kind} {quoted(name)}{hint} (known: {', '.join(names) or 'none'})")

    def __reduce__(self) -> tuple[type[UnknownNameError], tuple[str, str, list[str], str]]:
        return type(self), self._given
