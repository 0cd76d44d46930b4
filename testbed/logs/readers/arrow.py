"""Parquet, and Arrow's own files (Feather 2)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.errors import quoted
from testbed.logs.options import refusal
from testbed.logs.readers.arrays import MOST_COLUMNS, damage_refused, exact, guard
from testbed.logs.table import TableColumn

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from testbed.logs.table import Block

_BLOCK = 1 << 20
_MOST_FOOTER = 16 << 20
_MOST_COMPONENTS = 64


class ArrowTable:
    """A Parquet or Arrow file.

    Parameters
    ----------
    path : Path
        The file.
    kind : str
        ``Parquet`` or ``Arrow``.

    Raises
    ------
    ScenarioError
        If it is damaged, has too many columns, or claims far more than it can hold.
    """

    def __init__(self, path: Path, kind: str) -> None:
        import pyarrow as pa

        self.path, self.format = path, kind
        self.notes: list[str] = []
        with damage_refused(path, kind, pa.ArrowException, OSError):
            self._file, schema, n_time = self._open(kind)
        if len(schema) > MOST_COLUMNS:
            raise refusal(path, f"expected at most {MOST_COLUMNS} columns, got {len(schema)}: write one sample a row")
        self._parts = [part for field in schema for part in _parts(field)]
        if len(self._parts) > MOST_COLUMNS:
            raise refusal(
                path, f"expected at most {MOST_COLUMNS} columns, got {len(self._parts)}: write one sample a row"
            )
        self.columns = [TableColumn(name, unit, "", n_time) for name, unit, _ in self._parts]
        odd = [field.name for field in schema if not any(_parts(field)) and not _is_word(field.type)]
        self.notes += [f"{quoted(name)} was left out: its type holds no column of numbers" for name in odd]
        self.header = {
            k.decode(errors="replace"): v.decode(errors="replace") for k, v in (schema.metadata or {}).items()
        }

    def blocks(self, wanted: Sequence[int], stamps: Collection[int] = ()) -> Iterator[Block]:
        """Yield the wanted columns block by block."""
        import pyarrow as pa

        guard(self.path, self.format, 8 * len(wanted) * (self.columns[0].n_time or 0))
        ways = {i: self._parts[i][2] for i in wanted}
        names = list(dict.fromkeys(way[0] for way in ways.values()))
        with damage_refused(self.path, self.format, pa.ArrowException, OSError):
            for batch in self._batches(names):
                if batch.num_rows:
                    yield {i: _array(_follow(batch, way), i in stamps) for i, way in ways.items()}

    def line(self, row: int) -> int | None:
        """Return None: there are no lines."""
        return None

    def _open(self, kind: str) -> tuple[Any, Any, int]:
        if kind == "Arrow":
            from pyarrow import ipc

            file = ipc.open_file(self.path)
            return file, file.schema, sum(file.get_batch(i).num_rows for i in range(file.num_record_batches))
        from pyarrow import parquet

        with self.path.open("rb") as stream:
            stream.seek(-8, 2)
            length = int.from_bytes(stream.read(4), "little")
        if length > _MOST_FOOTER:
            raise refusal(
                self.path, f"expected at most {MOST_COLUMNS} columns, got a footer of {length / 1e6:.0f} MB (Parquet)"
            )
        file = parquet.ParquetFile(self.path)
        return file, file.schema_arrow, file.metadata.num_rows

    def _batches(self, names: list[str]) -> Iterator[Any]:
        if self.format == "Parquet":
            yield from self._file.iter_batches(batch_size=_BLOCK, columns=names, use_threads=False)
        else:
            for i in range(self._file.num_record_batches):
                yield self._file.get_batch(i)


def _parts(field: Any) -> list[tuple[str, str, tuple[Any, ...]]]:
    """Return name, unit and way of each column of numbers in a field: in a structure, in lists of one length."""
    import pyarrow as pa

    kind = field.type
    if _is_number(kind):
        return [(field.name, _unit(field), (field.name,))]
    if pa.types.is_struct(kind):
        inner = [part for i in range(kind.num_fields) for part in _parts(kind.field(i))]
        return [(f"{field.name}.{name}", unit, (field.name, *way)) for name, unit, way in inner]
    if pa.types.is_fixed_size_list(kind) and _is_number(kind.value_type) and kind.list_size <= _MOST_COMPONENTS:
        return [(f"{field.name}[{i}]", _unit(field), (field.name, i)) for i in range(kind.list_size)]
    return []


def _follow(batch: Any, way: tuple[Any, ...]) -> Any:
    """Return the column that a way through structures and lists leads to."""
    import pyarrow.compute as pc

    column = batch.column(batch.schema.get_field_index(way[0]))
    for step in way[1:]:
        column = pc.list_element(column, step) if isinstance(step, int) else pc.struct_field(column, step)
    return column


def _is_word(kind: Any) -> bool:
    import pyarrow as pa

    return bool(pa.types.is_string(kind) or pa.types.is_large_string(kind) or pa.types.is_null(kind))


def _is_number(kind: Any) -> bool:
    import pyarrow as pa

    return bool(
        pa.types.is_integer(kind)
        or pa.types.is_floating(kind)
        or pa.types.is_timestamp(kind)
        or pa.types.is_duration(kind)
        or pa.types.is_decimal(kind)
        or pa.types.is_boolean(kind)
    )


def _unit(field: Any) -> str:
    found = {k.decode(errors="replace").lower(): v.decode(errors="replace") for k, v in (field.metadata or {}).items()}
    return str(found.get("unit", found.get("units", "")))


def _array(column: Any, stamp: bool) -> NDArray[Any]:
    import pyarrow as pa

    if pa.types.is_timestamp(column.type):
        column = column.cast(pa.timestamp("ns"))
    if pa.types.is_duration(column.type):
        # Since the start: a date of 1970, as times of day are.
        column = column.cast(pa.duration("ns")).cast(pa.int64()).cast(pa.timestamp("ns"))
    if pa.types.is_decimal(column.type):
        column = column.cast(pa.float64())
    values = column.to_numpy(zero_copy_only=False)
    return exact(values) if stamp else np.asarray(values, np.float64)
