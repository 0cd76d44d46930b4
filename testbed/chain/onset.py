"""Filters that do not see a run from its beginning: `fusion_from`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from testbed.fusion.base import EstimateBlock

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from testbed.fusion.checked import CheckedFilter
    from testbed.scenario.model import Scenario
    from testbed.signals import FloatArray

    Readings = Mapping[str, FloatArray]


class Onset:
    """Divides the readings of each block into those before `fusion_from` and those from there on.

    Parameters
    ----------
    scenario : Scenario
        Whose filters.
    """

    def __init__(self, scenario: Scenario) -> None:
        begin = scenario.frame.fusion_from
        self._left = {name: round(begin * sensor.sample_rate) for name, sensor in scenario.sensors.items()}

    def divide(self, readings: Readings) -> tuple[Readings, Readings]:
        """Return what of the next block a filter does not see, and what it sees [rad/s]."""
        unseen, seen = {}, {}
        for name, values in readings.items():
            n = min(self._left[name], values.size)
            self._left[name] -= n
            unseen[name], seen[name] = values[:n], values[n:]
        return unseen, seen


class LateFilter:
    """A filter that sees the readings from `fusion_from` on; until then its estimate is undefined.

    Parameters
    ----------
    inner : CheckedFilter
        The filter.
    waiting : CheckedFilter
        Another one like it, which tells what the filter would give until then.
    onset : Onset
        Divides the readings.
    """

    def __init__(self, inner: CheckedFilter, waiting: CheckedFilter, onset: Onset) -> None:
        self._inner, self._waiting, self._onset = inner, waiting, onset

    @property
    def untried_seconds(self) -> float:
        """As of the filter (`CheckedFilter`)."""
        return self._inner.untried_seconds

    def process(self, readings: Readings) -> EstimateBlock:
        """Return the estimate of the next block; arguments as `CheckedFilter.process`."""
        return self._divided(readings, self._inner.process)

    def tried(self, readings: Readings) -> EstimateBlock:
        """Return the estimate of the next block of a trial (`CheckedFilter.tried`)."""
        return self._divided(readings, self._inner.tried)

    def _divided(self, readings: Readings, estimated: Callable[[Readings], EstimateBlock]) -> EstimateBlock:
        unseen, seen = self._onset.divide(readings)
        parts = [_undefined(self._waiting.tried(unseen))] if longest(unseen) else []
        if longest(seen) or not parts:
            parts.append(estimated(seen))
        return joined(parts)


def longest(readings: Readings) -> int:
    """Return how many readings the fastest sensor has in a part of a block.

    Parameters
    ----------
    readings : mapping of str to ndarray, shape (n_due,)
        By sensor [rad/s].
    """
    return max(values.size for values in readings.values())


def joined(parts: Sequence[EstimateBlock]) -> EstimateBlock:
    """Return consecutive parts of a block as one.

    Parameters
    ----------
    parts : sequence of EstimateBlock
        At least one; the whole has the diagnostics of the last.
    """
    if len(parts) == 1:
        return parts[0]
    return EstimateBlock(
        np.concatenate([one.rate for one in parts]),
        np.concatenate([one.std for one in parts]),
        {name: np.concatenate([one.diagnostics[name] for one in parts]) for name in parts[-1].diagnostics},
    )


def _undefined(block: EstimateBlock) -> EstimateBlock:
    gone = np.full(block.rate.size, np.nan)
    return EstimateBlock(gone, gone, dict.fromkeys(block.diagnostics, gone))
