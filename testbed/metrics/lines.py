"""Lines in the spectrum of a record of noise: what stands far above its neighbours."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.fft import rfft
from scipy.ndimage import median_filter

if TYPE_CHECKING:
    from testbed.signals import FloatArray

_LONGEST = 1 << 20
# Neighbours on each side that a level is the median of: a quarter of the bin's number, in these limits.
_WIDTHS = (10, 50)
# Bins below are left to drift; chance of a line in noise, and the margin for a level from few neighbours.
_FIRST, _CHANCE, _MARGIN = 40, 1e-5, 1.5
_MOST = 5


@dataclass(frozen=True)
class SpectralLine:
    """A line in a spectrum.

    Parameters
    ----------
    frequency_hz : float
        Where it stands [Hz].
    amplitude : float
        Of the sine, unit of the record.
    """

    frequency_hz: float
    amplitude: float


def spectral_lines(values: FloatArray, sample_rate_hz: float) -> list[SpectralLine]:
    """Return the lines that stand above the noise of a record, the strongest first.

    A bin of the Hann-windowed periodogram of white noise exceeds its level by x with the chance exp(-x); the level is
    the median of the neighbours. A record of noise shows a line once in 100 000.

    Parameters
    ----------
    values : ndarray, shape (n_time,)
        Even samples, NaN where one is lost, any unit; of a long record the last 2^20.
    sample_rate_hz : float
        Sample rate [Hz].

    Returns
    -------
    list of SpectralLine
        At most five.
    """
    record = values[-_LONGEST:]
    if record.size < 4 * _FIRST:
        return []
    record = np.where(np.isfinite(record), record - np.nanmean(record), 0.0)
    window = np.hanning(record.size)
    power = np.abs(rfft(record * window)) ** 2
    level = _level(power)
    threshold = _MARGIN * np.log(power.size / _CHANCE)
    inside = (np.arange(power.size) >= _FIRST) & (np.arange(power.size) < power.size - 2)
    above = np.flatnonzero((power > threshold * level) & inside & (level > 0.0))
    found: list[SpectralLine] = []
    for k in above[np.argsort(power[above])[::-1]]:
        near = np.arange(max(k - 2, 0), min(k + 3, power.size))
        line = _line(power, level, near, record.size, float(window @ window), sample_rate_hz)
        # The skirts of a line that is there already.
        if all(abs(line.frequency_hz - other.frequency_hz) > 0.02 * other.frequency_hz for other in found):
            found.append(line)
        if len(found) == _MOST:
            break
    return found


def _level(power: FloatArray) -> FloatArray:
    """Return the mean power of noise about each bin: the median of the neighbours over ln 2."""
    narrow, wide = (median_filter(power, 2 * width + 1, mode="mirror") for width in _WIDTHS)
    level: FloatArray = np.where(np.arange(power.size) < 4 * _WIDTHS[1], narrow, wide) / np.log(2.0)
    return level


def _line(
    power: FloatArray, level: FloatArray, near: np.ndarray, n_time: int, window_square: float, sample_rate_hz: float
) -> SpectralLine:
    """Return frequency and amplitude of the line in the bins `near`, by Parseval's theorem."""
    weight = np.maximum(power[near] - level[near], 0.0)
    frequency = float(weight @ near / weight.sum()) * sample_rate_hz / n_time
    return SpectralLine(frequency, float(np.sqrt(4.0 * weight.sum() / (n_time * window_square))))
