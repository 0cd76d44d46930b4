"""run.nc: every signal of a run as NetCDF-4, written block by block.

Compression is where it earns its time: of diagnostics, which often stay the same or are undefined, of the times, and of
what stands still in the first block.
The digits of a rate are noise: of them it would take a quarter, for as much time as all else.
"""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

import h5netcdf
import h5py
import numpy as np

from testbed.runs.attributes import attributes, is_precise
from testbed.runs.block import clock_of, columns

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from testbed.runs.block import PlayedBlock, RunBlock
    from testbed.signals import FloatArray

_CHUNK = 20_000
# Of each signal the piece that is being written stays in memory [bytes]: HDF5 would keep 8 MB of each.
_KEPT = 2 * 8 * _CHUNK
# Attribute of a group whose `time` is no multiple of one step.
STAMPED = "stamps"
_PACKED = {"compression": "gzip", "compression_opts": 1, "shuffle": True}


class _ShieldedFile(io.FileIO):
    """A file whose failures HDF5 never sees: it crashes the process when a write fails while it closes. `error` is the
    first one.
    """

    error: OSError | None = None

    def write(self, data: Any) -> int:
        view = memoryview(data).cast("B")
        done = 0
        try:
            while self.error is None and done < view.nbytes:
                done += super().write(view[done:])
        except OSError as error:
            self.error = error
        return int(view.nbytes)

    def truncate(self, size: int | None = None) -> int:
        try:
            return super().truncate(size)
        except OSError as error:
            self.error = self.error or error
            return size or 0

    def check(self) -> None:
        """Raise the first failure."""
        if self.error is not None:
            raise self.error


class NetcdfStore:
    """Writes every signal of a run to run.nc (NetCDF-4), block by block.

    Rates and angles are float64, diagnostics float32; every group has the coordinate `time` in seconds.

    Parameters
    ----------
    path : Path
        The file.
    rates : mapping
        Sample rate [Hz] of ``base`` and of every sensor and filter by its name.
    duration : float
        Length of the run [s].
    attributes : mapping
        Provenance, written as global attributes.
    times : mapping of str to ndarray, shape (n_time,), optional
        Where clocks have no whole ratio: the stamps [s] of sensors, and of ``base``, that do not come at k / rate.

    Raises
    ------
    OSError
        From `write` and `close`, if the disk is full or the file cannot be written.
    """

    def __init__(
        self,
        path: Path,
        rates: Mapping[str, float],
        duration: float,
        attributes: Mapping[str, Any],
        times: Mapping[str, FloatArray] | None = None,
    ) -> None:
        self._rates, self._times = rates, times
        self._n_base = round(duration * rates["base"])
        self._raw = _ShieldedFile(path, "w+")
        self._hdf = h5py.File(self._raw, "w", track_order=True, rdcc_nbytes=_KEPT)
        self._file = h5netcdf.File(self._hdf, "w")
        # As HDF5 has them: looking up a variable takes longer than writing it.
        self._datasets: dict[tuple[str, str], h5py.Dataset] = {}
        for name, value in attributes.items():
            self._file.attrs[name] = value

    def write(self, block: RunBlock | PlayedBlock) -> None:
        """Append a block."""
        for group, name, start, rate, values in columns(block, self._rates):
            if (group, name) not in self._datasets:
                self._create(group, name, rate, still=values.size > 0 and float(np.ptp(values)) == 0.0)
            if values.size:
                self._datasets[group, name][start : start + values.size] = values
        self._raw.check()

    def close(self) -> None:
        """Finish the file; OSError if anything could not be written."""
        if not self._raw.closed:
            self._file.close()
            self._hdf.close()
            self._raw.close()
            self._raw.check()

    def _create(self, group: str, name: str, rate: float, *, still: bool) -> None:
        stamps = None if self._times is None else self._times.get(clock_of(group))
        n = -(-self._n_base // round(self._rates["base"] / rate)) if stamps is None else stamps.size
        node = self._group(group)
        if "time" not in node.variables:
            node.dimensions["time"] = n
            time = self._variable(node, group, "time", n, packed=True)
            for start in range(0, n, _CHUNK):
                stop = min(start + _CHUNK, n)
                time[start:stop] = np.arange(start, stop) / rate if stamps is None else stamps[start:stop]
            node.attrs["sample_rate_hz"] = rate
            if stamps is not None:
                node.attrs[STAMPED] = "as recorded"
        self._datasets[group, name] = self._variable(node, group, name, n, packed=still or not is_precise(name))

    def _group(self, path: str) -> Any:
        node = self._file
        for name in path.split("/"):
            node = node.groups[name] if name in node.groups else node.create_group(name)
        return node

    def _variable(self, node: Any, group: str, name: str, n: int, *, packed: bool) -> h5py.Dataset:
        variable = node.create_variable(
            name,
            ("time",),
            np.float64 if is_precise(name) else np.float32,
            chunks=(min(_CHUNK, n),),
            **(_PACKED if packed else {}),
            fillvalue=np.nan,
        )
        for key, value in attributes(group, name).items():
            variable.attrs[key] = value
        return self._hdf[f"{group}/{name}"]
