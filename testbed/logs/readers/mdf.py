"""MDF4, the format of test benches, through asammdf."""

from __future__ import annotations

import weakref
from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.logs.readers.arrays import ArrayTable, damage_refused
from testbed.logs.table import TableColumn

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray


def open_mdf(path: Path, kind: str) -> ArrayTable:
    """Return the channels of an MDF file, with a column ``time`` for each group.

    Parameters
    ----------
    path : Path
        The file; stays open as long as the table lives.
    kind : str
        What it is called.

    Raises
    ------
    ScenarioError
        If it is damaged.
    """
    from asammdf import MDF

    with damage_refused(path, kind):
        try:
            file = MDF(path)
        except Exception as error:
            _let_go(error)
            raise
    table = ArrayTable(path, kind)
    weakref.finalize(table, file.close)
    several = len(file.groups) > 1
    for number, group in enumerate(file.groups):
        title = getattr(group.channel_group, "acq_name", "") or f"group {number + 1}"
        name, n_time = title if several else "", int(group.channel_group.cycles_nr)
        prefix = f"{name}/" if name else ""
        master = file.masters_db.get(number)
        if master is not None and n_time:
            table.add(TableColumn(f"{prefix}time", "s", name, n_time), _part(file, number, master))
        for index, channel in enumerate(group.channels):
            if index != master and channel.dtype_fmt.kind in "iuf" and n_time:
                column = TableColumn(f"{prefix}{channel.name}", str(channel.unit or ""), name, n_time)
                table.add(column, _part(file, number, index))
    return table


def _part(file: Any, group: int, index: int) -> Any:
    def part(start: int, stop: int) -> NDArray[Any]:
        signal = file.get(group=group, index=index, record_offset=start, record_count=stop - start, samples_only=True)
        return np.asarray(signal[0])

    return part


def _let_go(error: Exception) -> None:
    """Mark the half-made object of the library as closed: its end would print a traceback of its own."""
    trace = error.__traceback__
    while trace is not None:
        half: Any = trace.tb_frame.f_locals.get("self")
        if hasattr(half, "_closed"):
            half._closed = True
            half._tempfile.close()
        trace = trace.tb_next
