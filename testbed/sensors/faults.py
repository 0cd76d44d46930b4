"""Faults of an instrument: spans in which its readings are lost, stand still, or lie at the end of the range."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Literal

import numpy as np

from testbed.parts import Part
from testbed.units import Duration, PositiveDuration

if TYPE_CHECKING:
    from collections.abc import Sequence

    from testbed.signals import FloatArray


class Fault(Part):
    """A span in which the readings are none; it begins with the first one at or after `at`.

    Parameters
    ----------
    kind : {"lost", "stuck", "rail"}
        The readings do not arrive (NaN), repeat the last one before the span, or stand at the upper end of the range.
    at : float
        Begin [s].
    length : float
        Up to before the reading at `at` + `length` [s].
    """

    kind: Literal["lost", "stuck", "rail"]
    at: Duration
    length: PositiveDuration

    @property
    def end(self) -> float:
        """End [s]."""
        return self.at + self.length


def first_overlap(faults: Sequence[Fault]) -> tuple[Fault, Fault] | None:
    """Return two faults of which the second begins before the first one ends, None if there are none.

    Parameters
    ----------
    faults : sequence of Fault
        In any order.
    """
    ordered = sorted(faults, key=lambda fault: fault.at)
    return next(((one, other) for one, other in pairwise(ordered) if other.at < one.end), None)


class FaultStage:
    """The faults of an instrument in time, behind everything else that it does.

    Parameters
    ----------
    faults : sequence of Fault
        They do not overlap.
    sample_rate_hz : float
        Rate of the readings [Hz]; reading j is at t = j / rate.
    full_scale : float
        Upper end of the range [rad/s].
    """

    def __init__(self, faults: Sequence[Fault], sample_rate_hz: float, full_scale: float) -> None:
        self._spans = [
            (fault.kind, _first_at(fault.at, sample_rate_hz), _first_at(fault.end, sample_rate_hz)) for fault in faults
        ]
        self._rail, self._done = full_scale, 0
        # The last reading of the block before, and the one that a stuck sensor repeats.
        self._last = self._held = np.nan

    def process(self, readings: FloatArray) -> FloatArray:
        """Return the readings of the next block as they arrive [rad/s]; a copy where there are faults at all.

        A sensor that is stuck from its first reading on repeats that one.
        """
        if not self._spans or not readings.size:
            return readings
        given = readings.copy()
        before = np.concatenate([[self._last if self._done else readings[0]], readings])
        for kind, begin, end in self._spans:
            first, stop = begin - self._done, end - self._done
            if 0 <= first < readings.size:
                self._held = before[first]
            value = {"lost": np.nan, "stuck": self._held, "rail": self._rail}[kind]
            given[max(first, 0) : max(stop, 0)] = value
        self._done += readings.size
        self._last = readings[-1]
        return given


def _first_at(time: float, sample_rate_hz: float) -> int:
    """Return the number of the first reading at or after a time; a millionth of a period is rounding."""
    return int(np.ceil(time * sample_rate_hz - 1e-6))
