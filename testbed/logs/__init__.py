"""Recordings that people bring: one reader for every format, what it found, and the map that says what is what."""

from testbed.logs.channel import Channel, Log
from testbed.logs.reader import read_log

__all__ = ["Channel", "Log", "read_log"]
