"""Angles from rates, on the base clock, block by block."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from testbed.signals import FloatArray


class RateIntegral:
    r"""The integral of a rate that is estimated at every `ratio`-th sample of the base clock.

    .. math:: \theta_j = \theta_{j-1} + \tfrac{1}{2} (\omega_{j-1} + \omega_j) T, \quad
        \theta(t_j + \tau) = \theta_j + \omega_j \tau

    Trapezoid from estimate to estimate; until the next one the angle goes on at the last rate, which is all that can be
    known then. Any division into blocks gives the same angle but for rounding.

    Parameters
    ----------
    ratio : int
        Base samples from one estimate to the next.
    base_rate_hz : float
        Base clock [Hz].
    """

    def __init__(self, ratio: int, base_rate_hz: float) -> None:
        self._ratio, self._step = ratio, ratio / base_rate_hz
        self._angle, self._rate, self._done = 0.0, 0.0, 0

    def process(self, rate: FloatArray, n_time: int) -> tuple[FloatArray, FloatArray]:
        """Integrate over the next `n_time` base samples.

        Parameters
        ----------
        rate : ndarray, shape (n_estimate,)
            Estimates that fall due in them [rad/s].
        n_time : int
            Base samples.

        Returns
        -------
        angle, rate : ndarray, shape (n_time,)
            [rad], [rad/s].
        """
        before = np.concatenate([[self._rate], rate])
        steps = 0.5 * self._step * (before[:-1] + before[1:])
        if rate.size and not self._done:
            # The first estimate is at the angle's zero.
            steps[0] = 0.0
        angles = self._angle + np.concatenate([[0.0], np.cumsum(steps)])
        index = self._done + np.arange(n_time)
        # Estimates so far, those of the block from 1 on; 0 is the last one of the block before.
        last = index // self._ratio - -(-self._done // self._ratio) + 1
        held = before[last]
        angle = angles[last] + held * ((index % self._ratio) * (self._step / self._ratio))
        self._angle, self._rate, self._done = float(angles[-1]), float(before[-1]), self._done + n_time
        return angle, held
