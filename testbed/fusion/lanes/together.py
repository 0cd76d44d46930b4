"""One filter under many seeds: as many at a time as can, each with the bits that it has alone.

This room is a friend of the filters that it advances: it reads and writes their states.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from testbed.fusion.filters.kalman import Kalman
from testbed.fusion.filters.shakf import SageHusa
from testbed.fusion.filters.steady_state import SteadyState
from testbed.fusion.filters.wideband import Wideband
from testbed.fusion.kernels.covariance import JOSEPH
from testbed.fusion.lanes.adaptive import AdaptiveLanes
from testbed.fusion.lanes.bank import BANKS_AT_ONCE, BankLanes
from testbed.fusion.lanes.pack import Buffers
from testbed.fusion.lanes.settling import SettlingGains
from testbed.fusion.lanes.shared import KalmanGains, SharedLanes
from testbed.fusion.lanes.source import LANES

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from testbed.fusion.base import BlockFilter, EstimateBlock
    from testbed.fusion.lanes.pack import Received
    from testbed.fusion.model_filter import ModelFilter


class Together:
    """Filters of one kind and setting under several seeds.

    In each block, those whose readings are all there go side by side in lanes. A filter that misses a reading, whose
    gate fires, or whose past is another than that of the rest, takes the block alone; it may be back in the next one.

    Parameters
    ----------
    example : BlockFilter
        One of them.
    buffers : Buffers, optional
        Shared with other kinds whose estimates are not needed at the same time; else these have their own.
    """

    def __init__(self, example: BlockFilter, buffers: Buffers | None = None) -> None:
        self._lanes: SharedLanes | AdaptiveLanes | BankLanes | None = None
        buffers = buffers or Buffers()
        if isinstance(example, Kalman) and _plain(example):
            self._lanes = SharedLanes(example, KalmanGains, buffers)
        elif isinstance(example, SteadyState):
            self._lanes = SharedLanes(example, SettlingGains, buffers)
        elif isinstance(example, SageHusa) and _plain(example) and _adapts_only_R(example):
            self._lanes = AdaptiveLanes(example, buffers)
        elif isinstance(example, Wideband) and _plain(example):
            self._lanes = BankLanes(example, buffers)

    @property
    def in_lanes(self) -> bool:
        """Whether they can go side by side."""
        return self._lanes is not None

    @property
    def at_once(self) -> int:
        """How many of them side by side go fastest."""
        return BANKS_AT_ONCE if isinstance(self._lanes, BankLanes) else LANES

    def process(self, filters: Sequence[BlockFilter], received: Received) -> Iterator[EstimateBlock]:
        """Yield what each filter gives for its readings of a block; it holds until the next one of those that share
        the buffers. All of them are to be taken: a filter that goes alone works when it is its turn, so that no more
        than one estimate of such is there at a time.

        Parameters
        ----------
        filters : sequence of BlockFilter
            Some of them; they go on from where they are.
        received : sequence of tuple of ndarray
            Of each what its `BlockFilter.received` returns, or that of another filter with an equal `front`.
        """
        done: dict[int, EstimateBlock] = {}
        if self._lanes is not None:
            whole = [m for m, (Z, _, timing) in enumerate(received) if timing is None and not np.isinf(Z).any()]
            done = self._lanes.advance(filters, received, whole)
        return (done[m] if m in done else one.estimated(*received[m]) for m, one in enumerate(filters))


def _plain(one: ModelFilter) -> bool:
    """Return whether the recursion is the one that the lanes have: Joseph's form in double precision."""
    return one._form == JOSEPH and one._x.dtype == np.float64


def _adapts_only_R(one: SageHusa) -> bool:
    return not one._chosen.any() and not one._sensors["adapt_offset"].any() and not one._sensors["follow"].any()
