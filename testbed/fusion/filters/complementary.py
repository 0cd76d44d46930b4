"""The complementary filter: a low-pass of the inverted slow sensor, the matching high-pass of the inverted fast one."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import block_diag

from testbed.fusion.two_paths.base import TwoPaths
from testbed.fusion.two_paths.design import Paths, inverse, low_pass, realised, zeros_at_dc

if TYPE_CHECKING:
    from testbed.fusion.belief import SensorBelief
    from testbed.signals import FloatArray


class Complementary(TwoPaths):
    r"""Fixed complementary filter of two inverted sensors.

    .. math:: \hat\omega = B \left( L \frac{z_{slow}}{G_{slow}} + (1 - L) \frac{z_{fast}}{G_{fast}} \right)

    L = w_c / (s + w_c): the paths add up to B, which is 1 up to the bandwidth (`testbed.fusion.two_paths.design`). For
    a fast sensor whose noise rises as 1/f towards low frequency and white noise of the slow one no causal L is better;
    one more zero of the fast sensor at s = 0 makes it one order higher. While the slow sensor is missing its reading is
    predicted from the estimate.

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
    Brown, Hwang, Introduction to Random Signals and Applied Kalman Filtering (2012), chapter 8 (complementary filter);
    Higgins, IEEE Trans. Aerospace and Electronic Systems 11 (1975) 321-325 (its equivalence to the settled Kalman
    filter).
    """

    def order(self, fast: SensorBelief) -> int:
        """Return the number of zeros of the fast sensor at s = 0 that 1 - L has to cancel, at least one [-].

        Parameters
        ----------
        fast : SensorBelief
            The sensor that is better at high frequency.
        """
        return max(zeros_at_dc(fast), 1)

    def paths(
        self, slow: SensorBelief, fast: SensorBelief, crossover: float, band: tuple[FloatArray, FloatArray]
    ) -> Paths:
        """Return both paths side by side, and the slow sensor's model driven by their sum.

        Parameters
        ----------
        slow, fast : SensorBelief
            The sensor that is better at low frequency, and the other.
        crossover : float
            [rad/s].
        band : tuple of ndarray, shapes (n_num,), (n_den,)
            Numerator and denominator of B in s.

        Raises
        ------
        ValueError
            If a sensor's inverse is unstable.
        """
        order = self.order(fast)
        of_slow, poles = low_pass(order, crossover)
        # The zeros of 1 - L at s = 0 take those of the fast sensor away.
        of_fast = np.concatenate([poles[:-order], np.zeros(order - zeros_at_dc(fast))])
        low, high = (
            realised(_product(share, band[0], a), _product(poles, band[1], b))
            for share, (a, b) in ((of_slow, inverse(slow)), (of_fast, inverse(fast)))
        )
        model = slow.realisation()
        C, none = np.concatenate([low.C, high.C]), np.zeros(model.B.size)
        return Paths(
            A=np.block(
                [
                    [block_diag(low.A, high.A), np.zeros((C.size, none.size))],
                    [np.outer(model.B, C), model.A],
                ]
            ),
            B=np.concatenate([np.zeros(low.B.size), high.B, high.D * model.B]),
            E=np.concatenate([low.B, np.zeros(high.B.size), none]),
            C=np.concatenate([C, none]),
            D=high.D,
            H=np.concatenate([model.D * C, model.C]),
            J=model.D * high.D,
            innovate=False,
        )


def _product(first: FloatArray, second: FloatArray, third: FloatArray) -> FloatArray:
    return np.asarray(np.polymul(np.polymul(first, second), third), float)
