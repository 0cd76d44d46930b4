"""Sage-Husa filters whose R adapts: a covariance per lane, counters in common."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.fusion.lanes.module import module_of
from testbed.fusion.lanes.pack import Buffers, block_of, packs, padded, pattern_of
from testbed.fusion.lanes.source import LANES, MEMORY, adaptive_source

if TYPE_CHECKING:
    from collections.abc import Sequence

    from testbed.fusion.base import EstimateBlock
    from testbed.fusion.filters.shakf import SageHusa
    from testbed.fusion.lanes.pack import Received
    from testbed.signals import FloatArray

# What of a SENSOR record a lane has for itself, in the order of MEMORY, and what all lanes count alike.
_OWN = (
    *("R", "lowest", "highest", "hits", "previous_innovation", "previous_reading"),
    *("increment_variance", "window_sum", "band"),
)
_ALIKE = ("power", "increments", "window_count")
# What the kernel finds, and whether for each sensor.
_FOUND = {"rate": False, "std": False, "innovation": True, "variance": True}


class AdaptiveLanes:
    """Sage-Husa filters side by side as long as none has a gap of its own.

    Parameters
    ----------
    example : SageHusa
        One of them.
    buffers : Buffers
        For their estimates.
    """

    def __init__(self, example: SageHusa, buffers: Buffers) -> None:
        self._model, n = example, len(example._x)
        source, self._rows = adaptive_source(pattern_of(example))
        self._run = module_of(source).run
        self._half = np.tril_indices(n)
        self._states, self._own = slice(0, n), n + len(self._half[0])
        self._buffers = buffers

    def advance(self, filters: Sequence[Any], received: Received, whole: Sequence[int]) -> dict[int, EstimateBlock]:
        """Advance those filters of `whole` that count alike, and return their estimates by number.

        Parameters
        ----------
        filters : sequence of SageHusa
            In the state that the last block left.
        received : sequence of tuple of ndarray
            Of each what `BlockFilter.received` returns.
        whole : sequence of int
            Numbers of the filters that miss no reading.
        """
        if not whole:
            return {}
        due = np.isfinite(received[whole[0]][0])
        alike = [m for m in whole if _alike(filters[m], filters[whole[0]])]
        done: dict[int, EstimateBlock] = {}
        for number, pack in enumerate(packs(alike)):
            arrays = self._buffers.of(due, number, len(pack), _FOUND)
            done |= self._pack(filters, received, pack, due, arrays)
        return done

    def _pack(
        self,
        filters: Sequence[Any],
        received: Received,
        pack: list[int],
        due: FloatArray,
        arrays: dict[str, FloatArray],
    ) -> dict[int, EstimateBlock]:
        lanes = padded(pack)
        first, W = filters[pack[0]], np.zeros((len(self._rows), LANES))
        for lane, m in enumerate(lanes):
            self._gather(filters[m], W[:, lane])
        windows = np.ascontiguousarray(np.stack([filters[m]._windows for m in lanes], axis=2))
        common, seen = first._sensors.copy(), np.isfinite(first._sensors["previous_reading"]).astype(np.int64)
        matrices = (first._F, first._Q, first._H)
        Z, started = tuple(received[m][0] for m in lanes), first._progress[0] > 0.0
        self._run(*matrices, W.ravel(), windows, common, seen, due, started, Z, *arrays.values())
        quiet = W[self._rows.index("worst")] <= 1.0
        done = {}
        for lane, m in enumerate(pack):
            if quiet[lane]:
                self._scatter(filters[m], W[:, lane], windows[:, :, lane], common)
                filters[m]._progress[0] = max(filters[m]._progress[0], float(due.any()))
                rate, std, innovation, variance = (found[lane] for found in arrays.values())
                done[m] = block_of(filters[m], rate, std, innovation, variance, received[m][1])
        return done

    def _gather(self, one: SageHusa, w: FloatArray) -> None:
        w[self._states], w[self._states.stop : self._own] = one._x, one._P[self._half]
        for i, record in enumerate(one._sensors):
            begin = self._own + len(MEMORY) * i
            w[begin : begin + len(MEMORY)] = [record[name] for name in _OWN]

    def _scatter(self, one: SageHusa, w: FloatArray, windows: FloatArray, common: np.ndarray) -> None:
        one._x[:] = w[self._states]
        one._P[self._half] = w[self._states.stop : self._own]
        one._P.T[self._half] = w[self._states.stop : self._own]
        one._windows[:] = windows
        for i, record in enumerate(one._sensors):
            begin = self._own + len(MEMORY) * i
            for name, value in zip(_OWN, w[begin : begin + len(MEMORY)], strict=True):
                record[name] = value
            for name in _ALIKE:
                record[name] = common[i][name]


def _alike(one: SageHusa, other: SageHusa) -> bool:
    """Return whether two filters have had as many readings, none of them outside the gate or missing just before."""
    a, b = one._sensors, other._sensors
    begun = [np.isfinite(x[name]) for x in (a, b) for name in ("previous_reading", "previous_innovation")]
    return (
        not a["outside"].any()
        and one._progress[0] == other._progress[0]
        and all(np.array_equal(a[name], b[name]) for name in _ALIKE)
        and all(np.array_equal(one, begun[0]) for one in begun)
    )
