"""Stamps and the even grid that they may lie on: the rate in the digits that the stamps tell apart."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from testbed.logs.clock import NANO

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from testbed.signals import FloatArray

    Stamps = NDArray[np.int64]

# Digits of a double.
_MOST_DIGITS = 17
# Stamps are whole nanoseconds, each rounded or cut.
_ROUNDING_NS = 1.0
_PARTS, _FEWEST_IN_PART = 1000, 4


def exact_rate(stamps: Stamps, index: Stamps, quantum_ns: float) -> float | None:
    r"""Return the sample rate of which stamps are the rounded multiples, in the fewest digits; None if of none.

    .. math:: t_k = t_0 + i_k / f + \epsilon_k, \quad \max \epsilon - \min \epsilon \le q

    so that the stamps of a clock of 20 kHz give 20000 Hz and no neighbour of it, whatever they are rounded to. The span
    of the residuals is convex in 1/f: the rates that explain the stamps are an interval, of which the number with the
    fewest digits is taken.

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
    last, most = int(index[-1]), quantum_ns + _ROUNDING_NS
    step = float(stamps[-1] - stamps[0]) / max(last, 1)
    if last < 1 or step <= 0.0:
        return None
    places, residual = _extremes(index, (stamps - stamps[0]) - index * step)

    def excess(change: float) -> float:
        return float(np.ptp(residual - places * change)) - most

    furthest = most / last
    best = float(minimize_scalar(excess, bounds=(-furthest, furthest), method="bounded").x)
    if excess(best) > 0.0:
        return None
    ends = [end if excess(end) <= 0.0 else brentq(excess, best, end) for end in (-furthest, furthest)]
    middle = 1.0 / (NANO * (step + 0.5 * sum(ends)))
    rates = (float(f"{middle:.{digits}g}") for digits in range(1, _MOST_DIGITS + 1))
    return next((rate for rate in rates if lies_on_grid(stamps, index, rate, quantum_ns)), None)


def _extremes(index: Stamps, residual: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the places and values of the lowest and highest residual in each of a thousand parts of a record, or all:
    a change of the rate moves those of a part together, to a thousandth of what it moves the ends.
    """
    n_part = -(-index.size // _PARTS)
    if n_part < _FEWEST_IN_PART:
        return index.astype(np.float64), residual
    parts = [np.arange(start, min(start + n_part, index.size)) for start in range(0, index.size, n_part)]
    kept = np.array([part[choose(residual[part])] for part in parts for choose in (np.argmin, np.argmax)])
    return index[kept].astype(np.float64), residual[kept]


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
