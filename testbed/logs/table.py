"""What every format gives: columns by name, read in blocks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Mapping, Sequence
    from pathlib import Path

    import numpy as np
    from numpy.typing import NDArray

    Block = dict[int, NDArray[Any]]


@dataclass(frozen=True)
class TableColumn:
    """A column that a file holds.

    Parameters
    ----------
    name : str
        As in the file; ``group/name`` where the file has groups, ``name[1]`` for the second of several components.
    unit : str
        As the file says beside the name (an attribute, a line of units), or empty.
    group : str
        Columns of one group and length are sampled together.
    n_time : int, optional
        Number of samples, where the format says it.
    rate_hz : float, optional
        Sample rate that the file itself states [Hz].
    about : int, optional
        About how many samples, where the format does not say it.
    """

    name: str
    unit: str = ""
    group: str = ""
    n_time: int | None = None
    rate_hz: float | None = None
    about: int | None = None

    def __post_init__(self) -> None:
        # A name is printed: a control character in it would act on the terminal.
        for key in ("name", "unit", "group"):
            object.__setattr__(self, key, "".join(c if c.isprintable() else "?" for c in getattr(self, key)))

    @property
    def short(self) -> str:
        """Name within its group."""
        return self.name.removeprefix(f"{self.group}/") if self.group else self.name


class Table(Protocol):
    """A file of columns.

    Numbers are float64, NaN where a value is missing. Columns that are named as stamps stay as exact as the file has
    them: integers int64, dates and times of day datetime64[ns].
    """

    @property
    def path(self) -> Path:
        """The file."""
        ...

    @property
    def format(self) -> str:
        """What it is, for the reader."""
        ...

    @property
    def columns(self) -> Sequence[TableColumn]:
        """What it holds."""
        ...

    @property
    def header(self) -> Mapping[str, str]:
        """What it says beside the columns, such as a sample rate."""
        ...

    @property
    def notes(self) -> Sequence[str]:
        """What was left out, known after reading."""
        ...

    def blocks(self, wanted: Sequence[int], stamps: Collection[int] = ()) -> Iterator[Block]:
        """Yield the wanted columns, which belong to one group, block by block; those of `stamps` exact."""
        ...

    def line(self, row: int) -> int | None:
        """Return the line of a row, counted from 0, where the format has lines."""
        ...


class RowsOf:
    """Some rows of a table, for messages about them.

    Parameters
    ----------
    table : Table
        The file.
    rows : ndarray, shape (n_time,)
        Which of its rows.
    """

    def __init__(self, table: Table, rows: NDArray[np.intp]) -> None:
        self._table, self._rows = table, rows
        self.path, self.format = table.path, table.format
        self.columns, self.header, self.notes = table.columns, table.header, table.notes

    def blocks(self, wanted: Sequence[int], stamps: Collection[int] = ()) -> Iterator[Block]:
        """Yield what the file holds, all rows."""
        return self._table.blocks(wanted, stamps)

    def line(self, row: int) -> int | None:
        """Return the line of one of these rows."""
        return self._table.line(int(self._rows[row]))
