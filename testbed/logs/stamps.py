"""Stamps of a file in nanoseconds, block by block."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.errors import quoted
from testbed.logs.clock import NANO, ClockScan, TimeBase, nanoseconds, resolution_ns
from testbed.logs.options import refusal

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from testbed.logs.table import Table

_DAY_NS = 86_400_000_000_000
_BITS = (16, 24, 32)


class StampScan:
    """A column of stamps: its blocks in nanoseconds, and what they say.

    Parameters
    ----------
    table : Table
        The file.
    column : int
        Place of the column.
    unit_s : float
        Its unit [s].
    needed : bool
        Whether the stamps are used: else they are only compared with the rate that was said, and a fault in them is
        none of the recording.
    """

    def __init__(self, table: Table, column: int, unit_s: float, *, needed: bool = True) -> None:
        self._table, self.column, self._unit = table, column, unit_s
        self._needed, self.broken = needed, False
        self._scan: ClockScan | None = None
        self._row = 0

    def add(self, values: NDArray[Any]) -> NDArray[np.int64]:
        """Return the next stamps [ns], shape (n_time,), a counter's turns added.

        Raises
        ------
        ScenarioError
            If one is missing or out of range, with the line.
        """
        if not self._needed and not self.broken:
            self.broken = not _readable(values, self._unit)
        if self.broken:
            return np.zeros(values.size, np.int64)
        if self._scan is None:
            self._scan = ClockScan(resolution_ns(values, self._unit), _turns(values, self._unit))
        stamps = self._scan.add(self._in_nanoseconds(values))
        self._row += values.size
        return stamps

    def result(self) -> TimeBase:
        """Return what the stamps say."""
        return (self._scan or ClockScan()).result()

    def _in_nanoseconds(self, values: NDArray[Any]) -> NDArray[np.int64]:
        name = self._table.columns[self.column].name
        missing = np.isnat(values) if values.dtype.kind == "M" else ~np.isfinite(values)
        if missing.any():
            line = self._table.line(self._row + int(np.argmax(missing)))
            raise refusal(self._table.path, f"expected a time in {quoted(name)}, got none; remove the line", line=line)
        try:
            return nanoseconds(values, self._unit)
        except OverflowError as error:
            raise refusal(self._table.path, f"{error}; is the unit of {quoted(name)} right?", "--time-unit") from error


def _readable(values: NDArray[Any], unit_s: float) -> bool:
    """Return whether all stamps are there and in range."""
    if values.dtype.kind == "M":
        return not bool(np.isnat(values).any())
    if not np.isfinite(values).all():
        return False
    return not values.size or float(np.max(np.abs(values))) * unit_s / NANO < float(np.iinfo(np.int64).max)


def _turns(values: NDArray[Any], unit_s: float) -> tuple[int, ...]:
    """Return after how long a counter of 16, 24 or 32 bits, or a time of day, may begin anew [ns]."""
    if values.dtype.kind == "M":
        return (_DAY_NS,) if values.size and abs(int(values.view(np.int64)[0])) < _DAY_NS else ()
    if values.dtype.kind not in "iu" or not values.size or int(values.min()) < 0:
        return ()
    turns = [(1 << bits) * unit_s / NANO for bits in _BITS if int(values.max()) < 1 << bits]
    return tuple(round(turn) for turn in turns if turn < float(1 << 62))
