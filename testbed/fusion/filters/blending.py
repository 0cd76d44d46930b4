"""Closed-loop blending: the integrated fast sensor, its drift held by the slow one through a proportional-integral
loop.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from testbed.fusion.two_paths.base import TwoPaths
from testbed.fusion.two_paths.design import Paths, inverse, realised, zeros_at_dc

if TYPE_CHECKING:
    from testbed.fusion.belief import SensorBelief
    from testbed.signals import FloatArray


class Blending(TwoPaths):
    r"""Closed-loop blending of an inverted fast sensor with a slow one.

    .. math:: \hat\omega = B\, z_{fast} / G_{fast} + u, \quad \dot u = k_p e + c, \quad \dot c = k_i e, \quad
        e = z_{slow} - G_{slow} \hat\omega

    The inverse integrates what the fast sensor does not see at low frequency, and with it the noise; u takes that drift
    away. With k_p = sqrt(2) w, k_i = w^2 the loop is a Butterworth low-pass of order 2, the error 1 - L starts with
    s^2: an offset of the fast sensor, which the complementary filter of order 1 turns into a constant error, is
    integrated away. The slow sensor is modelled, not inverted. A missing reading of it is a zero innovation. The loop
    closes on what B leaves out, too: the lag is (1 - B)(1 - L).

    Parameters
    ----------
    belief : mapping of str to SensorBelief
        Dynamics and noise of two sensors.
    sample_rate_hz : mapping of str to float
        Rate of each sensor [Hz].
    parameters : TwoPathParameters
        What it is made for.

    References
    ----------
    Brown, Hwang, Introduction to Random Signals and Applied Kalman Filtering (2012), chapter 8 (feedback form of the
    complementary filter); Franklin, Powell, Workman, Digital Control of Dynamic Systems (1998), chapter 4 (sampled
    loops).
    """

    def order(self, fast: SensorBelief) -> int:
        """Return the order of the loop [-].

        Parameters
        ----------
        fast : SensorBelief
            The sensor that is better at high frequency.
        """
        return 2

    def paths(
        self, slow: SensorBelief, fast: SensorBelief, crossover: float, band: tuple[FloatArray, FloatArray]
    ) -> Paths:
        """Return the inverse with the loop around it; states [u, the inverse's, c, the slow sensor's].

        Parameters
        ----------
        slow, fast : SensorBelief
            The sensor that is better at low frequency, and the other.
        crossover : float
            Natural frequency of the loop [rad/s].
        band : tuple of ndarray, shapes (n_num,), (n_den,)
            Numerator and denominator of B in s.

        Raises
        ------
        ValueError
            If the fast sensor's inverse is unstable or integrates more than once.
        """
        zeros = zeros_at_dc(fast)
        if zeros > 1:
            msg = (
                f"belief: expected at most one zero at s = 0 for the fast sensor, got {zeros}; "
                "`complementary` takes more"
            )
            raise ValueError(msg)
        a, b = inverse(fast)
        # Its slowest mode comes first: for a sensor blind at s = 0 that is the integrator, which the loop feeds too.
        numerator, denominator = np.polymul(band[0], a), np.polymul(band[1], np.append(b, np.zeros(zeros)))
        direct = realised(np.asarray(numerator, float), np.asarray(denominator, float))
        model = slow.realisation()
        first = 1 - zeros
        n = first + direct.B.size
        c, end = n, n + 1 + model.B.size
        A, B, C, E, H = np.zeros((end, end)), np.zeros(end), np.zeros(end), np.zeros(end), np.zeros(end)
        A[first:n, first:n], B[first:n], C[:n] = direct.A, direct.B, np.append(np.ones(first), direct.C)
        A[0, c] = 1.0
        A[c + 1 :, c + 1 :] = model.A
        A[c + 1 :] += np.outer(model.B, C)
        B[c + 1 :] = model.B * direct.D
        E[0], E[c] = math.sqrt(2.0) * crossover, crossover**2
        H[c + 1 :] = model.C
        return Paths(A=A, B=B, E=E, C=C, D=direct.D, H=H + model.D * C, J=model.D * direct.D, innovate=True)
