"""How a text file writes its numbers: encoding, separator, decimal mark, comments, preamble, header and line of units.

Found in the first megabyte. What can be read in two ways is an error that names the option which decides.
"""

from __future__ import annotations

import codecs
import re
from collections import Counter
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from testbed.errors import quoted, shortened
from testbed.logs.cells import CLOCK, COMMA, COMMENTS, HEX, ISO, LONGEST_NAME, POINT, fields_of, is_value
from testbed.logs.heading import commented_names, find_header, names_but_one, preamble_of
from testbed.logs.names import clean_unit
from testbed.logs.options import refusal
from testbed.logs.ornaments import Ornaments, find_ornaments

if TYPE_CHECKING:
    from pathlib import Path

    from testbed.logs.selection import TextOptions

HEAD = 1 << 20
MOST_COLUMNS = 10_000
_SAMPLE, _MANY = 200, 10
_SEPARATORS = {",": "commas", ";": "semicolons", "\t": "tabs", "|": "bars", " ": "blanks"}
_WORDS = {"tab": "\t", "\\t": "\t", "blank": " ", "space": " "}
_MISSING = {"", "na", "n/a", "null", "none", "-"}


@dataclass(frozen=True)
class Dialect:
    """How a text file is to be read.

    Parameters
    ----------
    encoding, separator, decimal : str
        Codec, mark between fields, decimal mark.
    skip : int
        Lines before the first row.
    n_columns : int
        Fields of a row.
    names, units : tuple of str
        Of the columns; empty where there is no header, no line of units.
    kinds : tuple of str
        Of each column: ``integer``, ``number``, ``hex``, ``iso``, ``clock``, ``text``.
    preamble : dict
        Values of ``key,value`` lines and comments before the header.
    header_line, unit_line : int, optional
        Where they stand.
    ornaments : Ornaments
        What is taken off each row.
    only : str, optional
        Word that a row holds.
    hex_bits : dict
        Bits of the words of each column of hexadecimal numbers: 8, 16 or 32 by the most digits in the head.
    """

    encoding: str
    separator: str
    decimal: str
    skip: int
    n_columns: int
    names: tuple[str, ...]
    units: tuple[str, ...]
    kinds: tuple[str, ...]
    preamble: dict[str, str]
    header_line: int | None
    unit_line: int | None
    ornaments: Ornaments
    only: str | None
    hex_bits: dict[int, int]

    def fields(self, text: str) -> list[str]:
        """Return the fields of a row."""
        return fields_of(self.ornaments.off(text.rstrip("\r\n")), self.separator)

    @property
    def raw_encoding(self) -> str:
        """Codec of the bytes of a row: UTF-8 where the file's is a form of Unicode."""
        return "utf-8" if self.encoding.startswith("utf") else self.encoding

    def is_row(self, text: str) -> bool:
        """Return whether a line below the head is a row: no blank, no comment, and with the word that all have."""
        return (
            bool(text.strip())
            and not text.lstrip().startswith(COMMENTS)
            and (self.only is None or bool(re.search(word_pattern(self.only), text)))
        )

    def __str__(self) -> str:
        """Say what was found, in words."""
        parts = [self.encoding, _SEPARATORS[self.separator] if self.n_columns > 1 else "one column"]
        parts.append("decimal comma" if self.decimal == "," else "decimal point")
        parts.append(f"header in line {self.header_line}" if self.header_line else "no header")
        if self.unit_line:
            parts.append(f"units in line {self.unit_line}")
        parts += [f"hexadecimal words of {bits} bits with their sign" for bits in sorted(set(self.hex_bits.values()))]
        if self.ornaments.swaps:
            parts.append(f"without {self.ornaments}")
        return ", ".join([*parts, f"rows from line {self.skip + 1}"])


