"""IDE, the format of enDAQ's loggers, through idelib."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.logs.readers.arrays import ArrayTable, damage_refused
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
    from idelib import importer

    table = ArrayTable(path, kind)
    with path.open("rb") as stream, damage_refused(path, kind):
        dataset = importer.openFile(stream)
        importer.readData(dataset)
        for channel in dataset.channels.values():
            # Channels that a recorder of its kind has, but this one did not record, cannot be asked.
            if channel.sessions:
                _add(table, channel)
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
