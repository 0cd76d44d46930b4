"""Columns that stand in arrays: what every binary format of arrays comes down to."""

from __future__ import annotations

import math
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.errors import ScenarioError, quoted
from testbed.logs.options import refusal
from testbed.logs.table import TableColumn

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterator, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from testbed.logs.table import Block

    Part = Callable[[int, int], NDArray[Any]]

_BLOCK = 1 << 20
# A file may claim this many times its own size: beyond, and beyond what harms nobody, it is taken for a bomb.
_MOST_RATIO, _HARMLESS = 100, 256 << 20
_MOST_COMPONENTS = 64
MOST_COLUMNS = 10_000


@dataclass
class ArrayTable:
    """A file whose columns are arrays.

    Parameters
    ----------
    path : Path
        The file.
    format : str
        What it is.
    columns : list of TableColumn
        What it holds.
    parts : list of callable
        One for each column: from first and last row to the numbers.
    header : dict
        Scalars and attributes of the file, as text.
    notes : list of str
        What was left out.
    """

    path: Path
    format: str
    columns: list[TableColumn] = field(default_factory=list)
    parts: list[Part] = field(default_factory=list)
    header: dict[str, str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)

    def add(self, column: TableColumn, part: Part) -> None:
        """Add a column; ScenarioError if there are too many."""
        if len(self.columns) >= MOST_COLUMNS:
            message = f"expected at most {MOST_COLUMNS} columns ({self.format}): write one sample a row"
            raise refusal(self.path, message)
        self.columns.append(column)
        self.parts.append(part)

    def add_array(self, column: TableColumn, data: Any) -> None:
        """Add an array: one column, one for each component of a sample, or one for each field of a record.

        Parameters
        ----------
        column : TableColumn
            Name, unit and group.
        data : array_like
            Has `shape`, `dtype` and slices; the longer of two dimensions is the time.
        """
        shape, dtype = data.shape, data.dtype
        if dtype.names:
            for name in dtype.names:
                self._add_field(column, name, data)
            return
        if dtype.kind == "c":
            self.notes.append(f"{quoted(column.name)} was left out: complex numbers; save their parts")
        if dtype.kind not in "iufbM" or len(shape) > 2 or not shape:
            return
        long = [axis for axis in range(len(shape)) if shape[axis] > 1] or [0]
        axis = max(long, key=lambda i: shape[i])
        n_parts = 1 if len(shape) == 1 else shape[1 - axis]
        if n_parts > _MOST_COMPONENTS:
            self.notes.append(f"{quoted(column.name)} was left out: {n_parts} components of a sample")
            return
        for i in range(n_parts):
            name = column.name if n_parts == 1 else f"{column.name}[{i}]" if column.name else f"column {i + 1}"
            single = replace(column, name=name or "column 1", n_time=shape[axis])
            self.add(single, _component(data, len(shape), axis, i))

    def _add_field(self, column: TableColumn, name: str, data: Any) -> None:
        """Add a field of the records of an array, or each component of one that has several."""
        kind = data.dtype[name]
        label, group = f"{column.name}/{name}" if column.name else name, column.name or column.group
        if kind.base.kind not in "iufbM" or len(kind.shape) > 1 or math.prod(kind.shape) > _MOST_COMPONENTS:
            return
        for i in range(kind.shape[0] if kind.shape else 1):
            place = (slice(None), i) if kind.shape else slice(None)
            short = f"{label}[{i}]" if kind.shape and kind.shape[0] > 1 else label
            part = lambda start, stop, place=place: data[start:stop][name][place]
            self.add(TableColumn(short, "", group, data.shape[0]), part)

    def blocks(self, wanted: Sequence[int], stamps: Collection[int] = ()) -> Iterator[Block]:
        """Yield the wanted columns block by block; ScenarioError if the file claims far more than it can hold."""
        sizes = [self.columns[i].n_time or 0 for i in wanted]
        if len(set(sizes)) > 1:
            names = ", ".join(f"{quoted(self.columns[i].name)} {n}" for i, n in zip(wanted, sizes, strict=True))
            raise refusal(self.path, f"expected columns of one length, got {names}", "--time")
        guard(self.path, self.format, 8 * sum(sizes))
        for start in range(0, sizes[0], _BLOCK):
            with damage_refused(self.path, self.format, OSError, ValueError, EOFError, RuntimeError):
                block = {i: self.parts[i](start, min(start + _BLOCK, sizes[0])) for i in wanted}
            yield {i: exact(values) if i in stamps else np.asarray(values, np.float64) for i, values in block.items()}

    def line(self, row: int) -> int | None:
        """Return None: there are no lines."""
        return None


@contextmanager
def damage_refused(path: Path, kind: str, *errors: type[Exception]) -> Iterator[None]:
    """Refuse a file that its library cannot read, with what the library says of it.

    Parameters
    ----------
    path : Path
        The file.
    kind : str
        Its format.
    *errors : type of Exception
        What the library raises; any exception if left out, for few say which.

    Raises
    ------
    ScenarioError
        Instead of them.
    """
    try:
        yield
    except ScenarioError:
        raise
    except Exception as error:
        if errors and not isinstance(error, errors):
            raise
        raise refusal(path, f"cannot be read ({kind}): {error}; is the file cut or damaged?") from error


def exact(values: NDArray[Any]) -> NDArray[Any]:
    """Return stamps as int64, float64 or datetime64[ns]; single precision stays single."""
    if values.dtype.kind == "M":
        return values.astype("datetime64[ns]")
    return values.astype(np.int64) if values.dtype.kind in "iub" else values


def guard(path: Path, kind: str, claimed: int) -> None:
    """Refuse a file that claims far more data than its size can hold.

    Parameters
    ----------
    path : Path
        The file.
    kind : str
        Its format.
    claimed : int
        Bytes of what is to be read.

    Raises
    ------
    ScenarioError
        If it is a decompression bomb, or damaged so that it looks like one.
    """
    size = path.stat().st_size
    if claimed > _HARMLESS and claimed > _MOST_RATIO * size:
        claim = f"claims {claimed / 1e9:.3g} GB of data in {size / 1e6:.3g} MB ({kind})"
        raise refusal(path, f"{claim}: damaged, or made to fill the memory; write the columns needed to a new file")


def _component(data: Any, n_axes: int, axis: int, i: int) -> Part:
    if n_axes == 1:
        return lambda start, stop: np.asarray(data[start:stop])
    if axis == 0:
        return lambda start, stop: np.asarray(data[start:stop, i])
    return lambda start, stop: np.asarray(data[i, start:stop])
