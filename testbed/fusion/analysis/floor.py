"""The noise of a sensor against what is believed of it, beside whatever motion the record has."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.fft import rfft, rfftfreq
from scipy.signal import detrend, welch

from testbed.fusion.analysis.finding import QUANTILE, Finding

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from testbed.fusion.analysis.agreement import Pair
    from testbed.fusion.analysis.paths import Trace
    from testbed.signals import FloatArray

# Segments of a record, and the longest [s]; lines of the spectrum below the first band; bands of an octave.
_SEGMENTS, _LONGEST, _FIRST, _PER_OCTAVE = 16, 1.0, 3.0, 2.0
# Readings that are missing for longer than this are not filled in [s].
_SHORT_GAP = 0.01
_HIGHEST_SHARE, _LEAST_SEGMENT, _LEAST_SEGMENTS = 0.45, 16, 12
# Ratio beyond which the belief is wrong [-]: a cautious one is not, and what has no noise at all is no instrument.
_LOUD, _QUIET, _SILENT = 1.5, 0.25, 1e-3


@dataclass(frozen=True)
class NoiseRatio:
    """Root density of the noise over the believed one, by bands.

    Parameters
    ----------
    freq_hz : ndarray, shape (n_band,)
        Middle of each [Hz].
    value, scatter : ndarray, shape (n_band,)
        Ratio [-], and its relative standard deviation [-].
    """

    freq_hz: FloatArray
    value: FloatArray
    scatter: FloatArray

    @property
    def least(self) -> int:
        """The band that holds the noise down the most."""
        return int(np.argmin(self.value * np.exp(QUANTILE * self.scatter)))

    def interval(self, band: int) -> tuple[float, float]:
        """Return the interval of a band at 1e-4 [-]."""
        part = math.exp(QUANTILE * self.scatter[band])
        return float(self.value[band] / part), float(self.value[band] * part)


def own_noise(trace: Trace) -> NoiseRatio | None:
    """Return the density of a sensor's readings over that of its believed noise, None of too short a record.

    Motion only adds to it: the least band is the closest to the noise.

    Parameters
    ----------
    trace : Trace
        Readings and belief.
    """
    good = np.isfinite(trace.z)
    if not good.any():
        return None
    z = trace.z if good.all() else np.interp(trace.t, trace.t[good], trace.z[good])
    fs = 1.0 / trace.interval
    n = _segment(z.size, fs)
    if n < _LEAST_SEGMENT:
        return None
    overlap, bridged = n // 2, _long_gaps(good, max(_SHORT_GAP * fs, 3.0))
    if bridged.any():
        # A straight line over a gap, or over what was cut off at the end of the range, is no noise.
        whole = [z[k : k + n] for k in range(0, z.size - n + 1, n) if not bridged[k : k + n].any()]
        if len(whole) < _LEAST_SEGMENTS:
            return None
        overlap, z = 0, np.concatenate(whole)
    freq, density = welch(z, fs=fs, nperseg=n, noverlap=overlap, detrend=detrend, average="median")
    return _banded(freq, 0.5 * density, trace.reading_noise(np.maximum(freq, freq[1])), z.size / n)


def _long_gaps(good: NDArray[np.bool_], most: float) -> NDArray[np.bool_]:
    """Return what belongs to runs of more than so many readings that are not good, shape (n_time,)."""
    begins = np.flatnonzero(np.concatenate([[True], good[1:] != good[:-1]]))
    lengths = np.diff(begins, append=good.size)
    return ~good & np.repeat(lengths > most, lengths)


def noise_beside(pair: Pair, a: FloatArray) -> NoiseRatio | None:
    r"""Return what of the noisy path is not coherent with the clean one, over its believed noise.

    .. math:: S_{aa} (1 - \gamma^2), \quad \gamma^2 = |S_{ac}|^2 / S_{aa} S_{cc}

    Parameters
    ----------
    pair : Pair
        The two sensors.
    a : ndarray, shape (n_time,)
        The noisy path with its stamps put right [rad/s].
    """
    fs, w = pair.grid.sample_rate_hz, pair.grid.weight(pair.noisy, pair.clean)
    n = _segment(int(np.count_nonzero(w)), fs)
    if n < _LEAST_SEGMENT:
        return None
    begins = [k for k in range(0, w.size - n + 1, n // 2) if w[k : k + n].all()]
    if len(begins) < _LEAST_SEGMENTS:
        return None
    window = np.hanning(n + 2)[1:-1]
    A, C = (rfft(detrend(np.array([one[k : k + n] for k in begins])) * window, axis=1) for one in (a, pair.c))
    own, clean = (np.mean(np.abs(one) ** 2, axis=0) / (fs * np.sum(window**2)) for one in (A, C))
    cross = np.mean(A * C.conj(), axis=0) / (fs * np.sum(window**2))
    # Half overlapping segments of that window count for half.
    count = 0.5 * len(begins)
    left = (own - np.abs(cross) ** 2 / np.maximum(clean, 1e-300)) / (1.0 - 0.5 / count)
    freq = rfftfreq(n, 1.0 / fs)
    f = np.maximum(freq, freq[1])
    believed = np.abs(pair.clean.belief.response(f)) ** 2 * pair.grid.noise(pair.noisy, f)
    return _banded(freq, left, believed, count)


def loudness_findings(name: str, noise: NoiseRatio | None, factor: float) -> Iterator[Finding]:
    """Yield noise that is not of the believed size in any band: motion only adds to it.

    Parameters
    ----------
    name : str
        Of the sensor.
    noise : NoiseRatio or None
        Over its belief.
    factor : float
        What its readings are too large by, because of their unit [-].
    """
    if noise is None:
        return
    least, most = noise.least, int(np.argmax(noise.value))
    lower, upper = noise.interval(least)
    if lower > _LOUD * factor:
        remedy = (
            "its noise is so many times the believed one: raise input_noise and output_noise of the belief, unless its "
            "unit or scale is wrong, which noise alone does not tell"
        )
        yield Finding("belief", name, float(noise.value[least]) / factor, lower / factor, upper / factor, "1", remedy)
    lower, upper = noise.interval(most)
    if _SILENT * factor < upper < _QUIET * factor:
        remedy = "its noise is that part of the believed one: lower input_noise and output_noise of the belief"
        yield Finding("belief", name, float(noise.value[most]) / factor, lower / factor, upper / factor, "1", remedy)


def _segment(n_time: int, sample_rate_hz: float) -> int:
    return min(n_time // _SEGMENTS, round(_LONGEST * sample_rate_hz))


def _banded(freq: FloatArray, density: FloatArray, believed: FloatArray, count: float) -> NoiseRatio | None:
    use = (freq >= _FIRST * freq[1]) & (freq <= _HIGHEST_SHARE * 2.0 * freq[-1]) & (believed > 0.0)
    if not use.any():
        return None
    band = np.floor(_PER_OCTAVE * np.log2(freq[use])).astype(int)
    ratio = density[use] / believed[use]
    found = []
    for one in np.unique(band):
        mine = band == one
        # Lines of motion stand out of the median; it scatters by 1.25 times a mean.
        value = math.sqrt(max(float(np.median(ratio[mine])), 0.0))
        found.append((2.0 ** ((one + 0.5) / _PER_OCTAVE), value, 0.625 / math.sqrt(count * np.count_nonzero(mine))))
    return NoiseRatio(*np.array(found).T)
