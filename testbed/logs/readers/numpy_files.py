"""NumPy's npy and npz files, and the older NetCDF 3."""

from __future__ import annotations

import zipfile
from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.logs.readers.arrays import ArrayTable, damage_refused, guard
from testbed.logs.table import TableColumn

if TYPE_CHECKING:
    from pathlib import Path


def open_npy(path: Path) -> ArrayTable:
    """Return the columns of an npy file: of a vector, a matrix or a record array.

    Raises
    ------
    ScenarioError
        If it is damaged, or holds Python objects.
    """
    with damage_refused(path, "npy"):
        data = np.load(path, mmap_mode="r", allow_pickle=False)
    table = ArrayTable(path, "npy")
    table.add_array(TableColumn(""), data)
    return table


def open_npz(path: Path) -> ArrayTable:
    """Return the arrays of an npz file, those of one sample as what the file says beside them.

    Raises
    ------
    ScenarioError
        If it is damaged, holds Python objects, or claims far more than it can hold.
    """
    table = ArrayTable(path, "npz")
    with damage_refused(path, "npz"):
        with zipfile.ZipFile(path) as archive:
            members = [info for info in archive.infolist() if info.filename.endswith(".npy")]
            guard(path, "npz", sum(info.file_size for info in members))
        content = np.load(path, allow_pickle=False)
        for name in content.files:
            _add(table, name, content[name])
    return table


def _add(table: ArrayTable, name: str, data: Any) -> None:
    if data.size == 1:
        table.header[name] = str(data.item())
    else:
        table.add_array(TableColumn(name), data)


def open_netcdf3(path: Path) -> ArrayTable:
    """Return the numeric variables of a NetCDF 3 file.

    Raises
    ------
    ScenarioError
        If it is damaged.
    """
    from scipy.io import netcdf_file

    with damage_refused(path, "NetCDF 3"):
        file = netcdf_file(path, mmap=False, maskandscale=False)
    table = ArrayTable(path, "NetCDF 3")
    for name, variable in file.variables.items():
        data = np.asarray(variable.data)
        unit = getattr(variable, "units", b"")
        if data.size == 1:
            table.header[name] = str(data.item())
        else:
            native = data.astype(data.dtype.newbyteorder("="))
            table.add_array(
                TableColumn(name, unit.decode(errors="replace") if isinstance(unit, bytes) else str(unit)), native
            )
    return table
