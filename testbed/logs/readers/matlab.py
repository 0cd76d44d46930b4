"""MATLAB's MAT 5 files: arrays and structures of arrays."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.errors import quoted
from testbed.logs.options import refusal
from testbed.logs.readers.arrays import ArrayTable, guard
from testbed.logs.table import TableColumn

if TYPE_CHECKING:
    from pathlib import Path

KIND = "MATLAB 5"


def open_mat(path: Path) -> ArrayTable:
    """Return the numeric variables of a MAT 5 file.

    Parameters
    ----------
    path : Path
        The file.

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

    try:
        shapes = whosmat(path)
        guard(path, KIND, sum(8 * int(np.prod(shape, dtype=np.float64)) for _, shape, _ in shapes))
        content = loadmat(path, squeeze_me=True, struct_as_record=True)
    except refusal_types() as error:
        raise refusal(path, f"cannot be read ({KIND}): {error}; is the file cut?") from error
    table = ArrayTable(path, KIND)
    for name, value in content.items():
        if not name.startswith("__"):
            _add(table, name, value, "")
    return table


def refusal_types() -> tuple[type[Exception], ...]:
    """Return what a damaged file may raise in the library, which names no error of its own."""
    import zlib

    from scipy.io.matlab import MatReadError

    return (
        OSError,
        EOFError,
        TypeError,
        KeyError,
        IndexError,
        MemoryError,
        NotImplementedError,
        UnicodeError,
        zlib.error,
        MatReadError,
    )


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
