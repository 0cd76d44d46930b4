"""UFF, the universal file format of modal analysis (data set 58), through pyuff."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from testbed.logs.readers.arrays import ArrayTable, damage_refused
from testbed.logs.table import TableColumn

if TYPE_CHECKING:
    from pathlib import Path

_TIME_RESPONSE = 1


def open_uff(path: Path, kind: str) -> ArrayTable:
    """Return the time responses of a UFF file, with the rate that each states.

    Parameters
    ----------
    path : Path
        The file.
    kind : str
        What it is called.

    Raises
    ------
    ScenarioError
        If it is damaged.
    """
    import pyuff

    with damage_refused(path, kind):
        sets = pyuff.UFF(str(path)).read_sets()
    table = ArrayTable(path, kind)
    for number, one in enumerate(sets if isinstance(sets, list) else [sets], 1):
        if one.get("type") == 58 and one.get("func_type") == _TIME_RESPONSE and one.get("abscissa_spacing") == 1:
            name = f"{str(one.get('rsp_ent_name') or '').strip() or 'set'} {number}"
            unit, step = str(one.get("ordinate_axis_units_lab") or "").strip(), float(one["abscissa_inc"])
            rate_hz = 1.0 / step if step > 0.0 else None
            column = TableColumn(name, unit if unit != "NONE" else "", name, rate_hz=rate_hz)
            table.add_array(column, np.real(np.asarray(one["data"])))
        else:
            table.notes.append(f"data set {number} was left out: no evenly sampled time response")
    return table
