"""Recordings that people bring: one reader for every format, what it found, and the map that says what is what."""

from testbed.logs.reader import Channel, Log, read_log

__all__ = ["Channel", "Log", "read_log"]
