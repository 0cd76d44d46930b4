"""Fields of a line of text, and what each of them may be."""

from __future__ import annotations

import csv
import re

COMMENTS = ("#", "%", "//")
# Characters of a name or of a line of the preamble: more say nothing to a reader.
LONGEST_NAME = 200
POINT = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?|[+-]?(nan|inf(inity)?)", re.IGNORECASE)
COMMA = re.compile(r"[+-]?(\d+,?\d*|,\d+)([eE][+-]?\d+)?|[+-]?(nan|inf(inity)?)", re.IGNORECASE)
# ISO 8601, and day.month.year, which no one reads in another order.
ISO = re.compile(r"(\d{4}-\d\d-\d\d|\d\d\.\d\d\.\d{4})[T ]\d\d:\d\d(:\d\d([.,]\d{1,9})?)?(Z|[+-]\d\d:?\d\d)?")
CLOCK = re.compile(r"\d\d:\d\d:\d\d([.,]\d{1,9})?")
HEX = re.compile(r"0[xX][0-9A-Fa-f]{1,8}")


def fields_of(text: str, separator: str) -> list[str]:
    """Return the fields of a line without the blanks around them."""
    if separator == " ":
        # A unit in brackets belongs to the name before it.
        closed = ("[" in text and "]" in text) or ("(" in text and ")" in text)
        joined = text.strip().replace(" [", "\0[").replace(" (", "\0(") if closed else text
        return [field.replace("\0", " ").strip('"') for field in joined.split()]
    if '"' not in text:
        return [field.strip() for field in text.split(separator)]
    return [field.strip() for field in next(csv.reader([text], delimiter=separator, skipinitialspace=True), [""])]


def is_value(cell: str, decimal: str) -> bool:
    """Return whether a field is a number with this decimal mark, a hexadecimal word or a time."""
    return bool(
        (POINT if decimal == "." else COMMA).fullmatch(cell) or any(p.fullmatch(cell) for p in (ISO, CLOCK, HEX))
    )
