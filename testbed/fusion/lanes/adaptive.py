"""Sage-Husa filters whose R adapts: a covariance per lane, counters in common."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.fusion.lanes.adaptive_source import adaptive_source
from testbed.fusion.lanes.module import module_of
from testbed.fusion.lanes.pack import Buffers, block_of, packs, padded, pattern_of
from testbed.fusion.lanes.source import LANES, MEMORY

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
        n = len(example._x)
        source, self._rows = adaptive_source(pattern_of(example))
        self._run = module_of(source).run
        self._half = np.tril_indices(n)
        # Of each element of P the one of the lower half that stands for it.
        self._whole = np.zeros((n, n), dtype=np.int64)
        self._whole[self._half] = self._whole.T[self._half] = np.arange(len(self._half[0]))
        own = n + len(self._half[0])
        self._states, self._covariance = slice(0, n), slice(n, own)
        self._memory = [own + len(MEMORY) * i for i in range(len(example._H))]
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
        counted = _counted(filters[whole[0]])
        alike = [m for m in whole if not filters[m]._sensors["outside"].any() and _counted(filters[m]) == counted]
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
        # Not by np.stack, which looks for a common type of records field by field.
        sensors = np.empty((len(self._memory), LANES), dtype=first._sensors.dtype)
        for lane, m in enumerate(lanes):
            sensors[:, lane] = filters[m]._sensors
        W[self._states] = np.stack([filters[m]._x for m in lanes], axis=1)
        W[self._covariance] = np.stack([filters[m]._P for m in lanes], axis=2)[self._half]
        for i, row in enumerate(self._memory):
            W[row : row + len(MEMORY)] = [sensors[i][name] for name in _OWN]
        windows = np.ascontiguousarray(np.stack([filters[m]._windows for m in lanes], axis=2))
        common, seen = first._sensors.copy(), np.isfinite(first._sensors["previous_reading"]).astype(np.int64)
        matrices = (first._F, first._Q, first._H)
        Z, started = tuple(received[m][0] for m in lanes), bool(first._progress[0] > 0.0)
        self._run(*matrices, W.ravel(), windows, common, seen, due, started, Z, *arrays.values())
        quiet = W[self._rows.index("beyond")] <= 0.0
        self._remember(W, common, sensors)
        P = W[self._covariance][self._whole]
        done = {}
        for lane, m in enumerate(pack):
            if quiet[lane]:
                one = filters[m]
                one._x[:], one._P[:], one._windows[:] = W[self._states, lane], P[:, :, lane], windows[:, :, lane]
                one._sensors[:] = sensors[:, lane]
                one._progress[0] = max(one._progress[0], float(due.any()))
                rate, std, innovation, variance = (found[lane] for found in arrays.values())
                done[m] = block_of(one, rate, std, innovation, variance, received[m][1])
        return done

    def _remember(self, W: FloatArray, common: np.ndarray, sensors: np.ndarray) -> None:
        """Write what a block left into the records of the sensors, shape (n_sensor, LANES)."""
        for i, row in enumerate(self._memory):
            for name, values in zip(_OWN, W[row : row + len(MEMORY)], strict=True):
                sensors[name][i] = values
            for name in _ALIKE:
                sensors[name][i] = common[i][name]


def _counted(one: SageHusa) -> tuple[Any, ...]:
    """Return what the lanes of a pack count alike."""
    begun = (np.isfinite(one._sensors[name]).tolist() for name in ("previous_reading", "previous_innovation"))
    return float(one._progress[0]), *begun, *(one._sensors[name].tolist() for name in _ALIKE)
