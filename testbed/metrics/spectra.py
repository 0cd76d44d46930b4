"""Two-sided spectral densities of long records, one block at a time, so that memory does not grow with duration."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.fft import rfft, rfftfreq

if TYPE_CHECKING:
    from collections.abc import Sequence

    from testbed.signals import FloatArray

# Weights of the cosines of a window.
HANN = (0.5, 0.5)
BLACKMAN_HARRIS = (0.35875, 0.48829, 0.14128, 0.01168)
LONGEST_SEGMENT = 2**19
SHORTEST_SEGMENT = 8


def cosine_window(weights: Sequence[float], n: int) -> FloatArray:
    r"""Return a periodic window :math:`w_k = \sum_m a_m \cos m (2 \pi k / n - \pi)`.

    Parameters
    ----------
    weights : sequence of float
        The a_m, which add up to 1 [-].
    n : int
        Samples, after which it repeats.

    Returns
    -------
    ndarray, shape (n,)
        From nearly 0 over 1 in the middle [-].

    References
    ----------
    F. J. Harris (1978), Proc. IEEE 66(1):51-83.
    """
    turn = np.linspace(-np.pi, np.pi, n + 1)[:-1]
    window = np.zeros(n)
    for m, weight in enumerate(weights):
        window += weight * np.cos(m * turn)
    return window


def segment_length(n_time: int) -> int:
    """Return the Welch segment for a record: half of it (three segments), capped so that memory stays flat.

    Long segments resolve the slow lines; the scatter they leave at high frequency is removed by `log_average`.

    Parameters
    ----------
    n_time : int
        Samples in the record [-].

    Returns
    -------
    int
        Samples in a segment [-].
    """
    return min(n_time // 2, LONGEST_SEGMENT)


class WelchDensity:
    r"""Two-sided power density by Welch's method (periodic Hann window, half overlap, no detrending), from blocks.

    .. math:: S(f) = \frac{1}{M} \sum_{m=1}^{M} \frac{|\sum_k w_k x_{m,k} e^{-2 \pi i f k / f_s}|^2}{f_s \sum_k w_k^2},
              \quad \int_{-f_s/2}^{f_s/2} S \, df = \overline{x^2}

    Segments that hold a NaN are left out. Any division of the record into blocks gives the same bits.

    Parameters
    ----------
    sample_rate_hz : float
        Rate of the samples [Hz].
    n_segment : int
        Samples in a segment [-].

    Raises
    ------
    ValueError
        If `n_segment` is below 8: a Hann window then has no resolution left.

    References
    ----------
    P. D. Welch (1967), IEEE Trans. Audio Electroacoustics 15(2):70-73.
    """

    def __init__(self, sample_rate_hz: float, n_segment: int) -> None:
        if n_segment < SHORTEST_SEGMENT:
            msg = f"n_segment: expected at least {SHORTEST_SEGMENT} samples, got {n_segment}"
            raise ValueError(msg)
        self._window: FloatArray = cosine_window(HANN, n_segment)
        self._scale = 1.0 / (sample_rate_hz * float(np.sum(self._window**2)))
        self._pending = np.empty(n_segment)
        self._n_pending = 0
        self._total = np.zeros(n_segment // 2 + 1)
        self.n_segments = 0
        self.freq_hz: FloatArray = rfftfreq(n_segment, 1.0 / sample_rate_hz)

    def process(self, x: FloatArray) -> None:
        """Take the next samples.

        Parameters
        ----------
        x : ndarray, shape (n_time,)
            Signal, any unit.
        """
        n_segment = self._pending.size
        while x.size:
            n_new = min(n_segment - self._n_pending, x.size)
            self._pending[self._n_pending : self._n_pending + n_new] = x[:n_new]
            self._n_pending += n_new
            x = x[n_new:]
            if self._n_pending == n_segment:
                self._add_segment()
                step = n_segment - n_segment // 2
                self._n_pending = n_segment - step
                self._pending[: self._n_pending] = self._pending[step:]

    def _add_segment(self) -> None:
        if np.all(np.isfinite(self._pending)):
            spectrum = rfft(self._pending * self._window)
            self._total += spectrum.real**2 + spectrum.imag**2
            self.n_segments += 1

    @property
    def density(self) -> FloatArray:
        """Two-sided density at `freq_hz` (f >= 0 half of it), shape (n_segment // 2 + 1,), [unit^2/Hz]; NaN without a
        segment.
        """
        if self.n_segments == 0:
            return np.full(self._total.size, np.nan)
        average: FloatArray = self._total * (self._scale / self.n_segments)
        return average


def log_average(freq_hz: FloatArray, density: FloatArray, bins_per_decade: int = 40) -> tuple[FloatArray, FloatArray]:
    """Average a density in bins of equal logarithmic width, counted from the highest frequency down.

    Empty bins are left out, so the resolution is kept at low frequency.

    The density is averaged, not its root or logarithm: power is conserved in each bin.

    Parameters
    ----------
    freq_hz : ndarray, shape (n_freq,)
        Frequency [Hz], increasing, above zero.
    density : ndarray, shape (n_freq,)
        Power density [unit^2/Hz].
    bins_per_decade : int
        Bins in a factor of ten of frequency [-].

    Returns
    -------
    freq_hz, density : ndarray, shapes (n_bin,), (n_bin,)
        Mean frequency [Hz] and mean density [unit^2/Hz] of each bin.
    """
    if freq_hz.size == 0:
        return freq_hz, density
    bins = np.floor(np.log10(freq_hz[-1] / freq_hz) * bins_per_decade).astype(np.int64)
    first = np.flatnonzero(np.diff(bins, prepend=-1))
    n_in_bin = np.diff(first, append=freq_hz.size)
    return np.add.reduceat(freq_hz, first) / n_in_bin, np.add.reduceat(density, first) / n_in_bin
