"""MCAP, the container of ROS 2: one topic for each track, a message for each sample."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from testbed.playback.track import Track

FILE = "data.mcap"
# A message std_msgs/msg/Float64 in CDR: the head says little-endian. JSON, which other tools read too, has no word for
# a reading that is lost.
_MESSAGE = struct.Struct("<4xd")
_HEAD = b"\x00\x01\x00\x00"


def write_mcap(folder: Path, tracks: Sequence[Track]) -> dict[str, dict[str, str]]:
    """Write each track as the topic ``/<name>`` of ``data.mcap``; arguments and result as `text.write_csv`."""
    from mcap.writer import Writer

    with (folder / FILE).open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="ros2")
        schema = writer.register_schema("std_msgs/msg/Float64", "ros2msg", b"float64 data")
        for track in tracks:
            channel = writer.register_channel(f"/{track.name}", "cdr", schema)
            for stamps, rate in track.blocks():
                for stamp, value in zip(stamps.tolist(), rate.tolist(), strict=True):
                    writer.add_message(channel, stamp, _HEAD + _MESSAGE.pack(value)[4:], stamp)
        writer.finish()
    names = [track.name for track in tracks]
    return {name: {"file": FILE, "column": f"/{name}/data", "stamps": f"/{name}/log_time_ns"} for name in names}
