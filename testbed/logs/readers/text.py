"""A text file of columns, read in blocks by pyarrow.

Of polars, pandas and pyarrow the last is the one that the recording needs anyway, keeps 64-bit stamps exact, knows the
decimal comma, reads 1.6e7 numbers a second on one core, refuses a bad field rather than making it a text column, and
takes one block of bytes at a time, so that memory does not grow with the file. What it does not know (comments between
rows, runs of blanks, UTF-16) is mended in the bytes before.
"""

from __future__ import annotations

import codecs
import re
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np

from testbed.errors import quoted
from testbed.logs.cells import CLOCK, COMMENTS, ISO
from testbed.logs.dialect import HEAD, Dialect, find_dialect, word_pattern
from testbed.logs.options import refusal
from testbed.logs.selection import TextOptions
from testbed.logs.table import TableColumn

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from testbed.logs.table import Block

_BLOCK = 4 << 20
# Of times: day before month, and a comma before the fraction of a second; not where commas are between fields.
_DAY_FIRST = re.compile(rb"\b(\d\d)\.(\d\d)\.(\d{4})([T ]\d\d:)")
_TIME_COMMA = re.compile(rb"(:\d\d),(\d)")
# Digits after the point that stamps are exact to.
_DIGITS = 9
_MARKS = tuple(mark.encode() for mark in COMMENTS)
# The last ones are what spreadsheets and Microsoft's C library write.
_NULLS = ["", "NaN", "nan", "NAN", "-nan", "NA", "N/A", "n/a", "NULL", "null", "None", "none", "-"]
_NULLS += ["#N/A", "#DIV/0!", "#VALUE!", "#REF!", "#NUM!", "1.#QNAN", "-1.#IND", "1.#IND", "-nan(ind)", "nan(ind)"]


