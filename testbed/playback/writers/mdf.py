"""MDF4, the format of test benches, through asammdf: one channel group for each clock."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from testbed.logs.clock import NANO

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from testbed.playback.track import Track

FILE = "data.mf4"


def write_mdf(folder: Path, tracks: Sequence[Track]) -> dict[str, dict[str, str]]:
    """Write each track as the channel ``<name>`` of ``data.mf4``, time in seconds; arguments and result as
    `text.write_csv`.
    """
    from asammdf import MDF, Signal

    with MDF(version="4.10") as file:
        for index, track in enumerate(tracks):
            for block, (stamps, rate) in enumerate(track.blocks()):
                seconds = stamps * NANO
                if block:
                    file.extend(index, [(seconds, None), (rate, None)])
                else:
                    signal = Signal(np.array(rate), seconds, name=track.name, unit="rad/s")
                    file.append([signal], acq_name=track.name)
        file.save(folder / FILE, overwrite=True)
    # The reader names groups where there are several.
    clocks = {track.name: f"{track.name}/time" if len(tracks) > 1 else "time" for track in tracks}
    return {track.name: {"file": FILE, "column": track.name, "stamps": clocks[track.name]} for track in tracks}
