"""HDF5: one group for each clock."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from testbed.playback.track import Track

FILE = "data.h5"


def write_hdf5(folder: Path, tracks: Sequence[Track]) -> dict[str, dict[str, str]]:
    """Write each track as the group ``<name>`` of ``data.h5`` with ``time`` and ``rate``; arguments and result as
    `text.write_csv`.
    """
    import h5py

    with h5py.File(folder / FILE, "w") as file:
        for track in tracks:
            group = file.create_group(track.name)
            group.attrs["sample_rate_hz"] = track.signals.sample_rate_hz
            time = group.create_dataset("time", (track.signals.n_time,), np.int64)
            rate = group.create_dataset("rate", (track.signals.n_time,), np.float64)
            time.attrs["units"], rate.attrs["units"] = "ns", "rad/s"
            start = 0
            for stamps, values in track.blocks():
                time[start : start + stamps.size], rate[start : start + stamps.size] = stamps, values
                start += stamps.size
    names = [track.name for track in tracks]
    return {name: {"file": FILE, "column": f"{name}/rate", "stamps": f"{name}/time"} for name in names}
