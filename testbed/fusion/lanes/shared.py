"""Kalman filters that differ in their readings alone: one covariance, many states."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.fusion.kernels.covariance import gains_kernel
from testbed.fusion.lanes.module import module_of
from testbed.fusion.lanes.pack import Buffers, block_of, packs, padded, pattern_of
from testbed.fusion.lanes.source import LANES, shared_source

if TYPE_CHECKING:
    from collections.abc import Sequence

    from testbed.fusion.base import EstimateBlock
    from testbed.fusion.filters.kalman import Kalman
    from testbed.fusion.lanes.pack import Received
    from testbed.signals import FloatArray


class SharedLanes:
    """Kalman filters with one covariance as long as none has a gap of its own.

    Parameters
    ----------
    example : Kalman
        One of them.
    """

    def __init__(self, example: Kalman) -> None:
        self._model, n_sensor = example, len(example._R)
        source, self._rows = shared_source(pattern_of(example))
        self._run = module_of(source).run
        self._gains_of = gains_kernel(len(example._x), n_sensor, example.model.n_slow)
        self._buffers = Buffers({"rate": False, "innovation": True})
        self._gains: _Gains | None = None

    def advance(self, filters: Sequence[Any], received: Received, whole: Sequence[int]) -> dict[int, EstimateBlock]:
        """Advance those filters of `whole` that have the same past, and return their estimates by number.

        Parameters
        ----------
        filters : sequence of Kalman
            In the state that the last block left.
        received : sequence of tuple of ndarray
            Of each what `BlockFilter.received` returns.
        whole : sequence of int
            Numbers of the filters that miss no reading.
        """
        if not whole:
            return {}
        first = filters[whole[0]]
        due = np.isfinite(received[whole[0]][0])
        alike = [m for m in whole if _alike(filters[m], first)]
        gains = self._gains_for(first, due)
        done: dict[int, EstimateBlock] = {}
        for number, pack in enumerate(packs(alike)):
            done |= self._pack(filters, received, pack, gains, self._buffers.of(due, number))
        return done

    def _gains_for(self, first: Kalman, due: Any) -> _Gains:
        """Return the covariance over the block, which other filters may have asked for already."""
        if self._gains is None or not self._gains.hold(first, due):
            self._gains = _Gains(first, due, self._gains_of)
        return self._gains

    def _pack(
        self,
        filters: Sequence[Any],
        received: Received,
        pack: list[int],
        gains: _Gains,
        arrays: dict[str, FloatArray],
    ) -> dict[int, EstimateBlock]:
        lanes, W = padded(pack), np.zeros((len(self._rows), LANES))
        W[: len(self._model._x)] = np.stack([filters[m]._x for m in lanes], axis=1)
        Z, before = tuple(received[m][0] for m in lanes), filters[pack[0]]._started
        of_gains = (gains.gains, gains.variance, gains.due)
        self._run(self._model._F, self._model._H, W.ravel(), *of_gains, before, Z, *arrays.values())
        quiet = W[self._rows.index("worst")] <= 1.0
        done = {}
        for lane, m in enumerate(pack):
            if quiet[lane]:
                one = filters[m]
                one._x[:], one._P[:] = W[: len(one._x), lane], gains.P
                one._started = one._started or bool(gains.due.any())
                rate, innovation = (found[lane] for found in arrays.values())
                done[m] = block_of(one, rate, gains.std, innovation, gains.shown, received[m][1])
        return done


class _Gains:
    """Gains, variances and covariance over a block, from a filter at its beginning."""

    def __init__(self, one: Kalman, due: Any, kernel: Any) -> None:
        n_sensor, n_time = due.shape
        self.due, self._P_before, self._started = due, one._P.copy(), one._started
        self.gains = np.empty((n_time, n_sensor, len(one._x)))
        self.variance, self.std = np.full((n_time, n_sensor), np.nan), np.empty(n_time)
        self.P = one._P.copy()
        kernel(self.P, one._F, one._Q, one._H, one._R, due, one._started, self.gains, self.variance, self.std)
        self.shown = self.variance.T.copy()

    def hold(self, one: Kalman, due: Any) -> bool:
        """Return whether they are those of another filter too."""
        return (
            one._started == self._started and np.array_equal(one._P, self._P_before) and np.array_equal(due, self.due)
        )


def _alike(one: Kalman, other: Kalman) -> bool:
    """Return whether two filters have the same covariance, and no reading outside the gate just before."""
    return not one._outside.any() and one._started == other._started and np.array_equal(one._P, other._P)
