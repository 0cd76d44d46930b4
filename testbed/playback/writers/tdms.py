"""TDMS, the format of LabVIEW, through nptdms: one waveform for each track."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from testbed.playback.track import Track

FILE = "data.tdms"


def write_tdms(folder: Path, tracks: Sequence[Track]) -> dict[str, dict[str, str]]:
    """Write each track as the channel ``<name>`` of a group ``<name>`` of ``data.tdms``, beside it ``t [ns]``;
    arguments and result as `text.write_csv`.
    """
    from nptdms import ChannelObject, TdmsWriter

    with TdmsWriter(str(folder / FILE)) as file:
        for track in tracks:
            waveform = {
                "wf_increment": 1.0 / track.signals.sample_rate_hz,
                "wf_start_offset": 0.0,
                "unit_string": "rad/s",
            }
            for stamps, rate in track.blocks():
                times = ChannelObject(track.name, "t", stamps, properties={"unit_string": "ns"})
                file.write_segment([times, ChannelObject(track.name, track.name, rate, properties=waveform)])
    # The reader names groups where there are several.
    clocks = {track.name: f"{track.name}/t" if len(tracks) > 1 else "t" for track in tracks}
    return {track.name: {"file": FILE, "column": track.name, "stamps": clocks[track.name]} for track in tracks}
