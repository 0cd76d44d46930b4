r"""How the clock of the output runs against that of the reference, and how late it is: roughly, before the fit.

A clock that counts 1 s in (1 + e) s of the other's moves every frequency by that factor, whatever is between the
channels: so both spectra have the same fine structure, lines or the accidents of noise, shifted in ln f by ln(1 + e).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.fft import ifft, irfft, next_fast_len, rfft
from scipy.ndimage import uniform_filter1d

if TYPE_CHECKING:
    from testbed.identification.spectrum import Series
    from testbed.signals import ComplexArray, FloatArray

# Clocks are this much apart at the most; two crystals differ by 200 ppm, an RC oscillator by some thousand.
MOST_APART = 6e-3
# Points of the logarithmic axis; bins that a level is the mean of; standard deviations from which on a peak is one.
_POINTS, _LEVEL, _CLEAR = 1 << 20, 41, 6.0


def rough_clock(reference: Series, output: Series) -> float:
    """Return e to a fraction of a period of the excitation over the record [-]; 0 if nothing tells it."""
    length = min(reference.end, output.end) - max(reference.start, output.start)
    low = 4.0 / length
    high = 0.45 * min(reference.sample_rate_hz, output.sample_rate_hz)
    # Two points in each bin at the upper end.
    high = min(high, _POINTS / (2.0 * length * np.log(high / low)))
    axis = np.geomspace(low, high, _POINTS)
    step = float(np.log(high / low)) / (_POINTS - 1)
    first, second = (_fine_structure(one, axis) for one in (reference, output))
    n = next_fast_len(2 * _POINTS, real=True)
    found = irfft(np.conj(rfft(first, n)) * rfft(second, n), n)
    reach = int(MOST_APART / step)
    near = np.concatenate([found[-reach:], found[: reach + 1]])
    peak = int(np.argmax(near))
    if near[peak] < _CLEAR * np.std(near) or not 0 < peak < near.size - 1:
        return 0.0
    before, at, after = near[peak - 1 : peak + 2]
    vertex = 0.5 * (before - after) / (before - 2.0 * at + after)
    return float(np.expm1((peak - reach + vertex) * step))


def _fine_structure(series: Series, axis: FloatArray) -> FloatArray:
    """Return the amplitude of a spectrum over its level, less the mean, at frequencies by the channel's own clock."""
    n = next_fast_len(2 * series.values.size, real=True)
    amplitude = np.abs(rfft(series.values * np.hanning(series.values.size), n))
    level = np.sqrt(np.maximum(uniform_filter1d(amplitude**2, 2 * _LEVEL), 0.0))
    flat = amplitude / np.where(level > 0.0, level, 1.0)
    found: FloatArray = np.interp(axis, np.arange(flat.size) * series.sample_rate_hz / n, flat)
    found -= found.mean()
    return found


def rough_lags(X: ComplexArray, Y: ComplexArray, length: float) -> tuple[float, float]:
    """Return how late the output is, where its correlation with the reference has its peak [s]: by all frequencies
    alike, which is sharp, and by the strong ones more, which noise between the lines does not lead astray.

    Parameters
    ----------
    X, Y : ndarray of complex, shape (n_freq,)
        Transforms at multiples of 1/length, the first one at 1.
    length : float
        Of the record [s].
    """
    levels = [np.sqrt(np.maximum(uniform_filter1d(np.abs(one) ** 2, _LEVEL), 0.0)) for one in (X, Y)]
    cross = np.conj(X) * Y
    alike, strong = (_peak(cross, scale) * length for scale in (levels[0] * levels[1], np.sqrt(np.abs(cross))))
    return alike, strong


def _peak(cross: ComplexArray, scale: FloatArray) -> float:
    """Return where a correlation has its peak, in lengths of the record."""
    n = next_fast_len(4 * cross.size)
    found = np.abs(ifft(np.concatenate([[0.0], cross / np.where(scale > 0.0, scale, 1.0)]), n))
    peak = int(np.argmax(found))
    return (peak if peak <= n // 2 else peak - n) / n
