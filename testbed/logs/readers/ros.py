"""Bags of ROS 1 and 2 and MCAP files, through rosbags; MCAP with JSON messages through mcap."""

from __future__ import annotations

import dataclasses
import json
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.logs.readers.arrays import ArrayTable, damage_refused
from testbed.logs.table import TableColumn

if TYPE_CHECKING:
    from collections.abc import Iterator

    Row = dict[str, float | int]

_SUFFIX = {"ROS bag": ".bag", "ROS 2 bag (db3)": ".db3", "MCAP": ".mcap"}
_LONGEST = 16


def open_ros(path: Path, kind: str) -> ArrayTable:
    """Return the numbers of all topics of a bag.

    Parameters
    ----------
    path : Path
        The file.
    kind : str
        What it is called.

    Returns
    -------
    ArrayTable
        Columns such as ``/imu/angular_velocity.x``, with ``header.stamp`` and ``log_time_ns`` in nanoseconds.

    Raises
    ------
    ScenarioError
        If it is damaged, or its messages are of a kind that is not known.
    """
    rows: dict[str, list[Row]] = {}
    with damage_refused(path, kind):
        for topic, row in _json_rows(path) if kind == "MCAP" and _is_json(path) else _rows(path, kind):
            rows.setdefault(topic, []).append(row)
    table = ArrayTable(path, kind)
    for topic, found in rows.items():
        names = [name for name in found[0] if all(name in row for row in found)]
        for name in names:
            values = np.array([row[name] for row in found])
            table.add_array(TableColumn(f"{topic}/{name}", _unit(name), topic), values)
    return table


def _rows(path: Path, kind: str) -> Iterator[tuple[str, Row]]:
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    with tempfile.TemporaryDirectory() as folder:
        # The library goes by the name, which may be wrong.
        alias = Path(folder) / f"log{_SUFFIX[kind]}"
        alias.symlink_to(path.absolute())
        with AnyReader([alias], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
            for connection, stamp, raw in reader.messages():
                row: Row = {"log_time_ns": stamp}
                _flatten(reader.deserialize(raw, connection.msgtype), "", row)
                yield connection.topic, row


def _is_json(path: Path) -> bool:
    from mcap.reader import make_reader

    with path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    return summary is not None and all(channel.message_encoding == "json" for channel in summary.channels.values())


def _json_rows(path: Path) -> Iterator[tuple[str, Row]]:
    from mcap.reader import make_reader

    with path.open("rb") as stream:
        for _, channel, message in make_reader(stream).iter_messages():
            row: Row = {"log_time_ns": message.log_time}
            _flatten(json.loads(message.data), "", row)
            yield channel.topic, row


def _flatten(node: Any, name: str, row: Row) -> None:
    """Collect the numbers of a message by their dotted names; stamps become nanoseconds."""
    if dataclasses.is_dataclass(node) and not isinstance(node, type):
        node = {part.name: getattr(node, part.name) for part in dataclasses.fields(node)}
    if isinstance(node, dict):
        if {"sec", "nanosec"} <= node.keys():
            row[name] = int(node["sec"]) * 1_000_000_000 + int(node["nanosec"])
            return
        for key, value in node.items():
            if not key.startswith("__"):
                _flatten(value, f"{name}.{key}" if name else key, row)
    elif isinstance(node, bool | int | float | np.number):
        row[name] = node  # type: ignore[assignment]
    elif isinstance(node, np.ndarray | list) and len(node) <= _LONGEST and "covariance" not in name:
        for i, value in enumerate(node):
            _flatten(value, f"{name}[{i}]", row)


def _unit(name: str) -> str:
    """Return the unit that ROS fixes for a field (REP 103)."""
    if name in {"log_time_ns", "header.stamp"}:
        return "ns"
    return (
        "rad/s" if name.startswith("angular_velocity.") else "m/s^2" if name.startswith("linear_acceleration.") else ""
    )
