"""The analogue-to-digital converter: range, word, and the noise of rounding."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from testbed.signals import FloatArray


def rounding_psd(step: float, sample_rate_hz: float) -> float:
    """Return the two-sided density step^2 / (12 fs) [rad^2/s] of rounding to `step` [rad/s] at fs [Hz]."""
    return step**2 / 12.0 / sample_rate_hz


class Converter:
    """Range and word of an analogue-to-digital converter in units of the reading.

    Parameters
    ----------
    step : float
        One count [rad/s].
    bits : int
        Word length, two's complement [-].
    limit : float
        Range, symmetric [rad/s].
    rounding : bool
        Off: the range alone.
    """

    def __init__(self, step: float, bits: int, limit: float, *, rounding: bool) -> None:
        self._step, self._limit, self._rounding = step, limit, rounding
        self._lowest, self._highest = -(2 ** (bits - 1)), 2 ** (bits - 1) - 1

    def process(self, rate: FloatArray) -> FloatArray:
        """Return the converted readings [rad/s]; NaN stays NaN."""
        held: FloatArray = np.clip(rate, -self._limit, self._limit)
        if not self._rounding:
            return held
        counts: FloatArray = np.clip(np.rint(held / self._step), self._lowest, self._highest)
        return counts * self._step
