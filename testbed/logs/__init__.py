"""Recordings that people bring: one reader for every format, what it found, and the map that says what is what."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from testbed.logs.channel import Log, LogChannel
    from testbed.logs.reader import read_log

__all__ = ["Log", "LogChannel", "read_log"]

_LAZY = {"LogChannel": "testbed.logs.channel", "Log": "testbed.logs.channel", "read_log": "testbed.logs.reader"}


def __getattr__(name: str) -> Any:
    # The options of the command line stand in this room too, and load nothing.
    if name in _LAZY:
        return getattr(import_module(_LAZY[name]), name)
    msg = f"module 'testbed.logs' has no attribute {name!r}"
    raise AttributeError(msg)
