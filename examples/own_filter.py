"""A filter of one's own, whole: a fixed first-order blend of two sensors (docs/filters.md, "Your own filter")."""

import numpy as np
from numba import njit

from testbed.fusion.base import BlockFilter, CommonParameters
from testbed.fusion.kernels.covariance import RATE, STD
from testbed.fusion.model import build_model
from testbed.fusion.model_filter import initial_state
from testbed.units import Frequency, Range


class BlendParameters(CommonParameters):
    """Up to where the fast sensor is followed, where the slow one takes over [Hz], what lag the claims allow [rad/s].

    Parameters
    ----------
    bandwidth, crossover, lag : float
    """

    bandwidth: Frequency = 1000.0
    crossover: Frequency = 0.01
    lag: Range = np.radians(0.006)


class Blend(BlockFilter):
    r"""Two first-order loops, :math:`\dot\omega = w_1 e_1 + w_2 e_2`, e what a reading has beyond the sensor's model.

    References
    ----------
    Franklin, Powell, Workman, Digital Control of Dynamic Systems (1998), chapter 8 (estimators of given gain).
    """

    Parameters, needs_both = BlendParameters, True
    fault_leaves = np.radians(1.5), np.radians(0.3)

    def __init__(self, belief, sample_rate_hz, parameters):
        super().__init__(belief, sample_rate_hz, parameters)
        w, low, fast = 2 * np.pi * parameters.bandwidth, parameters.crossover, self.schedule.strides.index(1)
        seen = abs(belief[self.schedule.sensors[fast]].realisation().response(np.array([low]))[0])
        loops = np.where(np.arange(2) == fast, w, 2 * np.pi * low + w * seen)
        lag, start = w * parameters.lag**2, parameters.start
        self._model = model = build_model(belief, sample_rate_hz, order=1, q=lag, start=start)
        self._K = np.outer(loops * model.strides / model.sample_rate_hz, np.eye(len(model.F))[0])
        self._x, self._P = initial_state(model, parameters), model.P0.copy()

    def _advance(self, Z, out):
        blend(self._x, self._P, self._model.F, self._model.Q, self._model.H, self._model.R, self._K, Z, out)


@njit(cache=True)
def blend(x, P, F, Q, H, R, K, Z, out):
    """Correct the model's rate by the gains, and carry the covariance of what is left, gaps included."""
    for k in range(Z.shape[1]):
        x[:], P[:] = F @ x, F @ P @ F.T + Q
        for i in range(2):
            if np.isfinite(Z[i, k]):
                A = np.eye(len(x)) - np.outer(K[i], H[i])
                x[:], P[:] = A @ x + K[i] * Z[i, k], A @ P @ A.T + R[i] * np.outer(K[i], K[i])
        out[RATE, k], out[STD, k] = x[0], np.sqrt(P[0, 0])
