"""Rows that hold several samples of a sensor's queue, unrolled by their own spacing and scale."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.logs.table import TableColumn

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Mapping, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from testbed.logs.table import Block, Table

_SAMPLE = re.compile(r"(?P<axis>.+)\[(?P<place>\d+)\]")


def has_rows_of_samples(table: Table) -> bool:
    """Return whether each row of a table has a spacing ``dt``, a ``scale`` and samples such as ``x[0]``, ``x[1]``."""
    return bool(_groups(table))


class FifoTable:
    """A table whose rows hold several samples, seen sample by sample: ``x`` is ``scale`` times ``x[0]``, ``x[1]`` ...

    Parameters
    ----------
    inner : Table
        Rows with ``timestamp_sample`` or ``timestamp`` of the first sample [us], ``dt`` [us], ``scale``, ``samples``
        and the samples of each axis.
    """

    def __init__(self, inner: Table) -> None:
        self.inner = inner
        self.path: Path = inner.path
        self.format = f"{inner.format}; several samples a row"
        self.header: Mapping[str, str] = inner.header
        self._groups = _groups(inner)
        self.rows_of = {
            inner.columns[i].short: axis
            for group in self._groups.values()
            for axis, places in group["axes"].items()
            for i in places
        }
        self.columns: list[TableColumn] = []
        self._sources: list[tuple[str, str]] = []
        for group, found in self._groups.items():
            prefix = f"{group}/" if group else ""
            unit = "rad/s" if "gyro" in group else ""
            for axis in ("timestamp_sample", *found["axes"]):
                self.columns.append(TableColumn(f"{prefix}{axis}", "ns" if axis == "timestamp_sample" else unit, group))
                self._sources.append((group, axis))
        self._plain = [i for i, c in enumerate(inner.columns) if c.group not in self._groups]
        self.columns += [inner.columns[i] for i in self._plain]

    @property
    def notes(self) -> Sequence[str]:
        """What was left out."""
        return self.inner.notes

    def blocks(self, wanted: Sequence[int], stamps: Collection[int] = ()) -> Iterator[Block]:
        """Yield the wanted columns block by block, sample by sample."""
        first = len(self._sources)
        if all(i >= first for i in wanted):
            outer = {self._plain[i - first]: i for i in wanted}
            for block in self.inner.blocks(list(outer), [self._plain[i - first] for i in stamps]):
                yield {outer[i]: values for i, values in block.items()}
            return
        group = self._groups[self._sources[wanted[0]][0]]
        named = {i: self._sources[i][1] for i in wanted}
        places = [i for axis in named.values() for i in group["axes"].get(axis, [])]
        fixed = [group[key][0] for key in ("stamp", "dt", "scale")]
        for block in self.inner.blocks(list(dict.fromkeys([*fixed, *group["samples"], *places])), [fixed[0]]):
            yield {i: self._unrolled(block, group, axis) for i, axis in named.items()}

    def line(self, row: int) -> int | None:
        """Return the line of a sample's row."""
        n_samples = max(len(places) for places in next(iter(self._groups.values()))["axes"].values())
        return self.inner.line(row // n_samples)

    def _unrolled(self, block: Block, group: dict[str, Any], axis: str) -> NDArray[Any]:
        n_samples = max(len(places) for places in group["axes"].values())
        counts = (
            block[group["samples"][0]].astype(int)
            if group["samples"]
            else np.full(block[group["dt"][0]].size, n_samples)
        )
        held = np.arange(n_samples) < counts[:, None]
        if axis == "timestamp_sample":
            start = block[group["stamp"][0]].astype(np.int64) * 1000
            offsets = np.rint(1000.0 * block[group["dt"][0]][:, None] * np.arange(n_samples)).astype(np.int64)
            stamps: NDArray[Any] = (start[:, None] + offsets)[held]
            return stamps
        samples = np.stack([block[i] for i in group["axes"][axis]], axis=1)
        values: NDArray[Any] = (samples * block[group["scale"][0]][:, None])[held]
        return values


def _groups(table: Table) -> dict[str, dict[str, Any]]:
    """Return the places of the columns of each group whose rows hold several samples."""
    found: dict[str, dict[str, Any]] = {}
    for name in {column.group for column in table.columns}:
        members = {c.short: i for i, c in enumerate(table.columns) if c.group == name}
        axes: dict[str, list[int]] = {}
        for short, i in members.items():
            if match := _SAMPLE.fullmatch(short):
                axes.setdefault(match["axis"], []).append(i)
        axes = {axis: places for axis, places in axes.items() if len(places) > 1}
        stamp = [members[key] for key in ("timestamp_sample", "timestamp") if key in members]
        if axes and stamp and {"dt", "scale"} <= members.keys():
            samples = [members["samples"]] if "samples" in members else []
            found[name] = {
                "axes": axes,
                "stamp": stamp,
                "dt": [members["dt"]],
                "scale": [members["scale"]],
                "samples": samples,
            }
    return found
