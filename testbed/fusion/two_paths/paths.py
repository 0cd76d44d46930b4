"""Both paths and the loop between them as one linear system, for the covariance of what they leave."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import block_diag, expm

from testbed.fusion.realisation import Realisation
from testbed.fusion.two_paths.design import inverted

if TYPE_CHECKING:
    from testbed.fusion.belief import SensorBelief
    from testbed.fusion.two_paths.loop import Loop
    from testbed.signals import FloatArray


@dataclass(frozen=True)
class Paths:
    r"""The two paths in continuous time: x' = A x + B z + E h, rate = C x + D z, predicted slow reading = H x + J z.

    z is the fast reading, h what is held of the slow one: the reading, or what it has beyond the prediction.

    Parameters
    ----------
    A : ndarray, shape (n_state, n_state)
        Dynamics [1/s].
    B, E, C, H : ndarray, shape (n_state,)
        Inputs [1/s] and outputs [-].
    D, J : float
        Feed-through [-].
    innovate : bool
        h is the innovation of the slow sensor and not its reading.
    """

    A: FloatArray
    B: FloatArray
    E: FloatArray
    C: FloatArray
    D: float
    H: FloatArray
    J: float
    innovate: bool

    def discrete(self, T: float) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return (Phi, Gamma, ramp, E) over a step T [s], exact for z linear and h constant between samples.

        Parameters
        ----------
        T : float
            Step [s].
        """
        n = len(self.A)
        block = np.zeros((n + 3, n + 3))
        block[:n, :n], block[:n, n], block[:n, n + 2] = self.A * T, self.B * T, self.E * T
        block[n, n + 1] = 1.0
        power = expm(block)
        Phi, Gamma, ramp, E = power[:n, :n], power[:n, n], power[:n, n + 1], power[:n, n + 2]
        return Phi.copy(), Gamma.copy(), ramp.copy(), E.copy()


def parallel(slow: SensorBelief, fast: SensorBelief, loop: Loop, band: tuple[FloatArray, FloatArray]) -> Paths:
    """Return both paths side by side with a fixed share each, and the slow sensor's model driven by their sum.

    Parameters
    ----------
    slow, fast : SensorBelief
        The sensor that is better at low frequency, and the other, of at most one zero at s = 0.
    loop : Loop
        The shares: L and 1 - L.
    band : tuple of ndarray, shapes (n_num,), (n_den,)
        Numerator and denominator of B in s.

    Raises
    ------
    ValueError
        If a sensor's inverse is unstable.
    """
    low, high = _low(inverted(slow, band), loop), _high(inverted(fast, band), loop)
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


def _low(path: Realisation, loop: Loop) -> Realisation:
    """Return L behind the slow path y: u' = k (y - u) + c, c' = q (y - u) - z c, of which u is what the loop adds."""
    n = path.B.size
    A, B = np.zeros((n + 2, n + 2)), np.zeros(n + 2)
    A[:n, :n], B[:n] = path.A, path.B
    for row, gain in ((n, loop.gain), (n + 1, loop.slope_gain)):
        A[row, :n], A[row, n], B[row] = gain * path.C, -gain, gain * path.D
    A[n, n + 1], A[n + 1, n + 1] = 1.0, -loop.leak
    return _bare(Realisation(A, B, np.append(np.zeros(n), [1.0, 0.0]), 0.0), loop)


def _high(path: Realisation, loop: Loop) -> Realisation:
    """Return 1 - L behind the fast path y: d = y - u, u' = k d + c, c' = q d - z c.

    An integrator of the path and that of u make one state, their difference: on its own neither would ever settle.
    """
    grows = ~path.A.any(axis=1)
    rest, n = np.ix_(~grows, ~grows), int(np.sum(~grows))
    d = np.append(path.C[~grows], [1.0, 0.0])
    A, B = np.zeros((n + 2, n + 2)), np.zeros(n + 2)
    A[:n, :n], B[:n] = path.A[rest], path.B[~grows]
    A[n], B[n] = -loop.gain * d, path.C[grows] @ path.B[grows] - loop.gain * path.D
    A[n + 1], B[n + 1] = loop.slope_gain * d, loop.slope_gain * path.D
    A[n, n + 1] -= 1.0
    A[n + 1, n + 1] -= loop.leak
    return _bare(Realisation(A, B, d, path.D), loop)


def _bare(joined: Realisation, loop: Loop) -> Realisation:
    """Return it without the state of a slope that the loop does not have."""
    if loop.slope_gain:
        return joined
    return Realisation(joined.A[:-1, :-1], joined.B[:-1], joined.C[:-1], joined.D)
