"""What a linear system made of its input, frequency by frequency: gain, phase and coherence of two long records."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.fft import rfft, rfftfreq

from testbed.metrics.spectra import BLACKMAN_HARRIS, cosine_window, log_average

if TYPE_CHECKING:
    from collections.abc import Sequence

    from testbed.signals import ComplexArray, FloatArray

SHORTEST = 64
LONGEST = 2**16
# Side lobes of the window are 92 dB down; what is weaker than this, over the strongest, may be nothing but they.
_ABOVE_LEAKAGE = 1e-8
# Half the width of the window's main lobe, in bins: below, a constant leaks in.
_LOBE = 4
# Segments that overlap by half are worth so much of one that does not.
_WORTH = 0.65


@dataclass(frozen=True)
class Transfer:
    """Response of an output to its input at `freq_hz` [Hz], increasing: complex `response` [-], and `coherence` [-],
    which chance alone keeps below `chance` [-] in 95 % of all cases.
    """

    freq_hz: FloatArray
    response: ComplexArray
    coherence: FloatArray
    chance: FloatArray


class TransferSums:
    r"""Response by Welch's method from blocks: Blackman-Harris window, half overlap, averaged in logarithmic bins.

    .. math:: H = S_{xy} / S_{xx}, \qquad \gamma^2 = |S_{xy}|^2 / (S_{xx} S_{yy})

    A frequency counts where the input has more than the leakage of its strongest line. What lies in the main lobe of
    one of `lines_hz` is that line and makes one point. Segments that hold a NaN are left out.

    Parameters
    ----------
    sample_rate_hz : float
        Rate of the samples [Hz].
    n_time : int
        Samples of the whole record [-]; sixteen segments are made of it, fewer of a short one and more of a long one.
    lines_hz : sequence of float, optional
        Pure lines of the input [Hz].

    References
    ----------
    J. S. Bendat, A. G. Piersol (2010), Random Data, 4th ed., chapter 9.
    """

    def __init__(self, sample_rate_hz: float, n_time: int, lines_hz: Sequence[float] = ()) -> None:
        n_segment = min(max(2 * n_time // 17, SHORTEST), LONGEST)
        self._window: FloatArray = cosine_window(BLACKMAN_HARRIS, n_segment)
        self._pending = np.empty((2, n_segment))
        self._n_pending = self._n_segments = 0
        self._freq_hz: FloatArray = rfftfreq(n_segment, 1.0 / sample_rate_hz)
        self._lines = [(line, round(line * n_segment / sample_rate_hz)) for line in lines_hz]
        self._xx, self._yy = np.zeros(self._freq_hz.size), np.zeros(self._freq_hz.size)
        self._xy = np.zeros(self._freq_hz.size, complex)

    def process(self, x: FloatArray, y: FloatArray) -> None:
        """Take the next samples of input and output.

        Parameters
        ----------
        x, y : ndarray, shape (n_time,)
            Input and output at the same instants, any unit.
        """
        n_segment, rest = self._window.size, np.stack([x, y])
        while rest.shape[1]:
            n_new = min(n_segment - self._n_pending, rest.shape[1])
            self._pending[:, self._n_pending : self._n_pending + n_new] = rest[:, :n_new]
            self._n_pending, rest = self._n_pending + n_new, rest[:, n_new:]
            if self._n_pending == n_segment:
                self._add_segment()
                self._n_pending = n_segment // 2
                self._pending[:, : self._n_pending] = self._pending[:, n_segment - self._n_pending :].copy()

    def _add_segment(self) -> None:
        if np.all(np.isfinite(self._pending)):
            x, y = rfft(self._pending * self._window)
            self._xx += np.abs(x) ** 2
            self._yy += np.abs(y) ** 2
            self._xy += x.conj() * y
            self._n_segments += 1

    def result(self) -> Transfer:
        """Return what was found; empty where the record is too short or the input is still."""
        if self._n_segments < 2 or not np.any(self._xx):
            return Transfer(np.empty(0), np.empty(0, complex), np.empty(0), np.empty(0))
        known = self._xx > _ABOVE_LEAKAGE * np.max(self._xx, initial=0.0)
        known[:_LOBE] = False
        points = []
        for line, k in self._lines:
            lobe = slice(k - _LOBE, k + _LOBE + 1)
            if _LOBE < k < known.size - _LOBE and np.all(known[max(k - 1, 0) : k + 2]):
                points.append((line, *(float(one[lobe].sum()) for one in self._sums())))
            known[max(lobe.start, 0) : lobe.stop] = False
        freq, power = self._freq_hz[known], self._xx[known]
        between = [log_average(freq, power)[0], *(log_average(freq, one[known])[1] for one in self._sums())]
        at, xx, yy, real, imag = np.hstack([np.array(between), np.array(points).reshape(-1, 5).T])
        order = np.argsort(at)
        at, xx, yy, xy = at[order], xx[order], yy[order], (real + 1j * imag)[order]
        coherence = np.abs(xy) ** 2 / (xx * np.where(yy > 0.0, yy, np.inf))
        independent = max(_WORTH * self._n_segments, 1.5)
        return Transfer(at, xy / xx, coherence, np.full(at.size, 1.0 - 0.05 ** (1.0 / (independent - 1.0))))

    def _sums(self) -> tuple[FloatArray, ...]:
        return self._xx, self._yy, self._xy.real, self._xy.imag
