"""HDF5: files of h5py, MATLAB 7.3 and NetCDF 4, a run's ``run.nc`` included."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.logs.readers.arrays import ArrayTable, damage_refused
from testbed.logs.table import TableColumn

if TYPE_CHECKING:
    from pathlib import Path

_UNITS = ("units", "unit", "Units", "Unit", "UNITS")


def open_hdf5(path: Path, kind: str) -> ArrayTable:
    """Return the numeric data sets of an HDF5 file.

    Parameters
    ----------
    path : Path
        The file; stays open as long as the table lives.
    kind : str
        What it is called: HDF5, MATLAB 7.3 or NetCDF 4.

    Returns
    -------
    ArrayTable
        Read as it is asked for.

    Raises
    ------
    ScenarioError
        If it is damaged.
    """
    import h5py

    with damage_refused(path, kind, OSError):
        file = h5py.File(path)
    table = ArrayTable(path, kind, header=_words(file))

    def visit(name: str, node: Any) -> None:
        if isinstance(node, h5py.Dataset) and not name.startswith("#"):
            _add(table, name, node)

    file.visititems(visit)
    return table


def _add(table: ArrayTable, name: str, data: Any) -> None:
    if data.size == 1 and data.dtype.kind in "iuf":
        table.header[name.rpartition("/")[2]] = str(np.ravel(data[()])[0])
        return
    table.header.update(_words(data, f"{name}."))
    unit = next((_text(data.attrs[key]) for key in _UNITS if key in data.attrs), "")
    table.add_array(TableColumn(name, unit, name.rpartition("/")[0]), _Scaled(data))


class _Scaled:
    """A data set with the scale, offset and fill value of its attributes applied, as NetCDF means them."""

    def __init__(self, data: Any) -> None:
        self._data, self.shape, self.dtype = data, data.shape, data.dtype
        self._scale, self._offset = (data.attrs.get(key) for key in ("scale_factor", "add_offset"))
        fill = data.attrs.get("_FillValue")
        self._fill = None if fill is None or np.size(fill) != 1 or fill != fill else np.ravel(fill)[0]  # noqa: PLR0124

    def __getitem__(self, key: Any) -> Any:
        values = self._data[key]
        if self._scale is None and self._offset is None and self._fill is None:
            return values
        numbers = values.astype(np.float64)
        if self._fill is not None and (values == self._fill).any():
            numbers[values == self._fill] = np.nan
        elif self._scale is None and self._offset is None:
            return values
        return numbers * (1.0 if self._scale is None else self._scale) + (self._offset or 0.0)


def _words(node: Any, prefix: str = "") -> dict[str, str]:
    found = {}
    for key, value in node.attrs.items():
        if np.size(value) == 1 and not isinstance(value, np.void) and np.asarray(value).dtype.kind in "iufSUO":
            found[f"{prefix}{key}"] = _text(value)
    return found


def _text(value: Any) -> str:
    one = np.ravel(value)[0]
    return one.decode(errors="replace") if isinstance(one, bytes) else str(one)
