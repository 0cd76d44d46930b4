"""ULog, the format of PX4's flight logs, through pyulog."""

from __future__ import annotations

from typing import TYPE_CHECKING

from testbed.logs.readers.arrays import ArrayTable, damage_refused
from testbed.logs.table import TableColumn

if TYPE_CHECKING:
    from pathlib import Path


def open_ulog(path: Path, kind: str) -> ArrayTable:
    """Return the fields of all topics of a ULog.

    Parameters
    ----------
    path : Path
        The file.
    kind : str
        What it is called.

    Returns
    -------
    ArrayTable
        Columns ``topic/field``, the second instance of a topic ``topic_1/field``.

    Raises
    ------
    ScenarioError
        If it is damaged.
    """
    from pyulog import ULog

    with damage_refused(path, kind):
        log = ULog(str(path))
    table = ArrayTable(path, kind)
    if log.file_corruption:
        table.notes.append("the log is damaged: what could be read of it is used")
    for topic in log.data_list:
        group = topic.name if not topic.multi_id else f"{topic.name}_{topic.multi_id}"
        for field, values in topic.data.items():
            table.add_array(TableColumn(f"{group}/{field}", _unit(topic.name, field), group), values)
    return table


def _unit(topic: str, field: str) -> str:
    """Return the unit that PX4's definitions give a field; the log itself has none."""
    if field.startswith("timestamp"):
        return "us"
    if (topic == "sensor_gyro" and field in {"x", "y", "z"}) or field.startswith("gyro_rad["):
        return "rad/s"
    return "rad" if field.startswith("delta_angle[") else ""
