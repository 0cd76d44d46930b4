r"""Pointing errors over windows of time (ECSS-E-ST-60-10C, ESSB-HB-E-003): from samples, and from the error's spectrum.

Over windows of length T, at every place they can have, the mean m(t) of the error e gives

- APE, rms of e; MPE, rms of m; RPE, rms of e - m, so that APE^2 = MPE^2 + RPE^2;
- PDE, PRE, rms of m(t) - m(t - Ts): drift within, and reproducibility between, periods of observation.

The same as integrals of the density of e times a weight of w = 2 pi f:

.. math:: W_{RPE} = 1 - \frac{2 (1 - \cos wT)}{(wT)^2}, \quad W_{MPE} = 1 - W_{RPE}, \quad
    W_{PDE} = W_{PRE} = 2 (1 - \cos w T_s)\, W_{MPE}
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from testbed.signals import FloatArray


def mpe_weight(freq_hz: FloatArray, length: float) -> FloatArray:
    """Return the weight of MPE, the square of sin(pi f T) / (pi f T).

    Parameters
    ----------
    freq_hz : ndarray, shape (n_freq,)
        Frequency [Hz].
    length : float
        T [s].

    Returns
    -------
    ndarray, shape (n_freq,)
        Weight [-].
    """
    weight: FloatArray = np.sinc(freq_hz * length) ** 2
    return weight


def rpe_weight(freq_hz: FloatArray, length: float) -> FloatArray:
    """Return the weight of RPE, 1 - 2 (1 - cos wT) / (wT)^2, by its series where wT is small.

    Parameters
    ----------
    freq_hz : ndarray, shape (n_freq,)
        Frequency [Hz].
    length : float
        T [s].

    Returns
    -------
    ndarray, shape (n_freq,)
        Weight [-].
    """
    turn = 2.0 * np.pi * freq_hz * length
    # The difference from 1 would round away: (wT)^2/12 - (wT)^4/360.
    weight: FloatArray = np.where(np.abs(turn) < 1e-3, turn**2 / 12.0, 1.0 - mpe_weight(freq_hz, length))
    return weight


def drift_weight(freq_hz: FloatArray, length: float, separation: float) -> FloatArray:
    """Return the weight of PDE and PRE, that of MPE times 2 (1 - cos w Ts).

    Parameters
    ----------
    freq_hz : ndarray, shape (n_freq,)
        Frequency [Hz].
    length, separation : float
        T and Ts, from the start of one window to that of the other [s].

    Returns
    -------
    ndarray, shape (n_freq,)
        Weight [-].
    """
    weight: FloatArray = 4.0 * np.sin(np.pi * freq_hz * separation) ** 2 * mpe_weight(freq_hz, length)
    return weight


class WindowErrors:
    """MPE, RPE and PDE of one kind of window from samples, block by block, over every place that a window can have.

    Parameters
    ----------
    length : float
        T [s].
    separation : float or None
        Ts [s].
    sample_rate_hz : float
        Rate of the samples [Hz].
    """

    def __init__(self, length: float, separation: float | None, sample_rate_hz: float) -> None:
        self._m = max(round(length * sample_rate_hz), 1)
        self._apart = None if separation is None else round(separation * sample_rate_hz)
        self._tail = np.empty(0)
        self._n, self._mean2, self._within = 0, 0.0, 0.0
        self._n_pairs, self._drift2 = 0, 0.0

    def process(self, error: FloatArray) -> None:
        """Take the next samples.

        Parameters
        ----------
        error : ndarray, shape (n_time,)
            Error [rad].
        """
        m, apart = self._m, self._apart
        x = np.concatenate([self._tail, error])
        # Windows that end with a new sample, and before each the one that it is compared with.
        new = min(error.size, max(x.size - m + 1, 0))
        if new:
            sums, squares = (np.concatenate([[0.0], np.cumsum(y)]) for y in (x, x * x))
            mean = (sums[m:] - sums[:-m]) / m
            square = (squares[m:] - squares[:-m]) / m
            self._n += new
            self._mean2 += float(np.sum(mean[-new:] ** 2))
            self._within += float(np.sum(square[-new:] - mean[-new:] ** 2))
            if apart is not None and mean.size > apart:
                pairs = min(new, mean.size - apart)
                apart_from = mean[mean.size - pairs - apart : mean.size - apart]
                self._n_pairs += pairs
                self._drift2 += float(np.sum((mean[mean.size - pairs :] - apart_from) ** 2))
        kept = m - 1 + (apart or 0)
        self._tail = x[max(x.size - kept, 0) :]

    @property
    def mpe(self) -> float | None:
        """Rms of the mean [rad], None if no window was long enough."""
        return math.sqrt(self._mean2 / self._n) if self._n else None

    @property
    def rpe(self) -> float | None:
        """Rms of the error about the mean of its window [rad]."""
        return math.sqrt(max(self._within, 0.0) / self._n) if self._n else None

    @property
    def pde(self) -> float | None:
        """Rms of the difference of two means [rad], None without separation."""
        return math.sqrt(self._drift2 / self._n_pairs) if self._n_pairs else None


class Periodogram:
    r"""Two-sided density of a record of known length, no window and no detrending: its integral is the mean square.

    .. math:: S(f_k) = \frac{1}{M} \sum_m \frac{|\sum_j x_{m,j} e^{-2 \pi i j k / n}|^2}{n f_s}

    over M parts of equal length, one if the record is short enough, so that memory does not grow with duration.

    Parameters
    ----------
    sample_rate_hz : float
        Rate of the samples [Hz].
    n_time : int
        Number of samples of the record; fewer than M of them at its end are left out.
    longest : int
        Samples of a part at the most.
    """

    def __init__(self, sample_rate_hz: float, n_time: int, longest: int = 1 << 20) -> None:
        parts = max(-(-n_time // longest), 1)
        self._part = np.empty(max(n_time // parts, 1))
        self._filled, self.n_parts = 0, 0
        self._rate = sample_rate_hz
        self._total = np.zeros(self._part.size // 2 + 1)

    def process(self, x: FloatArray) -> None:
        """Take the next samples.

        Parameters
        ----------
        x : ndarray, shape (n_time,)
            Signal, any unit.
        """
        while x.size:
            new = min(self._part.size - self._filled, x.size)
            self._part[self._filled : self._filled + new] = x[:new]
            self._filled += new
            x = x[new:]
            if self._filled == self._part.size:
                self._total += np.abs(np.fft.rfft(self._part)) ** 2 / (self._part.size * self._rate)
                self.n_parts += 1
                self._filled = 0

    @property
    def freq_hz(self) -> FloatArray:
        """Frequencies, 0 to half the sample rate [Hz], shape (n_freq,)."""
        freq: FloatArray = np.asarray(np.fft.rfftfreq(self._part.size, 1.0 / self._rate), dtype=np.float64)
        return freq

    @property
    def power(self) -> FloatArray:
        """Share of the mean square at each of `freq_hz`, both signs of f together [unit^2], shape (n_freq,)."""
        share: FloatArray = self._total / max(self.n_parts, 1) * (self._rate / self._part.size)
        share[1 : (self._part.size + 1) // 2] *= 2.0
        return np.asarray(share)


def weighted_rms(power: FloatArray, weight: FloatArray | float = 1.0) -> float:
    """Return the root of the integral of a density times a weight.

    Parameters
    ----------
    power : ndarray, shape (n_freq,)
        Share of the mean square at each frequency [rad^2].
    weight : ndarray, shape (n_freq,), or float
        Of each [-].

    Returns
    -------
    float
        Rms [rad].
    """
    return math.sqrt(float(np.sum(power * weight)))
