"""What the lanes of every filter share: packs of a fixed number, their buffers, and the rows of W."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.fusion.base import EstimateBlock
from testbed.fusion.lanes.source import LANES, Pattern

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from testbed.fusion.base import Received as Block
    from testbed.fusion.model_filter import ModelFilter
    from testbed.signals import FloatArray

    Received = Sequence[Block]


def packs(members: Sequence[int]) -> list[list[int]]:
    """Return the members in packs of at most LANES.

    Parameters
    ----------
    members : sequence of int
        Numbers of filters.
    """
    return [list(members[k : k + LANES]) for k in range(0, len(members), LANES)]


def padded(pack: Sequence[int]) -> list[int]:
    """Return a pack of LANES, the last member standing for those that lack."""
    return [*pack, *[pack[-1]] * (LANES - len(pack))]


def pattern_of(one: ModelFilter) -> Pattern:
    """Return where the matrices of a filter are not zero."""
    F, H = (tuple(tuple(np.flatnonzero(row).tolist()) for row in matrix) for matrix in (one._F, one._H))
    return Pattern(F, H)


class Buffers:
    """Arrays of a block that are used again, NaN where nothing was written.

    Parameters
    ----------
    shapes : mapping of str to tuple of int
        By name; the time is where the 0 stands.
    """

    def __init__(self, shapes: Mapping[str, tuple[int, ...]]) -> None:
        self._shapes, self._due = dict(shapes), np.zeros((0, 0), dtype=np.bool_)
        self._arrays: dict[str, FloatArray] = {}

    def of(self, due: Any) -> dict[str, FloatArray]:
        """Return the arrays for readings that are `due`, shape (n_sensor, n_time)."""
        if not np.array_equal(due, self._due):
            self._due = due.copy()
            self._arrays = {
                name: np.full([size or due.shape[1] for size in shape], np.nan) for name, shape in self._shapes.items()
            }
        return self._arrays


def block_of(
    one: ModelFilter, rate: FloatArray, std: FloatArray, innovation: FloatArray, variance: FloatArray, gated: FloatArray
) -> EstimateBlock:
    """Return the estimate of a lane with the diagnostics that its judge looks at.

    Parameters
    ----------
    one : ModelFilter
        Whose it is.
    rate, std : ndarray, shape (n_time,)
        Estimate and claim [rad/s].
    innovation, variance, gated : ndarray, shape (n_sensor, n_time)
        Innovations [rad/s], their variances [rad^2/s^2], counts of the gate.
    """
    shown = {}
    for i, name in enumerate(one.schedule.sensors):
        shown[f"innovation_{name}"], shown[f"innovation_variance_{name}"] = innovation[i], variance[i]
        shown[f"gated_{name}"] = gated[i]
    return EstimateBlock(rate, std, shown)


def by_lane(values: FloatArray) -> FloatArray:
    """Return an array whose last axis is the lane with that axis first, each lane's values side by side."""
    moved: FloatArray = np.moveaxis(values, -1, 0).copy()
    return moved
