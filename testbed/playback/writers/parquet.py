"""Parquet: one file for each clock, since all columns of a file have one length."""

from __future__ import annotations

from typing import TYPE_CHECKING

from testbed.playback.writers.text import RATE, TIME

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from testbed.playback.track import Track


def write_parquet(folder: Path, tracks: Sequence[Track]) -> dict[str, dict[str, str]]:
    """Write each track as ``<name>.parquet``; arguments and result as `text.write_csv`."""
    import pyarrow as pa
    from pyarrow import parquet

    units = {TIME: {"unit": "ns"}, RATE: {"unit": "rad/s"}}
    kinds = {TIME: pa.int64(), RATE: pa.float64()}
    schema = pa.schema([pa.field(name, kind, metadata=units[name]) for name, kind in kinds.items()])
    for track in tracks:
        with parquet.ParquetWriter(folder / f"{track.name}.parquet", schema) as file:
            for stamps, rate in track.blocks():
                file.write_table(pa.table([stamps, rate], schema))
    return {track.name: {"file": f"{track.name}.parquet", "column": RATE, "stamps": TIME} for track in tracks}
