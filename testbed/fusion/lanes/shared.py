"""Filters that differ in their readings alone: one covariance, many states."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.fusion.kernels.covariance import LOST_VARIANCE, gains_kernel
from testbed.fusion.lanes.module import module_of
from testbed.fusion.lanes.pack import Buffers, block_of, codes_of, packs, padded, pattern_of
from testbed.fusion.lanes.shared_source import shared_source
from testbed.fusion.lanes.source import LANES

if TYPE_CHECKING:
    from collections.abc import Sequence

    from testbed.fusion.base import EstimateBlock
    from testbed.fusion.filters.kalman import Kalman
    from testbed.fusion.filters.steady_state import SteadyState
    from testbed.fusion.lanes.pack import Received
    from testbed.fusion.lanes.settling import SettlingGains
    from testbed.signals import FloatArray

# What the kernel finds, and whether for each sensor.
_FOUND = {"rate": False, "innovation": True}


class SharedLanes:
    """Filters with one covariance as long as none has a gap of its own.

    Parameters
    ----------
    example : Kalman or SteadyState
        One of them.
    kind : type
        What their gains are: `KalmanGains` or one like it.
    buffers : Buffers
        For their estimates.
    """

    def __init__(
        self, example: Kalman | SteadyState, kind: type[KalmanGains | SettlingGains], buffers: Buffers
    ) -> None:
        self._model, self._kind = example.model, kind
        pattern = pattern_of(example)
        source, self._rows = shared_source(pattern)
        self._together = {sum(1 << i for i in together) for together in pattern.together}
        self._run = module_of(source).run
        self._gains_of = gains_kernel(len(example._x), len(self._model.H), self._model.n_slow)
        self._buffers = buffers
        # Its place among what is kept; these lanes themselves would be a cycle, which lives until it is collected.
        self._place = object()

    def advance(self, filters: Sequence[Any], received: Received, whole: Sequence[int]) -> dict[int, EstimateBlock]:
        """Advance those filters of `whole` that have the same past, and return their estimates by number.

        Parameters
        ----------
        filters : sequence of Kalman or SteadyState
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
        gains = self._gains_for(first, due)
        alike = [m for m in whole if gains.hold(filters[m])] if gains.usable else []
        done: dict[int, EstimateBlock] = {}
        for number, pack in enumerate(packs(alike)):
            arrays = self._buffers.of(due, number, len(pack), _FOUND)
            done |= self._pack(filters, received, pack, gains, arrays)
        return done

    def _gains_for(self, first: Any, due: Any) -> KalmanGains | SettlingGains:
        """Return the covariance over the block, which other filters may have asked for already."""
        kept: dict[Any, KalmanGains | SettlingGains] = self._buffers.kept
        at = self._place
        if at not in kept or not (np.array_equal(due, kept[at].due) and kept[at].hold(first)):
            kept.pop(at, None)  # those of the last block make room
            kept[at] = self._kind(first, due, self._gains_of)
            kept[at].usable &= self._together.issuperset(codes_of(due))
        return kept[at]

    def _pack(
        self,
        filters: Sequence[Any],
        received: Received,
        pack: list[int],
        gains: KalmanGains | SettlingGains,
        arrays: dict[str, FloatArray],
    ) -> dict[int, EstimateBlock]:
        lanes, W = padded(pack), np.zeros((len(self._rows), LANES))
        n = len(self._model.F)
        W[:n] = np.stack([filters[m]._x for m in lanes], axis=1)
        Z = tuple(received[m][0] for m in lanes)
        of_gains = (gains.gains, gains.variance, gains.due, gains.started)
        self._run(self._model.F, self._model.H, W.ravel(), *of_gains, Z, *arrays.values())
        quiet = W[self._rows.index("beyond")] <= 0.0
        done = {}
        for lane, m in enumerate(pack):
            if quiet[lane]:
                gains.leave(filters[m], W[:n, lane])
                rate, innovation = (found[lane] for found in arrays.values())
                done[m] = block_of(filters[m], rate, gains.std, innovation, gains.shown, received[m][1])
        return done


class KalmanGains:
    """Gains, variances and covariance over a block, from a `Kalman` at its beginning.

    Parameters
    ----------
    one : Kalman
        That filter.
    due : ndarray of bool, shape (n_sensor, n_time)
        Which readings there are.
    kernel : callable
        Of `gains_kernel`.
    """

    def __init__(self, one: Kalman, due: Any, kernel: Any) -> None:
        n_sensor, n_time = due.shape
        self.due, self._before, self.started = due, one._P.copy(), one._started
        self.gains = np.empty((n_time, n_sensor, len(one._x)))
        self.variance, self.std = np.full((n_time, n_sensor), np.nan), np.empty(n_time)
        self._P = one._P.copy()
        model, out = (one._F, one._Q, one._H, one._R), (self.gains, self.variance, self.std)
        # A rate that gets lost is recalled, which the kernel of gains does not know.
        self.usable = kernel(self._P, *model, due, self.started, *out) <= LOST_VARIANCE
        self.shown = self.variance.T.copy()

    def hold(self, one: Kalman) -> bool:
        """Return whether they are those of another filter too, which had no reading outside the gate just before."""
        return not one._outside.any() and one._started == self.started and np.array_equal(one._P, self._before)

    def leave(self, one: Kalman, x: FloatArray) -> None:
        """Leave a filter at the end of the block, in the state `x`."""
        one._x[:], one._P[:] = x, self._P
        one._started = one._started or bool(self.due.any())
