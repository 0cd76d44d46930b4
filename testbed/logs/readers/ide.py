"""IDE, the format of enDAQ's loggers, through idelib."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.logs.options import refusal
from testbed.logs.readers.arrays import ArrayTable
from testbed.logs.table import TableColumn

if TYPE_CHECKING:
    from pathlib import Path


def open_ide(path: Path, kind: str) -> ArrayTable:
    """Return the subchannels of an IDE file, with a column ``time`` in microseconds for each channel.

    Parameters
    ----------
    path : Path
        The file.
    kind : str
        What it is called.

    Raises
    ------
    ScenarioError
        If it is damaged, or an EBML file of another kind.
    """
    import idelib

    try:
        dataset = idelib.importFile(str(path))
        table = ArrayTable(path, kind)
        for channel in dataset.channels.values():
            _add(table, channel)
    except Exception as error:
        raise refusal(path, f"cannot be read ({kind}): {error}; is the file cut?") from error
    return table


def _add(table: ArrayTable, channel: Any) -> None:
    events = channel.getSession()
    samples = np.asarray(events.arraySlice())
    if samples.ndim != 2 or samples.shape[1] < 1:
        return
    group = channel.name
    table.add_array(TableColumn(f"{group}/time", "us", group), samples[0])
    for values, part in zip(samples[1:], channel.subchannels, strict=True):
        table.add_array(TableColumn(f"{group}/{part.name}", str(part.units[1] if part.units else ""), group), values)
