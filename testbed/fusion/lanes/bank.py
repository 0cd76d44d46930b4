"""Banks of filters under many seeds: as many covariances as there are different ones, many states."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.fusion.kernels.covariance import LOST_VARIANCE
from testbed.fusion.lanes.bank_source import BankSource, bank_source
from testbed.fusion.lanes.covariance_source import noise_names
from testbed.fusion.lanes.module import module_of
from testbed.fusion.lanes.pack import Buffers, block_of, codes_of, padded, pattern_of
from testbed.fusion.lanes.source import LANES

if TYPE_CHECKING:
    from collections.abc import Sequence

    from testbed.fusion.base import EstimateBlock
    from testbed.fusion.filters.wideband import Wideband
    from testbed.fusion.lanes.pack import Received
    from testbed.signals import FloatArray

# What the kernel finds, and whether for each sensor.
_FOUND = {"rate": False, "std": False, "innovation": True, "variance": True}
# Steps that are worked on at a time.
_PART = 256
# Under fewer seeds, lanes that nobody needs cost what the others save.
FEWEST = LANES // 2
# The more share a covariance, the less each of them costs; beyond, their states leave the processor's second cache.
BANKS_AT_ONCE = 4 * LANES


class BankLanes:
    """Banks side by side as long as none has a gap of its own.

    Filters that start again at the same step from one covariance have one covariance from then on; so the more seeds
    there are, the fewer covariances each of them costs.

    Parameters
    ----------
    example : Wideband
        One of them.
    buffers : Buffers
        For their estimates.
    """

    def __init__(self, example: Wideband, buffers: Buffers) -> None:
        pattern = pattern_of(example)
        self._source = bank_source(pattern, example.model.n_slow, len(example._score))
        self._together = {sum(1 << i for i in together) for together in pattern.together}
        self._buffers = buffers

    def advance(self, filters: Sequence[Any], received: Received, whole: Sequence[int]) -> dict[int, EstimateBlock]:
        """Advance those filters of `whole` that have begun alike and do not lose the rate at once, and return their
        estimates by number; none if they are fewer than FEWEST.

        Parameters
        ----------
        filters : sequence of Wideband
            In the state that the last block left.
        received : sequence of tuple of ndarray
            Of each what `BlockFilter.received` returns.
        whole : sequence of int
            Numbers of the filters that miss no reading.
        """
        begun = [m for m in whole if filters[m]._setting[0] == filters[whole[0]]._setting[0]]
        alike = [m for m in begun if not _loses_rate(filters[m])]
        if len(alike) < FEWEST:
            return {}
        due = np.isfinite(received[alike[0]][0])
        if not self._together.issuperset(codes_of(due)):
            return {}
        banks = Banks([filters[m] for m in alike], self._source)
        found, lanes = self._buffers.of(due, 0, len(alike), _FOUND), in_packs(alike)
        for begin in range(0, due.shape[1], _PART):
            part = slice(begin, begin + _PART)
            Z = np.stack([received[m][0][:, part] for m in lanes], axis=2)
            banks.run(due[:, part], Z, {name: array[..., part] for name, array in found.items()})
        done = {}
        for j, m in enumerate(alike):
            if banks.hold(j):
                banks.leave(j, filters[m], due)
                rate, std, innovation, variance = (array[j] for array in found.values())
                done[m] = block_of(filters[m], rate, std, innovation, variance, received[m][1])
        return done


class Banks:
    """States and covariances of banks over a block, as the kernel takes them.

    Parameters
    ----------
    filters : sequence of Wideband
        In the state that the last block left.
    source : BankSource
        Of the kernel.
    """

    def __init__(self, filters: Sequence[Wideband], source: BankSource) -> None:
        one = self._one = filters[0]
        self._names = source.bank.names
        self._kernel = module_of(source.text).run
        n, M = one._x.shape
        self._half, core = np.tril_indices(n), n - one.model.n_slow
        self._noise = one._Q[np.tril_indices(core)].T.copy()
        in_lanes = [filters[j] for j in in_packs(range(len(filters)))]
        packs = (len(in_lanes) // LANES, LANES)
        # Of each pack its filters, of each filter its rows, of each row the lanes.
        self._W = np.zeros((packs[0], M, len(self._names), LANES))
        states = np.stack([one._x for one in in_lanes]).reshape(*packs, n, M)
        self._W[:, :, :n] = np.moveaxis(states, (1, 3), (3, 1))
        scores = np.stack([one._score for one in in_lanes]).reshape(*packs, M)
        self._W[:, :, self._names.index("score")] = np.swapaxes(scores, 1, 2)
        self._setting, self._beyond, self._widest = one._setting.copy(), np.zeros(packs), 0.0
        self._share(in_lanes, source, len(noise_names(core)))

    def _share(self, in_lanes: Sequence[Wideband], source: BankSource, n_noise: int) -> None:
        """Give filters whose covariance is the same, bit for bit, one covariance."""
        M, kept = len(self._noise), len(self._half[0])
        self._of = np.empty((len(self._W), M, LANES), dtype=np.int64)
        known: dict[tuple[int, bytes], int] = {}
        for j, one in enumerate(in_lanes):
            for m, half in enumerate(np.ascontiguousarray(one._P[self._half].T)):
                self._of[j // LANES, m, j % LANES] = known.setdefault((m, half.tobytes()), len(known))
        # One for each filter at the most, and a pack for heirs, who are there before what they had is let go.
        C = np.zeros((len(self._W) * M + 1, len(source.of_covariance), LANES))
        for c, (m, half) in enumerate(known):
            C[c // LANES, :kept, c % LANES] = np.frombuffer(half)
            C[c // LANES, kept : kept + n_noise, c % LANES] = self._noise[m]
        n_place = len(C) * LANES
        self._C, self._G = C, np.zeros((n_place, source.shown))
        self._users = np.bincount(self._of.ravel(), minlength=n_place)
        self._live = (self._users.reshape(-1, LANES) > 0).sum(axis=1)
        self._even = (self._of == self._of[:, :, :1]).all(axis=2)
        self._child = np.full((n_place, M, 2), -1)
        self._counted = np.array([0, len(known)])

    def run(self, due: Any, Z: FloatArray, found: dict[str, FloatArray]) -> None:
        """Advance over a part of a block.

        Parameters
        ----------
        due : ndarray of bool, shape (n_sensor, n_time)
            Which readings there are.
        Z : ndarray, shape (n_sensor, n_time, n_lane)
            Readings in the lanes of all packs [rad/s].
        found : dict of str to ndarray
            Where the estimates go, as `Buffers` has them.
        """
        one, model, packs = self._one, self._one.model, len(self._W)
        n_sensor, n_time = due.shape
        z = np.ascontiguousarray(Z.reshape(n_sensor, n_time, packs, LANES).transpose(1, 2, 0, 3))
        rooms = [np.empty((n_time, *([n_sensor] if each else []), packs, LANES)) for each in _FOUND.values()]
        widest = self._kernel(
            *(model.F, model.H, model.Q, one._R, self._setting),
            *(self._C.reshape(len(self._C), -1), self._G, self._noise),
            *(self._W.reshape(packs, -1), self._of, self._even),
            *(self._child, self._users, self._live, self._counted),
            *(np.ascontiguousarray(due.T), z, tuple(rooms), self._beyond),
        )
        self._setting[0], self._widest = 1.0, max(self._widest, widest)
        for array, room in zip(found.values(), rooms, strict=True):
            by_lane = room.reshape(*room.shape[:-2], -1)[..., : len(array)]
            if array.ndim == 2:
                array[:] = by_lane.T
            else:
                for i, at in enumerate(due):
                    array[:, i, at] = by_lane[at, i].T

    def hold(self, j: int) -> bool:
        """Return whether what was found for a bank is what it finds alone: its gate let all readings in, and no rate
        got lost, which it would have recalled.
        """
        return bool(self._beyond[j // LANES, j % LANES] <= 0.0 and self._widest <= LOST_VARIANCE)

    def leave(self, j: int, one: Wideband, due: Any) -> None:
        """Leave a bank at the end of the block.

        Parameters
        ----------
        j : int
            Its number.
        one : Wideband
            The bank.
        due : ndarray of bool, shape (n_sensor, n_time)
            Which readings there were.
        """
        pack, lane = divmod(j, LANES)
        W, of = self._W[pack, :, :, lane], self._of[pack, :, lane]
        one._x[:], one._score[:] = W[:, : len(one._x)].T, W[:, self._names.index("score")]
        one._P[self._half] = self._C[of // LANES, : len(self._half[0]), of % LANES].T
        one._watch[due.any(axis=1), 0] = 0.0
        one._setting[0] = self._setting[0]


def _loses_rate(one: Wideband) -> bool:
    """Return whether the next step makes the variance of a rate so large that the kernel recalls it: after a gap; or in
    every step, where the fastest filters expect more between two readings than there can be.
    """
    row = one.model.F[0]
    seen = np.flatnonzero(row)
    terms = (row[i] * row[j] * one._P[max(i, j), min(i, j)] for i in seen for j in seen)
    return bool(one._setting[0] > 0.0 and (sum(terms) + one._Q[0, 0]).max() > LOST_VARIANCE)


def in_packs(members: Sequence[int]) -> list[int]:
    """Return members for all lanes of as many packs as they need.

    Parameters
    ----------
    members : sequence of int
        Numbers.
    """
    return [m for k in range(0, len(members), LANES) for m in padded(members[k : k + LANES])]
