"""CSV: one file for each clock, numbers in as many digits as tell them apart."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from testbed.playback.track import Track

TIME, RATE = "t [ns]", "rate [rad/s]"


def write_csv(folder: Path, tracks: Sequence[Track]) -> dict[str, dict[str, str]]:
    """Write each track as ``<name>.csv`` with the columns ``t [ns]`` and ``rate [rad/s]``.

    Parameters
    ----------
    folder : Path
        Where to.
    tracks : sequence of Track
        What is written.

    Returns
    -------
    dict of str to dict
        Where each channel stands: file, column, and the column of its stamps.
    """
    import pyarrow as pa
    from pyarrow import csv

    schema = pa.schema([(TIME, pa.int64()), (RATE, pa.float64())])
    for track in tracks:
        with csv.CSVWriter(folder / f"{track.name}.csv", schema) as file:
            for stamps, rate in track.blocks():
                file.write_table(pa.table([stamps, rate], schema))
    return {track.name: {"file": f"{track.name}.csv", "column": RATE, "stamps": TIME} for track in tracks}
