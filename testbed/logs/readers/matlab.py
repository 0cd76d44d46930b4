"""MATLAB's MAT 5 files: arrays and structures of arrays."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.errors import quoted
from testbed.logs.readers.arrays import ArrayTable, damage_refused, guard
from testbed.logs.table import TableColumn

if TYPE_CHECKING:
    from pathlib import Path


def open_mat(path: Path, kind: str) -> ArrayTable:
    """Return the numeric variables of a MAT file of version 4 or 5.

    Parameters
    ----------
    path : Path
        The file.
    kind : str
        What it is called: MATLAB 4 or 5.

    Returns
    -------
    ArrayTable
        Columns are named ``variable``, ``structure/field`` and ``variable[0]`` for the first of several components.

    Raises
    ------
    ScenarioError
        If it is damaged, or claims far more than it can hold.
    """
    from scipy.io import loadmat, whosmat

    with damage_refused(path, kind):
        shapes = whosmat(path)
        guard(path, kind, sum(8 * int(np.prod(shape, dtype=np.float64)) for _, shape, _ in shapes))
        content = loadmat(path, squeeze_me=True, struct_as_record=True)
    table = ArrayTable(path, kind)
    for name, value in content.items():
        if not name.startswith("__"):
            _add(table, name, value, "")
    return table


def _add(table: ArrayTable, name: str, value: Any, group: str) -> None:
    array = np.asarray(value)
    if array.dtype.names and array.size == 1:
        for field in array.dtype.names:
            _add(table, f"{name}/{field}", array.item()[array.dtype.names.index(field)], name)
    elif array.dtype.kind == "O" or type(value).__name__ == "MatlabOpaque":
        table.notes.append(f"{quoted(name)} was left out: an object of MATLAB; save its columns as arrays")
    elif array.size == 1 and array.dtype.kind in "iufU":
        table.header[name.rpartition("/")[2]] = str(array.item())
    else:
        table.add_array(TableColumn(name, "", group), array)