class TextTable:
    """A text file of columns.

    Parameters
    ----------
    path : Path
        The file.
    options : TextOptions
        What the user knows of it.

    Raises
    ------
    ScenarioError
        If it cannot be read, is empty, holds no numbers, or can be read in two ways; `blocks` if a row is not like the
        others, with its line.
    """

    def __init__(self, path: Path, options: TextOptions | None = None) -> None:
        self.path = path
        try:
            with path.open("rb") as stream:
                head = stream.read(HEAD)
        except OSError as error:
            raise refusal(path, f"cannot be read: {error.strerror or error}") from error
        if not head.strip():
            raise refusal(path, "expected a column of numbers, got nothing")
        complete = path.stat().st_size <= len(head)
        said = options or TextOptions()
        self.dialect: Dialect = find_dialect(path, head, complete=complete, options=said)
        self._nulls = [*_NULLS, said.missing] if said.missing else _NULLS
        self._missing = float(said.missing) if said.missing and _is_number(said.missing) else None
        self._drop, self._dropped = said.drop_faulty, Dropped()
        self.said = said
        self.unreadable = frozenset(i for i, kind in enumerate(self.dialect.kinds) if kind == "text")
        self.dated = frozenset(i for i, kind in enumerate(self.dialect.kinds) if kind in {"iso", "clock"})
        self.format = f"text: {self.dialect}"
        self.header = self.dialect.preamble
        self.columns = self._columns(path.stat().st_size * max(map(head.count, (b"\n", b"\r"))) // len(head))
        self.notes: list[str] = []

    def blocks(self, wanted: Sequence[int], stamps: Collection[int] = ()) -> Iterator[Block]:
        """Yield the wanted columns block by block; ScenarioError with the line of a row that is not like the others."""
        self.notes, self._dropped = [], Dropped()
        types = self._types(wanted, stamps)
        line = 1
        for block_of_bytes, last in self._raw():
            raw = block_of_bytes.replace(b"\0", b"") if self._drop else block_of_bytes
            if b"\0" in raw:
                where = line + raw.count(b"\n", 0, raw.index(b"\0"))
                what = "cannot be read: a NUL byte, as a file has that was cut while written"
                self._refuse(f"{what}; remove it, or --drop-faulty", where)
            content = self._clean(raw, line)
            if content.strip():
                block = self._timed(self._parse(content, types, line, raw, last=last), stamps)
                if next(iter(block.values())).size:
                    yield block
            line += raw.count(b"\n")
        self.notes += self._dropped.said()

    def _timed(self, block: Block, stamps: Collection[int]) -> Block:
        """Return the rows that have a time, where faulty ones are to be left out; else all."""
        if not (self._drop and stamps):
            return block
        known = np.logical_and.reduce([_known(block[i]) for i in stamps])
        self._dropped.count(int(np.count_nonzero(~known)), "no time")
        return block if known.all() else {i: values[known] for i, values in block.items()}

    def line(self, row: int) -> int | None:
        """Return the line of a row, counted from 0."""
        for line, _ in self._rows():
            if row == 0:
                return line
            row -= 1
        return None

    def _columns(self, n_about: int) -> list[TableColumn]:
        dialect = self.dialect
        names = dialect.names or tuple(f"column {i + 1}" for i in range(len(dialect.kinds)))
        units = dialect.units or ("",) * len(names)
        return [TableColumn(name, unit, about=n_about) for name, unit in zip(names, units, strict=True)]

    def _raw(self) -> Iterator[tuple[bytes, bool]]:
        """Yield blocks of whole lines in UTF-8, and whether it is the last."""
        utf16 = self.dialect.encoding.startswith(("utf-16", "utf-32"))
        decoder = codecs.getincrementaldecoder(self.dialect.encoding)() if utf16 else None
        rest, pending = b"", None
        with self.path.open("rb") as stream:
            while data := stream.read(_BLOCK):
                data = decoder.decode(data).encode() if decoder else data
                if b"\r" in data and b"\n" not in data:
                    data = data.replace(b"\r", b"\n")
                whole, mark, tail = (rest + data).rpartition(b"\n")
                if not mark and len(tail) > 4 * _BLOCK:
                    self._refuse(f"a line of more than {len(tail)} bytes: is it a text?")
                rest = tail
                if mark:
                    if pending is not None:
                        yield pending, False
                    pending = whole + mark
        if rest.strip():
            if pending is not None:
                yield pending, False
            pending = rest
        yield pending or b"", True

    def _clean(self, raw: bytes, line: int) -> bytes:
        """Return the rows alone: no head, no comments, one separator between fields."""
        if line <= self.dialect.skip:
            for _ in range(self.dialect.skip - line + 1):
                raw = raw.partition(b"\n")[2]
        # The search for a letter is quick; lines are looked at one by one only where there is one.
        if any(mark in raw for mark in _MARKS):
            raw = b"\n".join(row for row in raw.split(b"\n") if not row.lstrip().startswith(_MARKS))
        if self.dialect.only is not None:
            word = re.compile(word_pattern(self.dialect.only).encode(self.dialect.raw_encoding))
            raw = b"\n".join(row for row in raw.split(b"\n") if word.search(row))
        raw = self.dialect.ornaments.off_bytes(raw, self.dialect.raw_encoding)
        if "iso" in self.dialect.kinds or "clock" in self.dialect.kinds:
            raw = _DAY_FIRST.sub(rb"\3-\2-\1\4", raw)
            raw = raw if self.dialect.separator == "," else _TIME_COMMA.sub(rb"\1.\2", raw)
        if self.dialect.separator == " ":
            raw = re.sub(rb"[ \t]+", b" ", raw.replace(b"\r\n", b"\n")).removeprefix(b" ")
            return raw.replace(b"\n ", b"\n").replace(b" \n", b"\n").removesuffix(b" ")
        return raw

    def _parse(self, content: bytes, types: dict[int, Any], line: int, raw: bytes, *, last: bool) -> Block:
        import pyarrow as pa

        try:
            return self._convert(content, types)
        except pa.ArrowInvalid as error:
            rest = self._dropped.take(content, lambda text: self._fault_in(text, types)) if self._drop else content
            if rest != content:
                return self._parse(rest, types, line, raw, last=last) if rest else {i: np.empty(0) for i in types}
            if any(pa.types.is_decimal(kind) for kind in types.values()):
                # More digits than that, or an odd field: as floats, which name it.
                plain = {i: pa.float64() if pa.types.is_decimal(kind) else kind for i, kind in types.items()}
                return self._parse(content, plain, line, raw, last=last)
            rows, _, end = content.rstrip().rpartition(b"\n")
            if not last or raw.endswith(b"\n") or line + raw.count(b"\n") <= self.dialect.skip + 1:
                self._refuse_fault(raw, line, types, str(error))
            self.notes = [f"the last line is cut short and was left out: {end[:60].decode(errors='replace')!r}"]
            return self._parse(rows, types, line, raw + b"\n", last=True) if rows else {i: np.empty(0) for i in types}

    def _types(self, wanted: Sequence[int], stamps: Collection[int]) -> dict[int, Any]:
        """Return what each column is to become."""
        import pyarrow as pa

        exact = {
            "integer": pa.int64(),
            "hex": pa.int64(),
            "clock": pa.time64("ns"),
            "number": pa.decimal128(38, _DIGITS),
        }
        types = {}
        for i in wanted:
            kind = self.dialect.kinds[i]
            types[i] = exact.get(kind, pa.float64()) if i in stamps or kind == "hex" else pa.float64()
            if kind == "iso" and i in stamps:
                types[i] = pa.timestamp("ns", "UTC" if self._has_zone(i) else None)
        return types

    def _convert(self, content: bytes, types: dict[int, Any]) -> Block:
        import pyarrow as pa
        from pyarrow import csv

        dialect = self.dialect
        names = [str(i) for i in range(dialect.n_columns)]
        table = csv.read_csv(
            pa.BufferReader(content),
            read_options=csv.ReadOptions(column_names=names, use_threads=False, block_size=max(len(content), 1)),
            parse_options=csv.ParseOptions(delimiter=dialect.separator, ignore_empty_lines=True),
            convert_options=csv.ConvertOptions(
                column_types={str(i): kind for i, kind in types.items()},
                include_columns=[str(i) for i in types],
                decimal_point=dialect.decimal,
                null_values=self._nulls,
                strings_can_be_null=True,
                check_utf8=False,
            ),
        )
        return {i: self._in_words(i, _plain(table.column(str(i)))) for i in types}

    def _in_words(self, index: int, values: NDArray[Any]) -> NDArray[Any]:
        """Return hexadecimal words as whole numbers with their sign, numbers that mean none as NaN."""
        if self._missing is not None and values.dtype.kind == "f":
            # However many digits it is written with.
            values = np.where(values == self._missing, np.nan, values)
        bits = self.dialect.hex_bits.get(index)
        if bits is None:
            return values
        signed: NDArray[Any] = values - (values >= 1 << (bits - 1)) * (1 << bits)
        return signed

    def _has_zone(self, index: int) -> bool:
        cell = next((row[index] for _, row in self._rows() if len(row) > index and ISO.fullmatch(row[index])), "")
        return bool(re.search(r"(Z|[+-]\d\d:?\d\d)$", cell[10:]))

    def _rows(self) -> Iterator[tuple[int, list[str]]]:
        """Yield line and fields of each row."""
        with self.path.open(encoding=self.dialect.encoding, errors="replace") as stream:
            for line, text in enumerate(stream, 1):
                if line > self.dialect.skip and self.dialect.is_row(text):
                    yield line, self.dialect.fields(text)

    def _refuse_fault(self, raw: bytes, line: int, types: dict[int, Any], reason: str) -> NoReturn:
        """Find the first row that is not like the others, and refuse it with its line."""
        dialect = self.dialect
        for number, text in enumerate(raw.decode(errors="replace").split("\n"), line):
            if number > dialect.skip and dialect.is_row(text):
                fault = self._fault_in(text, types)
                if fault:
                    self._refuse(fault, number)
        self._refuse(f"cannot be read: {reason[:200]}", line)

    def _fault_in(self, text: str, types: Mapping[int, Any]) -> str:
        """Return what is wrong with a row; empty if nothing."""
        dialect = self.dialect
        fields = dialect.fields(text)
        if text.count('"') % 2:
            return f"expected quotes in pairs, got {text.strip()[:60]!r}; mend or remove the line, or --drop-faulty"
        if len(fields) != dialect.n_columns:
            got = f"expected {dialect.n_columns} fields ({dialect}), got {len(fields)}: {text.strip()[:60]!r}"
            return f"{got}; mend or remove the line, or --drop-faulty, or --only WORD that all rows hold"
        faults = (self._fault_of(fields[index], index, str(kind)) for index, kind in types.items())
        return next(filter(None, faults), "")

    def _fault_of(self, field: str, index: int, kind: str) -> str:
        """Return why a field is not of its kind, a type of pyarrow by name; empty if it is."""
        label, number = (
            repr(self.columns[index].name),
            field.replace(",", ".") if self.dialect.decimal == "," else field,
        )
        if field in self._nulls:
            return ""
        if kind.startswith("time"):
            good = (ISO if kind.startswith("timestamp") else CLOCK).fullmatch(field)
            what = f"expected a time such as the first ones in {label}, got {quoted(field)}"
            return "" if good else f"{what}; mend the line, or --drop-faulty"
        if self.dialect.kinds[index] == "hex":
            good = re.fullmatch(r"0[xX][0-9A-Fa-f]{1,8}", field)
            return "" if good else f"expected a hexadecimal word in {label}, got {quoted(field)}; mend the line"
        if not _is_number(number):
            remedy = (
                "write a decimal point or give --decimal ," if _is_number(field.replace(",", ".")) else _remedy(field)
            )
            return f"expected a finite number in {label}, got {quoted(field)}; {remedy}"
        whole = kind != "int64" or re.fullmatch(r"[+-]?\d+", field)
        what = f"expected a whole number in {label}, as in the first rows, got {quoted(field)}"
        return "" if whole else f"{what}; mend the line, or --drop-faulty"

    def _refuse(self, message: str, line: int | None = None) -> NoReturn:
        raise refusal(self.path, message, line=line)


def _is_number(field: str) -> bool:
    # Python takes 1_000 for a number, and no logger writes it.
    try:
        float(field)
    except ValueError:
        return False
    return "_" not in field


def _remedy(field: str) -> str:
    if re.fullmatch(r"[0-9A-Fa-f]{2,8}", field):
        return "if these are hexadecimal words, write 0x before them"
    return f"fill it, cut the record, give --missing {quoted(field)} if that means none, or --drop-faulty"


class Dropped:
    """Lines that were left out because they are not like the others."""

    def __init__(self) -> None:
        self._count, self._first = 0, ""

    def take(self, content: bytes, fault: Callable[[str], str]) -> bytes:
        """Return the lines of `content` in which there is no fault, and count the others."""
        kept = []
        for row in content.split(b"\n"):
            text = row.decode(errors="replace")
            if text.strip() and fault(text):
                self.count(1, text.strip()[:60])
            else:
                kept.append(row)
        return b"\n".join(kept)

    def count(self, n: int, first: str) -> None:
        """Count lines that were left out."""
        if n:
            self._count += n
            self._first = self._first or first

    def said(self) -> list[str]:
        """Return how many there were, and the first."""
        first = f"{self._count} lines that are not like the others were left out, the first {quoted(self._first)}"
        return [first] if self._count else []


def _known(values: NDArray[Any]) -> NDArray[np.bool_]:
    """Return which stamps are there."""
    missing: NDArray[np.bool_] = np.isnat(values) if values.dtype.kind == "M" else ~np.isfinite(values)
    return ~missing


def _plain(column: Any) -> NDArray[Any]:
    """Return a column as int64, datetime64[ns] or float64 with NaN where a value is missing."""
    import pyarrow as pa
    import pyarrow.compute as pc

    if pa.types.is_temporal(column.type):
        ticks = column.combine_chunks().cast(pa.int64())
        return np.asarray(ticks.fill_null(np.iinfo(np.int64).min)).view("datetime64[ns]")
    if pa.types.is_decimal(column.type):
        return _from_decimal(column.combine_chunks())
    if column.null_count and pa.types.is_integer(column.type):
        column = pc.cast(column, pa.float64())
    return np.asarray(column.combine_chunks().to_numpy(zero_copy_only=False))


def _from_decimal(column: Any) -> NDArray[Any]:
    """Return decimals as numbers with 64 bits of mantissa, exact for nanoseconds of the epoch; else as float64."""
    import pyarrow as pa

    words = np.frombuffer(column.buffers()[1], np.int64)[2 * column.offset :][: 2 * len(column)].reshape(-1, 2)
    fits = column.null_count == 0 and np.array_equal(words[:, 1], words[:, 0] >> 63)
    if not fits:
        return np.asarray(column.cast(pa.float64()).to_numpy(zero_copy_only=False))
    return words[:, 0].astype(np.longdouble) / np.longdouble(10**_DIGITS)
