r"""What a filter knows before its first reading: the covariance of the augmented state at t = 0.

`unknown`: the record begins in mid-motion. The sensors are in equilibrium with a constant rate of standard deviation
`dc`, beside an alternating part of standard deviation `ac`,

.. math:: P_0 = \sigma_{dc}^2\, g g' + \sigma_{ac}^2\, \mathrm{diag}(1, |h_i|^2) + P_{own},

g the states for a unit constant rate, h those of the sensors for a unit sine of 0.5 Hz. `rest`: the rate is known (to
1e-5 deg/s), and the sensors are in equilibrium with it; only P_own is left, the stationary covariance of the sensors'
own noise, without which the first reading of a sensor whose noise passes its dynamics would count as exact.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from scipy.linalg import solve_continuous_lyapunov

if TYPE_CHECKING:
    from collections.abc import Sequence

    from testbed.fusion.belief import SensorBelief
    from testbed.signals import ComplexArray, FloatArray

StartKind = Literal["unknown", "rest"]

# More is neither needed, since readings soon outweigh it (a record may begin inside 200 deg/s), nor harmless: with 289
# deg/s, an even spread over 500 deg/s, P loses a factor of 200 more of its digits.
_CONSTANT_STD = math.radians(20.0)
# A rest is known to this [rad/s], below what any of the sensors tells in hours; a claim of 0 would be no claim.
REST_STD = math.radians(1e-5)
_ALTERNATING_SHARE = 0.1
_ALTERNATING_HZ = 0.5


@dataclass(frozen=True)
class Spread:
    """What an unknown start leaves open.

    Parameters
    ----------
    constant, alternating : float
        Standard deviation of the constant and of the alternating part of the rate [rad/s].
    """

    constant: float
    alternating: float


def unknown_spread(believed: Sequence[SensorBelief]) -> Spread:
    """Return the spread of an unknown start: constant 20 deg/s, or that of an even one over the widest range of the
    sensors that see a constant rate if it is less; a tenth of it alternates.

    Parameters
    ----------
    believed : sequence of SensorBelief
        The sensors.
    """
    ranges = [one.range for one in believed if one.range is not None and one.sees_constant]
    constant = min(_CONSTANT_STD, max(ranges) / math.sqrt(3.0)) if ranges else _CONSTANT_STD
    return Spread(constant, _ALTERNATING_SHARE * constant)


def own_covariance(A: FloatArray, Qc: FloatArray) -> FloatArray:
    r"""Return the stationary covariance of the states that forget, driven by their own noise alone.

    .. math:: A P + P A' + Q_c = 0

    A state that never forgets (no decay, nothing that feeds it) is left at zero.

    Parameters
    ----------
    A, Qc : ndarray, shape (n_state, n_state)
        Dynamics [1/s] and density of the noise [rad^2/s^3] of sensors and noise states, without the signal.

    Returns
    -------
    ndarray, shape (n_state, n_state)
        Covariance [rad^2/s^2].

    References
    ----------
    Bartels, Stewart, Comm. ACM 15 (1972) 820-826.
    """
    forgets = np.any(A != 0.0, axis=1)
    P = np.zeros_like(A)
    if forgets.any():
        kept = np.ix_(forgets, forgets)
        found = solve_continuous_lyapunov(A[kept], -Qc[kept])
        P[kept] = 0.5 * (found + found.T)
    return P


def constant_response(A: FloatArray, drive: FloatArray) -> FloatArray:
    """Return the states for a unit constant input, -A^-1 B [-], shape (n_state,); zero for those that never forget.

    Parameters
    ----------
    A : ndarray, shape (n_state, n_state)
        Dynamics [1/s].
    drive : ndarray, shape (n_state,)
        How the input enters, B [1/s].
    """
    forgets = np.any(A != 0.0, axis=1)
    g = np.zeros(len(A))
    g[forgets] = -np.linalg.solve(A[np.ix_(forgets, forgets)], drive[forgets])
    return g


def alternating_response(A: FloatArray, drive: FloatArray) -> ComplexArray:
    """Return the states for a unit sine of 0.5 Hz [-], complex, shape (n_state,); arguments as `constant_response`."""
    turn = 2j * np.pi * _ALTERNATING_HZ
    return np.asarray(np.linalg.solve(turn * np.eye(len(A)) - A, drive.astype(complex)), complex)
