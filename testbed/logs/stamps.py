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
    """

    def __init__(self, table: Table, column: int, unit_s: float) -> None:
        self._table, self.column, self._unit = table, column, unit_s
        self._scan: ClockScan | None = None
        self._row = 0

    def add(self, values: NDArray[Any]) -> NDArray[np.int64]:
        """Return the next stamps [ns], shape (n_time,), a counter's turns added.

        Raises
        ------
        ScenarioError
            If one is missing or out of range, with the line.
        """
        if self._scan is None:
            self._scan = ClockScan(resolution_ns(values, self._unit), _turn(values, self._unit))
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


def _turn(values: NDArray[Any], unit_s: float) -> int:
    """Return after how long a counter of 32 bits, or a time of day, begins anew [ns]; 0: never."""
    if values.dtype.kind == "M":
        return _DAY_NS if values.size and abs(int(values.view(np.int64)[0])) < _DAY_NS else 0
    small = values.dtype.kind in "iu" and values.size and int(values.min()) >= 0 and int(values.max()) < 1 << 32
    turn = (1 << 32) * unit_s / NANO
    return round(turn) if small and turn < float(1 << 62) else 0