def find_dialect(path: Path, head: bytes, *, complete: bool, options: TextOptions) -> Dialect:
    """Return the dialect of a text file.

    Parameters
    ----------
    path : Path
        For messages.
    head : bytes
        Its beginning.
    complete : bool
        Whether that is all of it: if not, the last line is cut and left out.
    options : TextOptions
        What the user knows.

    Returns
    -------
    Dialect
        What is needed to read it.

    Raises
    ------
    ScenarioError
        If it holds no column of numbers, or can be read in two ways.
    """
    if options.drop_faulty and not head.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        head = head.rstrip(b"\0")
    encoding = options.encoding or find_encoding(path, head)
    lines = _lines(path, head, encoding, complete=complete)
    rest = [(number, text) for number, text in lines if number > (options.skip or 0)]
    content = [(number, text) for number, text in rest if not text.lstrip().startswith(COMMENTS)]
    if options.only is not None:
        content = [(number, text) for number, text in content if re.search(word_pattern(options.only), text)]
    if not content:
        only = "" if options.only is None else f" with the word {quoted(options.only)}"
        where = only if complete else f"{only} in the first {HEAD >> 20} MB but comments"
        raise refusal(path, f"expected a column of numbers, got no line{where}")
    ornaments = find_ornaments([text for _, text in _tail(content)])
    if ornaments.swaps:
        content = [(number, ornaments.off(text)) for number, text in content]
    tail = _tail(content)
    separator, decimal = _marks(path, [text for _, text in tail], options)
    _refuse_two_readings(path, [text for _, text in [*content[:_SAMPLE], *tail]], separator, decimal, options)
    rows = [(number, fields_of(text, separator)) for number, text in content]
    found = _parts(path, encoding, separator, decimal, rows, rest)
    names, units = _said_in_rows(found, ornaments)
    return replace(found, names=names, units=units, ornaments=ornaments, only=options.only)


def word_pattern(word: str) -> str:
    """Return the pattern of a word that stands alone in a line."""
    return rf'(?:^|(?<=[\s,;|"])){re.escape(word)}(?=[\s,;|":=]|$)'


