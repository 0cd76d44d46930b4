"""Readings on the clock of what is read: every so many samples, beginning with the first."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from testbed.signals import FloatArray


def rate_ratio(input_rate_hz: float, sample_rate_hz: float) -> int:
    """Return the whole number of input samples per reading.

    Parameters
    ----------
    input_rate_hz, sample_rate_hz : float
        Rates of the input and of the readings [Hz].

    Returns
    -------
    int
        Their ratio [-].

    Raises
    ------
    ValueError
        If the ratio is no whole number of at least one.
    """
    ratio = round(input_rate_hz / sample_rate_hz)
    if not divides(input_rate_hz, sample_rate_hz):
        msg = f"sample_rate: expected {input_rate_hz:g} Hz over a whole number, got {sample_rate_hz:g} Hz"
        raise ValueError(msg)
    return ratio


def divides(input_rate_hz: float, sample_rate_hz: float) -> bool:
    """Return whether `rate_ratio` of these rates [Hz] is a whole number of at least one."""
    ratio = round(input_rate_hz / sample_rate_hz)
    return ratio >= 1 and abs(ratio * sample_rate_hz - input_rate_hz) <= 1e-9 * input_rate_hz


class Decimator:
    """Takes every `ratio`-th sample, beginning with the first, across blocks of any length."""

    def __init__(self, ratio: int) -> None:
        self._ratio, self._skip = ratio, 0

    def process(self, samples: FloatArray) -> FloatArray:
        """Return the samples of this block that the clock takes, unit of `samples`."""
        taken = samples[self._skip :: self._ratio]
        self._skip = (self._skip - samples.size) % self._ratio
        return taken
