"""What loggers write around and into their numbers, found in the last rows of a text's head and taken off.

Brackets around a row, labels before a number, units behind it, the arrow behind a terminal's time, exponents of
Fortran, a typographer's minus, marks between thousands. Each is looked for in rows, and taken off where they have it.
"""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from testbed.logs.names import quantity_of

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

_MOST = 0.8
# Characters of a row that are looked at.
_LONGEST = 2000
_EDGE = r"(?:^|(?<=[\s,;|]))"
# Each repetition is bounded, so that a line made to be slow takes no longer than another of its length.
_LABEL = re.compile(_EDGE + r'"?([A-Za-z_][\w .()\[\]/°-]{0,40}?)"?[ ]{0,4}[:=][ ]{0,4}(?=[-+.]?\d)')
_UNIT = re.compile(r"(?<=[\d.])[ ]{0,4}([A-Za-z°µμº][\w°º/^*·-]{0,20})(?=[ ]{0,4}(?:[,;|\t]|$))")
_BEHIND_ARROW = re.compile(r"-> *[^,;|\t]*([,;|\t])")


class Swap(NamedTuple):
    """A pattern, what stands in its place, and what it is called."""

    pattern: str
    instead: str
    what: str


@dataclass(frozen=True)
class Ornaments:
    """What is taken off each row of a text.

    Parameters
    ----------
    swaps : tuple of Swap
        In their order.
    labels : tuple of str
        Names that stood before the numbers of each row.
    units : tuple of str
        Units that stood behind them, in the order of the row.
    """

    swaps: tuple[Swap, ...] = ()
    labels: tuple[str, ...] = ()
    units: tuple[str, ...] = ()

    def off(self, text: str) -> str:
        """Return lines without them."""
        for pattern, instead, _ in self.swaps:
            text = re.sub(pattern, instead, text, flags=re.MULTILINE)
        return text

    def off_bytes(self, data: bytes, encoding: str) -> bytes:
        """Return encoded lines without them, line for line."""
        for pattern, instead, _ in self.swaps:
            data = re.sub(pattern.encode(encoding), instead.encode(encoding), data, flags=re.MULTILINE)
        return data

    def __str__(self) -> str:
        """Say what is taken off."""
        return ", ".join(dict.fromkeys(swap.what for swap in self.swaps))


def find_ornaments(rows: Sequence[str]) -> Ornaments:
    """Return what the numbers of a text are adorned with.

    Parameters
    ----------
    rows : sequence of str
        Lines far enough from the head to be rows.

    Returns
    -------
    Ornaments
        Empty for a plain table.
    """
    swaps: list[Swap] = []
    rest = [row[:_LONGEST] for row in rows]
    labels: tuple[str, ...] = ()
    units: tuple[str, ...] = ()
    for look in _LOOKS:
        for swap in look(rest):
            if swap.what == "labels":
                labels = _usual([tuple(_LABEL.findall(row)) for row in rest])
            if swap.what == "units":
                units = _usual([_units_of(row) for row in rest])
            swaps.append(swap)
            rest = [re.sub(swap.pattern, swap.instead, row) for row in rest]
    return Ornaments(tuple(swaps), labels, units)


def _most(rows: Sequence[str], pattern: str) -> bool:
    return sum(re.search(pattern, row) is not None for row in rows) > _MOST * len(rows)


def _some(rows: Sequence[str], pattern: str) -> bool:
    return any(re.search(pattern, row) for row in rows)


def _usual(found: Sequence[tuple[str, ...]]) -> tuple[str, ...]:
    """Return what most rows have, or nothing."""
    usual, count = Counter(found).most_common(1)[0]
    return usual if count > _MOST * len(found) else ()


def _arrow(rows: Sequence[str]) -> list[Swap]:
    if not _most(rows, r"^[\d:.]{8,} -> "):
        return []
    behind = _BEHIND_ARROW.search(rows[-1])
    return [Swap(r"^([\d:.]{8,}) -> ", rf"\1{behind[1] if behind else chr(9)}", "arrows")]


def _brackets(rows: Sequence[str]) -> list[Swap]:
    pattern = r"^[ \t]*[\[({](.*)[\])}][,;]?[ \t]*(\r?)$"
    return [Swap(pattern, r"\1\2", "brackets")] if _most(rows, pattern) else []


def _labels(rows: Sequence[str]) -> list[Swap]:
    labels = _usual([tuple(_LABEL.findall(row)) for row in rows])
    if not labels:
        return []
    words = "|".join(sorted(map(re.escape, set(labels)), key=len, reverse=True))
    return [Swap(rf'{_EDGE}"?(?:{words})"?[ ]{{0,4}}[:=][ ]{{0,4}}', "", "labels")]


def _units(rows: Sequence[str]) -> list[Swap]:
    found = {unit for unit in _usual([_units_of(row) for row in rows]) if unit}
    words = "|".join(sorted(map(re.escape, found), key=len, reverse=True))
    return [Swap(rf"(?<=[\d.])[ ]{{0,4}}(?:{words})(?=[ ]{{0,4}}(?:[,;|\t\r]|$))", "", "units")] if found else []


def _units_of(row: str) -> tuple[str, ...]:
    """Return the unit behind the number of each field, empty where there is none."""
    fields = re.split(r"[,;|\t]", row)
    found = [_UNIT.search(field) for field in fields]
    return tuple(match[1] if match and quantity_of(match[1]) else "" for match in found)


def _signs(rows: Sequence[str]) -> list[Swap]:
    return [
        swap
        for swap in (
            Swap(r"(?<=[\d.])[dD](?=[+-]\d)", "E", "exponents with D"),
            Swap("\u2212(?=[\\d.])", "-", "typographer's minus"),
            Swap(r'(?:^|(?<=[\s,;|"]))\+(?=\d+(?:[\s,;|"]|$))', "", "plus of whole numbers"),
        )
        if _some(rows, swap.pattern)
    ]


def _thousands(rows: Sequence[str]) -> list[Swap]:
    """Return marks between thousands, where another separator or quotes leave no doubt."""
    what = "marks between thousands"
    apart = bool(rows) and all(re.search(r"[;|\t]", row) for row in rows)
    point, comma = r"(?<=\d)\.(?=\d{3}(?:\.\d{3}){0,5},\d)", r"(?<=\d),(?=\d{3}(?:,\d{3}){0,5}\.\d)"
    quoted = r'(?<=\d),(?=\d{3}(?:,\d{3}){0,5}(?:\.\d{0,20})?")'
    found = [Swap(rf"(?<=\d){mark}(?=\d{{3}})", "", what) for mark in ("'", "\u2019")] + [Swap(quoted, "", what)]
    if apart:
        found += [Swap(point, "", what), Swap(comma, "", what)]
    return [swap for swap in found if _some(rows, swap.pattern)]


_LOOKS: tuple[Callable[[Sequence[str]], list[Swap]], ...] = (_arrow, _signs, _brackets, _labels, _units, _thousands)