def _tail(content: list[tuple[int, str]]) -> list[tuple[int, str]]:
    """Return lines that are rows, the last of the head; in a short file its last third."""
    return content[-min(_SAMPLE, -(-len(content) // 3)) :]


def _said_in_rows(found: Dialect, ornaments: Ornaments) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the names and units of the head, or those that the rows themselves give."""
    n_named = len(found.kinds)
    names = ornaments.labels if not found.names and len(ornaments.labels) == n_named else found.names
    units = ornaments.units if not found.units and len(ornaments.units) == n_named else found.units
    return names, units


def find_encoding(path: Path, head: bytes) -> str:
    """Return the codec of a text file: by its mark, UTF-8 where it is that, cp1252 otherwise.

    Raises
    ------
    ScenarioError
        If it holds NUL bytes as no text does.
    """
    for mark, name in (
        (codecs.BOM_UTF8, "utf-8-sig"),
        (codecs.BOM_UTF32_LE, "utf-32"),
        (codecs.BOM_UTF32_BE, "utf-32"),
        (codecs.BOM_UTF16_LE, "utf-16"),
        (codecs.BOM_UTF16_BE, "utf-16"),
    ):
        if head.startswith(mark):
            return name
    if b"\0" in head:
        even, odd = head[0:4000:2].count(0), head[1:4000:2].count(0)
        if min(even, odd) == 0 and max(even, odd) > len(head[:4000]) // 6:
            return "utf-16-le" if odd else "utf-16-be"
        line = head.count(b"\n", 0, head.index(b"\0")) + 1
        message = "cannot be read: a NUL byte, so it is no text, or it was cut while written"
        raise refusal(path, f"{message}; remove it, or --drop-faulty", line=line)
    try:
        codecs.getincrementaldecoder("utf-8")().decode(head)
    except UnicodeDecodeError:
        return "cp1252"
    return "utf-8"


def _lines(path: Path, head: bytes, encoding: str, *, complete: bool) -> list[tuple[int, str]]:
    try:
        "".encode(encoding)  # refuses what is no encoding of a text, such as zip, which could be a bomb
        text = codecs.getincrementaldecoder(encoding)().decode(head, final=False)
    except (ValueError, LookupError) as error:
        raise refusal(
            path, f"cannot be read: {shortened(str(error))}; which encoding is it?", key="--encoding"
        ) from error
    lines = text.removeprefix("\ufeff").splitlines()
    if not complete:
        lines = lines[:-1]
    if not lines and text:
        raise refusal(
            path, f"expected lines, got none in the first {HEAD >> 20} MB: is it a text, with one sample a row?"
        )
    return [(number, line) for number, line in enumerate(lines, 1) if line.strip()]


def _marks(path: Path, lines: list[str], options: TextOptions) -> tuple[str, str]:
    """Return the separator and the decimal mark that read most fields as numbers."""
    given = _WORDS.get(options.separator or "", options.separator)
    if given is not None and given not in _SEPARATORS:
        raise refusal(path, f"expected one of , ; | tab blank, got {quoted(options.separator)}", key="--separator")
    if options.decimal not in {None, ".", ","}:
        raise refusal(path, f"expected . or , got {quoted(options.decimal)}", key="--decimal")
    choices = []
    for rank, separator in enumerate(_SEPARATORS if given is None else [given]):
        for decimal in ".," if options.decimal is None else options.decimal:
            if (separator, decimal) != (",", ","):
                share, n_columns = _share(lines, separator, decimal)
                choices.append((share, n_columns > 1, decimal == ".", -rank, separator, decimal))
    share, _, _, _, separator, decimal = max(choices)
    if not share:
        raise refusal(path, f"expected a column of numbers, got {lines[-1][:60]!r}", line=None)
    if options.decimal is None:
        _refuse_mixture(path, lines, share)
    return separator, decimal


def _refuse_mixture(path: Path, lines: list[str], share: float) -> None:
    """Refuse numbers with a decimal comma beside numbers with a point, if most fields are one or the other."""
    for separator in list(_SEPARATORS)[1:]:
        cells = [cell for line in lines for cell in fields_of(line, separator)]
        comma, point = (
            sum(mark in cell and bool(pattern.fullmatch(cell)) for cell in cells)
            for mark, pattern in ((",", COMMA), (".", POINT))
        )
        if comma and point and comma + point > (share + 0.2) * len(cells):
            message = f"numbers with a decimal comma ({comma}) and with a point ({point})"
            raise refusal(path, f"{message}: write all in one way", key="--decimal")


def _share(lines: list[str], separator: str, decimal: str) -> tuple[float, int]:
    """Return the share of fields that are numbers or times, and the usual number of fields."""
    rows = [fields_of(line, separator) for line in lines]
    n_columns = Counter(map(len, rows)).most_common(1)[0][0]
    # An empty field is a missing value, and says nothing.
    cells = [cell for row in rows if len(row) == n_columns for cell in row if cell]
    good = sum(is_value(cell, decimal) for cell in cells)
    # Rows of another length cannot be read, so they count as fields that are none.
    return good / max(len(cells) + n_columns * sum(len(row) != n_columns for row in rows), 1), n_columns


def _refuse_two_readings(path: Path, lines: list[str], separator: str, decimal: str, options: TextOptions) -> None:
    """Refuse numbers such as 1,5 that may be two columns."""
    rows = [fields_of(line, separator) for line in lines]
    cells = [cell for row in rows for cell in row]
    if (
        separator == ","
        and options.separator is None
        and options.decimal is None
        and not any("." in cell for cell in cells)
    ):
        pairs = [row for row in rows if len(row) == len(rows[-1]) and len(row) % 2 == 0]
        fractions = {cell for row in pairs for cell in row[1::2] if re.fullmatch(r"0\d+", cell)}
        header = next((row for row in rows if not any(is_value(cell, ".") for cell in row)), None)
        named = header is not None and len(header) == len(rows[-1])
        if (fractions and not named) or (header is not None and pairs and 2 * len(header) == len(pairs[-1])):
            what = "may be columns with commas between, or numbers with a decimal comma"
            raise refusal(path, f"{lines[-1][:40]!r} {what}: give --decimal , or --separator ,", key="--decimal")


def _parts(
    path: Path,
    encoding: str,
    separator: str,
    decimal: str,
    rows: list[tuple[int, list[str]]],
    lines: list[tuple[int, str]],
) -> Dialect:
    """Return the dialect: where the rows begin, and what the lines above them are."""
    tail = [row for _, row in rows[-min(_SAMPLE, -(-len(rows) // 3)) :]]
    n_columns = Counter(map(len, tail)).most_common(1)[0][0]
    if n_columns > MOST_COLUMNS:
        raise refusal(path, f"expected at most {MOST_COLUMNS} columns, got {n_columns}: write one sample a row")
    kinds = _kinds([row for row in tail if len(row) == n_columns], decimal)
    readable = [i for i, kind in enumerate(kinds) if kind != "text"]
    start = next(
        (k for k, (_, row) in enumerate(rows) if len(row) == n_columns and _is_row(row, readable, decimal)), None
    )
    if start is None or not readable:
        raise refusal(path, f"expected a column of numbers, got {separator.join(tail[-1])[:60]!r}")
    kinds = _kinds([row for _, row in rows[start : start + _SAMPLE] if len(row) == n_columns] + tail, decimal)
    first = rows[start][0]
    above = [(number, row) for number, row in rows[:start]]
    n_named = n_columns - all(len(row) != n_columns or row[-1] == "" for _, row in rows[start : start + _SAMPLE])
    header, unit_line = find_header(above, n_named, n_columns)
    header = header or names_but_one(above, n_named, decimal)
    names, header_line = (header[1], header[0]) if header else commented_names(lines, first, separator, n_named)
    return Dialect(
        encoding=encoding,
        separator=separator,
        decimal=decimal,
        skip=first - 1,
        n_columns=n_columns,
        names=tuple(name[:LONGEST_NAME] for name in names[:n_named]),
        units=tuple(clean_unit(unit[:LONGEST_NAME]) for unit in unit_line[1][:n_named]) if unit_line else (),
        kinds=tuple(kinds[:n_named]),
        preamble=preamble_of([text for number, text in lines if number < (header_line or first)]),
        header_line=header_line,
        unit_line=unit_line[0] if unit_line else None,
        ornaments=Ornaments(),
        only=None,
        hex_bits={i: _bits(tail, i) for i, kind in enumerate(kinds[:n_named]) if kind == "hex"},
    )


def _bits(rows: list[list[str]], column: int) -> int:
    """Return the size of a word of as many hexadecimal digits as the longest has."""
    digits = max(len(row[column]) - 2 for row in rows if len(row) > column)
    return 8 if digits <= 2 else 16 if digits <= 4 else 32


def _kinds(rows: list[list[str]], decimal: str) -> list[str]:
    return [_kind([row[i] for row in rows if i < len(row)], decimal) for i in range(max(map(len, rows), default=0))]


def _kind(cells: list[str], decimal: str) -> str:
    known = [cell for cell in cells if cell.lower() not in _MISSING]
    if not known:
        return "number" if cells else "text"
    number = POINT if decimal == "." else COMMA
    tests = (
        ("integer", lambda cell: re.fullmatch(r"[+-]?\d{1,19}", cell)),
        ("number", number.fullmatch),
        ("hex", HEX.fullmatch),
        ("iso", ISO.fullmatch),
        ("clock", CLOCK.fullmatch),
    )
    for kind, matches in tests:
        # A single odd field among many is for the reader to find and to name with its line.
        if sum(bool(matches(cell)) for cell in known) >= (0.9 if len(known) >= _MANY else 0.5) * len(known):
            integer = kind == "integer" and not all(matches(cell) for cell in known)
            return "number" if integer else kind
    return "text"


def _is_row(row: list[str], readable: list[int], decimal: str) -> bool:
    values = [row[i] for i in readable]
    return any(is_value(v, decimal) for v in values) and all(
        is_value(v, decimal) or v.lower() in _MISSING for v in values
    )
