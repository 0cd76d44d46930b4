"""Means of neighbouring samples, taken while a recording is read, so that memory does not grow with it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.logs.clock import usual_step

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from testbed.signals import FloatArray

# Share of its samples that a mean must have, as in an Allan deviation through gaps.
_LEAST = 0.8
# Means that a gap may leave free.
MOST_FREE = 10_000_000


class Places:
    """The place of each sample on the even grid, block by block; without stamps its row."""

    def __init__(self) -> None:
        self._next, self._last, self._step = 0, 0, 0.0

    def rows(self, n_time: int) -> NDArray[np.int64]:
        """Return the places of the next `n_time` samples, one after the other."""
        self._next += n_time
        return np.arange(self._next - n_time, self._next)

    def stamped(self, stamps: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the places of the next samples by their stamps [ns]; lost samples leave places free."""
        if not self._step:
            self._step, self._last = max(usual_step(np.diff(stamps)), 1.0), int(stamps[0])
            self._next = -1
        steps = np.diff(stamps, prepend=np.int64(self._last))
        places: NDArray[np.int64] = self._next + np.cumsum(np.maximum(np.rint(steps / self._step), 1).astype(np.int64))
        self._next, self._last = int(places[-1]), int(stamps[-1])
        return places


class Means:
    """Means of `n` neighbouring samples; of increments the sums, of an angle every `n`-th.

    Parameters
    ----------
    n : int
        Places of a mean [-].
    kind : str, optional
        ``rate``, ``increment`` or ``angle``.
    """

    def __init__(self, n: int, kind: str | None) -> None:
        self._n, self._kind = n, kind
        self._values, self._places = np.empty(0), np.empty(0, np.int64)
        self._done = 0

    def add(self, values: NDArray[Any], places: NDArray[np.int64]) -> FloatArray:
        """Return the means that the next samples complete, NaN where fewer than 80 % of their samples are there.

        Parameters
        ----------
        values : ndarray, shape (n_time,)
            NaN where one is missing.
        places : ndarray, shape (n_time,)
            On the even grid, increasing.

        Raises
        ------
        OverflowError
            If a gap leaves more means free than anyone wants.
        """
        values = np.concatenate([self._values, np.asarray(values, np.float64)])
        places = np.concatenate([self._places, places])
        first, end = self._done, int(places[-1]) // self._n
        if end - first > MOST_FREE:
            msg = f"a gap leaves {end - first} means free"
            raise OverflowError(msg)
        whole = int(np.searchsorted(places, end * self._n))
        self._values, self._places, self._done = values[whole:], places[whole:], end
        return self._of(values[:whole], places[:whole] - first * self._n, end - first)

    def _of(self, values: FloatArray, places: NDArray[np.int64], n_mean: int) -> FloatArray:
        if self._kind == "angle":
            ends = np.full(n_mean, np.nan)
            at_end = places % self._n == self._n - 1
            ends[places[at_end] // self._n] = values[at_end]
            return ends
        known = np.isfinite(values)
        group = places[known] // self._n
        count = np.bincount(group, minlength=n_mean)
        total = np.bincount(group, values[known], minlength=n_mean)
        mean: FloatArray = np.where(count >= _LEAST * self._n, total / np.maximum(count, 1), np.nan)
        return mean * self._n if self._kind == "increment" else mean
