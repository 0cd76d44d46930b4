"""TDMS, the format of LabVIEW, through nptdms."""

from __future__ import annotations

import weakref
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.logs.readers.arrays import ArrayTable, damage_refused
from testbed.logs.table import TableColumn

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from numpy.typing import NDArray


def open_tdms(path: Path, kind: str) -> ArrayTable:
    """Return the channels of a TDMS file, with the rate that a waveform states.

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
    from nptdms import TdmsFile

    stream = path.open("rb")
    with damage_refused(path, kind), ExitStack() as left:
        left.enter_context(stream)
        file = TdmsFile.open(stream)
        # It reads as it is asked, so that the file stays open.
        left.pop_all()
    table = ArrayTable(path, kind, header={str(key): str(value) for key, value in file.properties.items()})
    weakref.finalize(table, stream.close)
    several = len(file.groups()) > 1
    for group in file.groups():
        name = group.name if several else ""
        for channel in group.channels():
            if channel.dtype is not None and np.dtype(channel.dtype).kind in "iufM" and len(channel):
                table.add(_column(channel, name), _part(channel))
    return table


def _part(channel: Any) -> Callable[[int, int], NDArray[Any]]:
    return lambda start, stop: np.asarray(channel[start:stop])


def _column(channel: Any, group: str) -> TableColumn:
    said = channel.properties
    step = said.get("wf_increment")
    unit = str(said.get("unit_string", said.get("NI_UnitDescription", "")))
    name = f"{group}/{channel.name}" if group else channel.name
    rate_hz = 1.0 / float(step) if step else None
    return TableColumn(name, unit, group, len(channel), rate_hz)
