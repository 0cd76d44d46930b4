"""What the lanes of every filter share: packs of a fixed number, their buffers, and the rows of W."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.fusion.base import EstimateBlock
from testbed.fusion.lanes.source import LANES, Pattern

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from testbed.fusion.base import BlockFilter
    from testbed.fusion.base import Received as Block
    from testbed.fusion.filters.steady_state import SteadyState
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


def pattern_of(one: ModelFilter | SteadyState) -> Pattern:
    """Return where the matrices of a filter are not zero, and when it is read."""
    F, H = (tuple(tuple(np.flatnonzero(row).tolist()) for row in matrix) for matrix in (one.model.F, one.model.H))
    return Pattern(F, H, one.schedule.strides)


def codes_of(due: Any) -> list[int]:
    """Return the sets of sensors that are read at one instant, as numbers in which sensor i has the bit i.

    Parameters
    ----------
    due : ndarray of bool, shape (n_sensor, n_time)
        Which readings there are.
    """
    found: list[int] = np.unique((1 << np.arange(len(due))) @ due).tolist()
    return found


class Buffers:
    """Arrays of a block, used again in the next one and by all filters that share them; NaN where nothing was written.

    What one filter leaves in them holds until the next one works, of the same block or of the next. Beside them stands
    what is `kept` for the same filters under further seeds.
    """

    def __init__(self) -> None:
        self._due = np.zeros((0, 0), dtype=np.bool_)
        self._arrays: dict[tuple[str, int], FloatArray] = {}
        self.kept: dict[Any, Any] = {}

    def of(self, due: Any, number: int, lanes: int, names: Mapping[str, bool]) -> dict[str, FloatArray]:
        """Return the arrays of a pack, shape (lanes, n_time) or (lanes, n_sensor, n_time).

        Parameters
        ----------
        due : ndarray of bool, shape (n_sensor, n_time)
            Which readings there are.
        number : int
            Of the pack.
        lanes : int
            How many of the pack are kept; the last ones of a padded pack are not.
        names : mapping of str to bool
            Which there are, and whether each sensor has one.
        """
        if not np.array_equal(due, self._due):
            self._due, self._arrays = due.copy(), {}
        shapes = {name: due.shape if many else due.shape[1:] for name, many in names.items()}
        return {name: self._one((name, number), lanes, shape) for name, shape in shapes.items()}

    def clear(self) -> None:
        """Let all of it go, where what comes next needs room and no lanes."""
        self._arrays, self.kept = {}, {}

    def _one(self, key: tuple[str, int], lanes: int, shape: tuple[int, ...]) -> FloatArray:
        known = self._arrays.get(key)
        if known is None or len(known) < lanes:
            known = self._arrays[key] = np.full((lanes, *shape), np.nan)
        return known[:lanes]


def block_of(
    one: BlockFilter, rate: FloatArray, std: FloatArray, innovation: FloatArray, variance: FloatArray, gated: FloatArray
) -> EstimateBlock:
    """Return the estimate of a lane with the diagnostics that its judge looks at.

    Parameters
    ----------
    one : BlockFilter
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
