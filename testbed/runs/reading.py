"""Reading run.nc: every group as signals that are read when they are asked for."""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np

from testbed.errors import Problem, ScenarioError
from testbed.runs.netcdf import STAMPED
from testbed.runs.signals import Signals

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from testbed.signals import FloatArray


def read_groups(path: Path) -> dict[str, Signals]:
    """Return the signals of every group of a ``run.nc``, by the path of the group as in ``fusion/kalman``.

    Parameters
    ----------
    path : Path
        The file.

    Raises
    ------
    ScenarioError
        If it is missing, no complete NetCDF-4 file, or the time of a group is not uniform from zero.
    """
    groups: dict[str, Signals] = {}
    with _opened(path) as file:
        for name, node in _nodes(file):
            units = {key: _text(item.attrs.get("units", "")) for key, item in node.items() if _is_signal(item)}
            if "time" not in units:
                raise _bad(path, f"{name}/time", "expected the coordinate time, got none")
            n_time = int(node["time"].shape[0])
            for key in units:
                if node[key].shape != (n_time,):
                    raise _bad(path, f"{name}/{key}", f"expected {n_time} samples along time, got {node[key].shape}")
            rate, stamped = _sample_rate(path, f"{name}/time", node), STAMPED in node.attrs
            groups[name] = Signals(units, rate, n_time, _InFile(path, name), stamped=stamped)
    return groups


@dataclass(frozen=True)
class _InFile:
    """Samples of a group of a NetCDF-4 file, which is open only while they are read."""

    path: Path
    group: str

    def __call__(self, name: str, rows: slice) -> FloatArray:
        with _opened(self.path) as file:
            values: FloatArray = file[f"{self.group}/{name}"][rows]
        return values


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """Open the file; what is wrong with it, also further inside, is a ScenarioError."""
    try:
        with h5py.File(path, "r") as file:
            yield file
    except OSError as error:
        raise _bad(path, "", f"expected a complete NetCDF-4 file, got: {error}") from error


def _nodes(file: Any) -> list[tuple[str, Any]]:
    """Return the groups that hold signals."""
    found: list[tuple[str, Any]] = []

    def visit(name: str, node: Any) -> None:
        if isinstance(node, h5py.Group) and any(map(_is_signal, node.values())):
            found.append((name, node))

    file.visititems(visit)
    return found


def _is_signal(item: Any) -> bool:
    return isinstance(item, h5py.Dataset)


def _sample_rate(path: Path, key: str, node: Any) -> float:
    """Return the rate that the group states, held against its time, unless that is stamps of a recording; of a file
    that states none, that of its time.
    """
    time, stated = node["time"], node.attrs.get("sample_rate_hz")
    n = int(time.shape[0])
    if n < (1 if stated is not None else 2):
        raise _bad(path, key, f"expected samples, and two of them or their sample_rate_hz, got {n}")
    first, last = float(time[0]), float(time[-1])
    if STAMPED in node.attrs:
        return float(np.ravel(stated)[0])
    if first != 0.0 or not (last > 0.0 or n == 1):
        raise _bad(path, key, f"expected time from 0 s on, increasing, got {first} s to {last} s")
    rate = (n - 1) / last if stated is None else float(np.ravel(stated)[0])
    # A drift of half a sample over the run is no rounding.
    if abs(rate * last - (n - 1)) > 0.5:
        raise _bad(path, key, f"expected samples at the stated {rate:g} Hz, got {(n - 1) / last:g} Hz")
    return rate


def _text(attribute: Any) -> str:
    return attribute.decode() if isinstance(attribute, bytes) else str(attribute)


def _bad(path: Path, key: str, message: str) -> ScenarioError:
    return ScenarioError([Problem(message, key=key, file=str(path))])
