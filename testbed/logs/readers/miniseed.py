"""MiniSEED, the format of seismology, through obspy."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.logs.readers.arrays import ArrayTable, damage_refused, guard
from testbed.logs.table import TableColumn

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path


def open_miniseed(path: Path, kind: str) -> ArrayTable:
    """Return the traces of a MiniSEED file: counts, with stamps from the start and rate of each piece.

    Parameters
    ----------
    path : Path
        The file.
    kind : str
        What it is called.

    Returns
    -------
    ArrayTable
        Columns are named after station and channel, such as ``RLAS/HJZ``; counts, whose scale the file does not know.

    Raises
    ------
    ScenarioError
        If it is damaged.
    """
    from obspy import read

    with damage_refused(path, kind), warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        heads = read(path, format="MSEED", headonly=True)
        guard(path, kind, sum(8 * trace.stats.npts for trace in heads))
        stream = read(path, format="MSEED")
    table = ArrayTable(path, kind, notes=list(dict.fromkeys(str(one.message) for one in told)))
    for name in dict.fromkeys(trace.id for trace in stream):
        pieces = sorted((trace for trace in stream if trace.id == name), key=lambda trace: trace.stats.starttime)
        stats = pieces[0].stats
        group = f"{stats.station}/{stats.channel}"
        table.add_array(TableColumn(f"{group}/time", "ns", group), _stamps(pieces))
        table.add_array(TableColumn(f"{group}/counts", "", group), np.concatenate([piece.data for piece in pieces]))
    return table


def _stamps(pieces: Sequence[Any]) -> np.ndarray:
    """Return the stamp of each sample [ns]."""
    parts = []
    for piece in pieces:
        times = np.arange(piece.stats.npts) * (1e9 / piece.stats.sampling_rate)
        parts.append(piece.stats.starttime.ns + np.rint(times).astype(np.int64))
    return np.concatenate(parts)
