"""Stamps and the even grid that they may lie on: the rate in the digits that the stamps tell apart."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from testbed.logs.clock import NANO

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Stamps = NDArray[np.int64]

# Digits of a double.
_MOST_DIGITS = 17
# Stamps are whole nanoseconds, each rounded or cut.
_ROUNDING_NS = 1.0


def exact_rate(stamps: Stamps, index: Stamps, quantum_ns: float) -> float | None:
    r"""Return the sample rate of which stamps are the rounded multiples, in the fewest digits; None if of none.

    .. math:: t_k = t_0 + i_k / f + \epsilon_k, \quad \max \epsilon - \min \epsilon \le q

    so that the stamps of a clock of 20 kHz give 20000 Hz and no neighbour of it, whatever they are rounded to.

    Parameters
    ----------
    stamps, index : ndarray, shape (n_time,)
        Stamps [ns] and their places i on the grid, increasing from 0.
    quantum_ns : float
        q, what the stamps are rounded to [ns].

    Returns
    -------
    float or None
        Sample rate f [Hz].
    """
    length, last = float(stamps[-1] - stamps[0]), int(index[-1])
    if last < 1 or length <= 0.0:
        return None
    estimated = last / (NANO * length)
    for digits in range(1, _MOST_DIGITS + 1):
        rate = float(f"{estimated:.{digits}g}")
        if lies_on_grid(stamps, index, rate, quantum_ns):
            return rate
    return None


def lies_on_grid(stamps: Stamps, index: Stamps, rate_hz: float, quantum_ns: float) -> bool:
    """Return whether stamps are multiples of a step, but for their rounding; arguments as `exact_rate`."""
    if rate_hz <= 0.0:
        return False
    ends = [0, -1]
    # The ends alone tell most rates apart from the true one.
    return all(
        float(np.ptp((stamps[part] - stamps[0]) - index[part] / (NANO * rate_hz))) <= quantum_ns + _ROUNDING_NS
        for part in (ends, slice(None))
    )


def filled(stamps: Stamps, index: Stamps) -> Stamps:
    """Return a stamp for every place of the grid, shape (n_grid,) [ns]: where a sample is lost, the one between its
    neighbours.

    Parameters
    ----------
    stamps, index : ndarray, shape (n_time,)
        As for `exact_rate`.
    """
    places = np.arange(int(index[-1]) + 1)
    since = np.interp(places, index, (stamps - stamps[0]).astype(np.float64))
    whole: Stamps = stamps[0] + np.rint(since).astype(np.int64)
    whole[index] = stamps
    return whole
