"""Lowest and highest value of a long signal in equal bins of time: what a plotted line looks like, in a thousand
points.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from testbed.signals import FloatArray


class Envelope:
    """Extremes of the samples `start` <= k < `stop` in `n_bins` equal bins; blocks may be divided in any way.

    No extreme is lost. With fewer samples than bins each sample has a bin of its own, and the envelope is the signal
    itself. A bin without a finite sample is NaN.

    Parameters
    ----------
    start, stop : int
        First sample and the one after the last [-].
    sample_rate_hz : float
        Rate of the samples [Hz].
    n_bins : int
        Bins wanted [-].
    """

    def __init__(self, start: int, stop: int, sample_rate_hz: float, n_bins: int) -> None:
        self._start, self._stop = start, stop
        n_bins = max(1, min(n_bins, stop - start))
        self._edges = start + np.arange(n_bins + 1, dtype=np.int64) * (stop - start) // n_bins
        self.time: FloatArray = (self._edges[:-1] + self._edges[1:] - 1).astype(np.float64) / (2.0 * sample_rate_hz)
        self.low: FloatArray = np.full(n_bins, np.nan)
        self.high: FloatArray = np.full(n_bins, np.nan)

    def process(self, first: int, values: FloatArray) -> None:
        """Take a block; samples outside the range are ignored.

        Parameters
        ----------
        first : int
            Index of the block's first sample [-].
        values : ndarray, shape (n_time,)
            Signal, any unit; NaN is ignored.
        """
        begin, end = max(first, self._start), min(first + values.size, self._stop)
        if begin >= end:
            return
        low_bin = int(np.searchsorted(self._edges, begin, side="right")) - 1
        high_bin = int(np.searchsorted(self._edges, end - 1, side="right"))
        cuts = np.maximum(self._edges[low_bin:high_bin] - begin, 0)
        inside = values[begin - first : end - first]
        bins = slice(low_bin, high_bin)
        self.low[bins] = np.fmin(self.low[bins], np.fmin.reduceat(inside, cuts))
        self.high[bins] = np.fmax(self.high[bins], np.fmax.reduceat(inside, cuts))
