r"""The tracker's correction in time: exact between samples, with fades, and a mirror that has an end.

.. math:: \dot c = b + k_1 w, \quad \dot b = k_2 w, \quad w = u + n - c

While the tracker fades there is no w: the correction goes on at the rate b that it has learnt.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numba import njit
from scipy.linalg import expm

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from testbed.pointing.blend import Gains
    from testbed.signals import FloatArray


class Correction:
    """The tracker's correction of several signals at once, each by itself.

    Parameters
    ----------
    gains : Gains
        k_1 and k_2.
    sample_rate_hz : float
        Rate of the samples [Hz].
    lanes : int
        Number of signals.
    """

    def __init__(self, gains: Gains, sample_rate_hz: float, lanes: int) -> None:
        self._steps = correction_steps(gains, sample_rate_hz)
        self._x, self._previous = np.zeros((lanes, 2)), np.zeros(lanes)

    def process(self, u: FloatArray, seen: FloatArray) -> FloatArray:
        """Return what the correction leaves of each signal.

        Parameters
        ----------
        u : ndarray, shape (lanes, n_time)
            What is to be corrected [rad].
        seen : ndarray of bool, shape (n_time,)
            Whether the tracker works over the step that ends at each sample.

        Returns
        -------
        ndarray, shape (lanes, n_time)
            u - c [rad].
        """
        left = np.empty_like(u)
        correct(self._x, self._previous, *self._steps, u, seen, left)
        return left


class LimitedCorrection:
    """Tracker and mirror together where the mirror has an end: the correction stands still while it is there.

    Parameters
    ----------
    gains : Gains
        k_1 and k_2.
    sample_rate_hz : float
        Rate of the samples [Hz].
    stroke : float
        The deflection is at most plus and minus this [rad]; infinite for no end.
    rate_limit : float
        And its rate this [rad/s].
    """

    def __init__(self, gains: Gains, sample_rate_hz: float, stroke: float, rate_limit: float) -> None:
        self._steps = correction_steps(gains, sample_rate_hz)
        self._limits = np.array([stroke, rate_limit / sample_rate_hz])
        # Correction, its rate, last input, last deflection, whether that was at an end.
        self._x = np.zeros(5)

    def process(
        self, angle: FloatArray, forward: FloatArray, noise: FloatArray, seen: FloatArray
    ) -> tuple[FloatArray, NDArray[np.int64]]:
        """Return the deflection, and where it is at an end.

        Parameters
        ----------
        angle, forward, noise : ndarray, shape (n_time,)
            True line of sight, deflection by the feed-forward, noise of the tracker [rad].
        seen : ndarray of bool, shape (n_time,)
            As for `Correction`.

        Returns
        -------
        deflection : ndarray, shape (n_time,)
            [rad].
        ends : ndarray of int, shape (n_time,)
            0 free, 1 at the stroke's end, 2 at the rate's.
        """
        deflection, ends = np.empty(angle.size), np.zeros(angle.size, dtype=np.int64)
        correct_limited(self._x, self._limits, *self._steps, angle, forward, noise, seen, deflection, ends)
        return deflection, ends


def correction_steps(gains: Gains, sample_rate_hz: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return transition, gain and slope of a step, for an input that is linear over it; faded first, then seen.

    Parameters
    ----------
    gains : Gains
        k_1 and k_2.
    sample_rate_hz : float
        Rate of the samples [Hz].

    Returns
    -------
    Phi, Gamma, slope : ndarray, shapes (2, 2, 2), (2, 2), (2, 2)
        x+ = Phi x + Gamma w + slope (w+ - w).
    """
    T = 1.0 / sample_rate_hz
    found = []
    for k1, k2 in ((0.0, 0.0), gains):
        block = np.zeros((4, 4))
        block[0, :3], block[1, [0, 2]], block[2, 3] = np.array([-k1, 1.0, k1]) * T, np.array([-k2, k2]) * T, 1.0
        power = expm(block)
        found.append((power[:2, :2], power[:2, 2], power[:2, 3]))
    Phi, Gamma, slope = (np.ascontiguousarray(np.stack(part)) for part in zip(*found, strict=True))
    return Phi, Gamma, slope


@njit(cache=True)
def correct(x, previous, Phi, Gamma, slope, u, seen, left):  # type: ignore[no-untyped-def] # pragma: no cover
    """Fill `left` with u - c, lane by lane; the arguments are those of `Correction`."""
    for lane in range(u.shape[0]):
        c, b, last = x[lane, 0], x[lane, 1], previous[lane]
        for k in range(u.shape[1]):
            mode = 1 if seen[k] else 0
            rise = u[lane, k] - last
            c, b = (
                Phi[mode, 0, 0] * c + Phi[mode, 0, 1] * b + Gamma[mode, 0] * last + slope[mode, 0] * rise,
                Phi[mode, 1, 0] * c + Phi[mode, 1, 1] * b + Gamma[mode, 1] * last + slope[mode, 1] * rise,
            )
            last = u[lane, k]
            left[lane, k] = last - c
        x[lane, 0], x[lane, 1], previous[lane] = c, b, last


@njit(cache=True)
def correct_limited(  # type: ignore[no-untyped-def] # pragma: no cover
    x, limits, Phi, Gamma, slope, angle, forward, noise, seen, deflection, ends
):
    """Fill `deflection` and `ends`; the arguments are those of `LimitedCorrection`."""
    c, b, last, before, stuck = x
    stroke, step = limits
    for k in range(angle.size):
        w = angle[k] - forward[k] + noise[k]
        if stuck == 0.0:
            mode = 1 if seen[k] else 0
            rise = w - last
            c, b = (
                Phi[mode, 0, 0] * c + Phi[mode, 0, 1] * b + Gamma[mode, 0] * last + slope[mode, 0] * rise,
                Phi[mode, 1, 0] * c + Phi[mode, 1, 1] * b + Gamma[mode, 1] * last + slope[mode, 1] * rise,
            )
        last = w
        wanted = forward[k] + c
        at = min(max(wanted, before - step), before + step)
        if at != wanted:
            ends[k] = 2
        if at > stroke or at < -stroke:
            at = min(max(at, -stroke), stroke)
            ends[k] = 1
        stuck = 1.0 if ends[k] > 0 else 0.0
        before = at
        deflection[k] = at
    x[0], x[1], x[2], x[3], x[4] = c, b, last, before, stuck
