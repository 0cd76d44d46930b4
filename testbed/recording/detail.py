"""The samples of a signal that a plot needs: extremes of every bin, and all of them inside a window."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from testbed.signals import FloatArray

N_BINS = 4000  # more than a screen has columns, so min and max per bin draw the same picture as every sample


class Detail:
    """Choose real samples of a stream so that no extreme is lost: argmin and argmax per bin, every sample of a window.

    Bins are counted from sample 0, so any division of the stream into blocks chooses the same samples. The first and
    the last sample are always among them. Unlike the envelope of a page, which keeps two numbers per bin, this one
    keeps samples with their own times, sends them on block by block and has a window without bins.

    Parameters
    ----------
    n_samples : int
        Length of the whole stream; a bin holds ceil(n_samples / 4000) samples.
    window : tuple of int
        First index of the window and the index behind its last one.
    gaps : bool, optional
        Samples that are not finite were lost and leave a gap: NaN, which the viewer draws no line to, stands for each
        of them in the window and for each bin that has no finite one. Otherwise they were not due, and are left out.
    """

    def __init__(self, n_samples: int, window: tuple[int, int], *, gaps: bool = False) -> None:
        self._width = max(1, -(-n_samples // N_BINS))
        self._window, self._gaps = window, gaps
        self._start = 0
        self._open: FloatArray = np.empty(0)

    def process(self, values: FloatArray) -> tuple[NDArray[np.int64], FloatArray]:
        """Take the next samples and choose among those whose bin is complete.

        Parameters
        ----------
        values : ndarray, shape (n_time,)
            Samples, any unit.

        Returns
        -------
        indices : ndarray of int, shape (n_chosen,)
            Absolute sample indices, ascending.
        chosen : ndarray, shape (n_chosen,)
            The samples there, unit of `values`.
        """
        values = np.concatenate((self._open, values))
        # The latest sample stays in the open bin, for it may turn out to be the last of the stream.
        n_complete = max(0, values.size - 1) // self._width * self._width
        self._open = values[n_complete:].copy()
        return self._choose(values[:n_complete].reshape(-1, self._width))

    def finish(self) -> tuple[NDArray[np.int64], FloatArray]:
        """Choose among the samples of the last, incomplete bin; returns as `process`."""
        return self._choose(self._open[np.newaxis], last=True)

    def _choose(self, bins: FloatArray, *, last: bool = False) -> tuple[NDArray[np.int64], FloatArray]:
        values = bins.ravel()
        if not values.size:
            return np.empty(0, np.int64), values
        keep = np.zeros(values.size, bool)
        first_of_bin = np.arange(0, values.size, bins.shape[1])
        keep[first_of_bin + _arg_extreme(bins, np.argmin, np.inf)] = True
        keep[first_of_bin + _arg_extreme(bins, np.argmax, -np.inf)] = True
        window = np.clip(np.array(self._window) - self._start, 0, values.size)
        keep[window[0] : window[1]] = True
        keep[0] |= self._start == 0
        keep[-1] |= last
        finite = np.isfinite(values)
        chosen = np.flatnonzero(keep if self._gaps else keep & finite)
        start, self._start = self._start, self._start + values.size
        return chosen + start, np.where(finite[chosen], values[chosen], np.nan)


def _arg_extreme(bins: FloatArray, choose: Callable[..., NDArray[np.intp]], filler: float) -> NDArray[np.intp]:
    """Return per bin the index of the extreme finite sample."""
    index = choose(bins, axis=1)
    # An extreme of a bin is finite only if NaN and the infinity on this side are absent from it.
    if not np.isfinite(bins[np.arange(len(bins)), index]).all():
        index = choose(np.where(np.isfinite(bins), bins, filler), axis=1)
    return index
