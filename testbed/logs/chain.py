"""A recording in consecutive files, as loggers write that begin a new one every hour."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from testbed.logs.options import refusal

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Mapping, Sequence
    from pathlib import Path

    from testbed.logs.table import Block, Table, TableColumn


class FileChain:
    """Files of the same columns, one after the other.

    Parameters
    ----------
    tables : sequence of Table
        In the order of time.

    Raises
    ------
    ScenarioError
        If one has other columns than the first.
    """

    def __init__(self, tables: Sequence[Table]) -> None:
        self._tables = tables
        names = [column.name for column in tables[0].columns]
        for table in tables[1:]:
            other = [column.name for column in table.columns]
            if other != names:
                message = (
                    f"expected the columns of {tables[0].path} ({', '.join(names[:8])}), got {', '.join(other[:8])}"
                )
                raise refusal(table.path, message, "file")
        self.path: Path = tables[0].path
        self.format = f"{tables[0].format}; {len(tables)} files"
        self.columns: Sequence[TableColumn] = [
            _joined([table.columns[i] for table in tables]) for i in range(len(names))
        ]
        self.header: Mapping[str, str] = tables[0].header
        self._n_first: int | None = None

    @property
    def notes(self) -> Sequence[str]:
        """What was left out, with the file."""
        return [f"{table.path}: {note}" for table in self._tables for note in table.notes]

    def blocks(self, wanted: Sequence[int], stamps: Collection[int] = ()) -> Iterator[Block]:
        """Yield the wanted columns of all files block by block."""
        for table in self._tables:
            n_time = 0
            for block in table.blocks(wanted, stamps):
                n_time += next(iter(block.values())).size
                yield block
            self._n_first = n_time if self._n_first is None else self._n_first

    def line(self, row: int) -> int | None:
        """Return the line of a row of the first file; the others' have none under its name."""
        return self._tables[0].line(row) if self._n_first is None or row < self._n_first else None


def _joined(parts: Sequence[TableColumn]) -> TableColumn:
    """Return a column of several files, as long as all together."""
    known = [one.n_time for one in parts if one.n_time is not None]
    about = sum(one.n_time or one.about or 0 for one in parts)
    return replace(parts[0], n_time=sum(known) if len(known) == len(parts) else None, about=about)
