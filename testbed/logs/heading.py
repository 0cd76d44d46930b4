"""The lines above the rows of a text: names, units, and what else they say."""

from __future__ import annotations

import re

from testbed.logs.cells import COMMENTS, LONGEST_NAME, fields_of, is_value
from testbed.logs.names import clean_unit, quantity_of

_UNITLESS = re.compile(r"[\[(].*[\])]|-*")


def find_header(
    above: list[tuple[int, list[str]]], n_named: int, n_columns: int
) -> tuple[tuple[int, list[str]] | None, tuple[int, list[str]] | None]:
    """Return the line of names and the line of units above the rows, each with its number, or None.

    The names are those above the units, else the nearest; where they leave columns without a name of their own, the
    line above them says the rest.
    """
    near: list[tuple[int, list[str]]] = []
    for number, row in reversed(above):
        if len(row) not in {n_named, n_columns}:
            break
        near.append((number, row[:n_named]))
    if not near:
        return None, None
    at = next(
        (k for k, (_, row) in enumerate(near[:2]) if k + 1 < len(near) and any(row) and all(map(_is_unit, row))), None
    )
    place = 0 if at is None else at + 1
    number, names = near[place]
    if place + 1 < len(near) and (len(set(names)) < len(names) or not all(names)):
        above_them = near[place + 1][1]
        names = [" ".join(filter(None, pair)) for pair in zip(above_them, names, strict=False)]
    return (number, names), None if at is None else near[at]


def names_but_one(above: list[tuple[int, list[str]]], n_columns: int, decimal: str) -> tuple[int, list[str]] | None:
    """Return the names above the rows that leave out the first column, the number of the row, as R writes them."""
    if not above or len(above[-1][1]) != n_columns - 1 or n_columns < 3:
        return None
    number, names = above[-1]
    return (number, ["", *names]) if all(name and not is_value(name, decimal) for name in names) else None


def _is_unit(cell: str) -> bool:
    return bool(_UNITLESS.fullmatch(cell) or quantity_of(clean_unit(cell[:LONGEST_NAME])))


def commented_names(
    lines: list[tuple[int, str]], first: int, separator: str, n_named: int
) -> tuple[list[str], int | None]:
    """Return the names of a header that stands behind a comment mark, and its line."""
    comments = [
        (number, text.strip()) for number, text in lines if number < first and text.lstrip().startswith(COMMENTS)
    ]
    for number, text in comments[-1:]:
        names = fields_of(text.lstrip("#%/").strip(), separator)
        words = n_named == 1 and " " in names[0]
        if len(names) == n_named and not words and not all(is_value(name, ".") for name in names):
            return names, number
    return [], None


def preamble_of(lines: list[str]) -> dict[str, str]:
    """Return what ``key,value``, ``key: value`` and ``key = value`` lines say."""
    found = {}
    for line in lines:
        match = re.match(r"\s*(?:#|%|//)?\s*([^,;:=\t]+?)\s*[,;:=\t]\s*(.+?)[\s,;]*$", line[:LONGEST_NAME])
        if match:
            found[match[1].strip()] = match[2].strip()
    return found
