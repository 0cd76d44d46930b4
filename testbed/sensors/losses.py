"""Readings that are lost in bursts, as by a bus or a radio link."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from testbed.parts import Part
from testbed.units import PositiveDuration

if TYPE_CHECKING:
    from testbed.signals import FloatArray


class Bursts(Part):
    """Spans of lost readings at random: both their distances and their lengths are exponential.

    Parameters
    ----------
    every : float
        Mean time from the end of one to the begin of the next [s].
    length : float
        Mean length [s]; at least one reading is lost.
    """

    every: PositiveDuration
    length: PositiveDuration


class Losses(Part):
    """How readings of an instrument are lost.

    Parameters
    ----------
    bursts : Bursts
        Spans at random.
    """

    bursts: Bursts


class LossStage:
    """Lost readings in time, behind everything else that an instrument does.

    Parameters
    ----------
    losses : Losses, optional
        None loses nothing.
    sample_rate_hz : float
        Rate of the readings [Hz].
    stream : numpy.random.Generator
        Source of the spans.
    """

    def __init__(self, losses: Losses | None, sample_rate_hz: float, stream: np.random.Generator) -> None:
        self._losses, self._rate, self._stream = losses, sample_rate_hz, stream
        self._lost, self._left = True, 0

    def process(self, readings: FloatArray) -> FloatArray:
        """Return the readings of the next block as they arrive [rad/s], NaN where one is lost."""
        if self._losses is None or not readings.size:
            return readings
        given, at = readings.copy(), 0
        while at < given.size:
            if self._left == 0:
                self._lost = not self._lost
                mean = self._losses.bursts.length if self._lost else self._losses.bursts.every
                self._left = max(round(mean * self._rate * self._stream.standard_exponential()), 1)
            n = min(self._left, given.size - at)
            if self._lost:
                given[at : at + n] = np.nan
            self._left, at = self._left - n, at + n
        return given
