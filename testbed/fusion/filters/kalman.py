"""The plain Kalman filter with fixed Q and R, several sample rates."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np
from pydantic import Field

from testbed.fusion.base import Rows, Switch
from testbed.fusion.kernels.covariance import kalman_kernel
from testbed.fusion.model_filter import CovarianceParameters, ModelFilter, Variance
from testbed.fusion.transitions import EVEN, Steps
from testbed.units import DEG

if TYPE_CHECKING:
    from collections.abc import Mapping

    from testbed.fusion.belief import SensorBelief
    from testbed.parts import Part
    from testbed.signals import FloatArray


class KalmanParameters(CovarianceParameters):
    """Parameters of `Kalman`.

    Parameters
    ----------
    R : dict of str to float
        Variance of a reading [rad^2/s^2] for sensors whose belief is to be overruled.
    """

    default_q: ClassVar[dict[int, float]] = {1: 0.3 * DEG**2, 2: 1e6 * DEG**2, 3: 1e10 * DEG**2}

    coloured: Switch = True
    R: dict[str, Variance] = Field(default={})


class Kalman(ModelFilter):
    r"""Kalman filter of the augmented model with fixed Q and R, in Joseph form.

    .. math:: x^- = F x,\; P^- = F P F' + Q,\; K = P^- H' (H P^- H' + R)^{-1},\; x = x^- + K e,\;
        P = (I - K H) P^- (I - K H)' + K R K'

    The readings of one instant are used one after the other, which for independent noise is the joint update. The state
    starts at zero; nothing is predicted before the first reading.

    Parameters
    ----------
    belief : mapping of str to SensorBelief
        Dynamics and noise of each sensor.
    sample_rate_hz : mapping of str to float
        Rate of each sensor [Hz].
    parameters : KalmanParameters
        Signal model and R.

    References
    ----------
    Paper 1 (doi 10.1109/TIM.2024.3375962), equations (8)-(13) with fixed R and r = 0.
    """

    Parameters: ClassVar[type[Part]] = KalmanParameters
    rows = Rows(per_sensor=("innovation", "innovation_variance"))
    fault_leaves = (0.4 * DEG, 0.1 * DEG)

    def __init__(
        self, belief: Mapping[str, SensorBelief], sample_rate_hz: Mapping[str, float], parameters: KalmanParameters
    ) -> None:
        super().__init__(belief, sample_rate_hz, parameters)
        self._R = self.measurement_noise("R", parameters.R, explicit=True).astype(self._x.dtype)
        self._outside = np.zeros(self._R.size, dtype=np.int64)
        self._started = False
        self._run = kalman_kernel(self._x.size, self._R.size, self._form, self.model.n_slow)

    def _advance(self, Z: FloatArray, out: FloatArray, steps: Steps = EVEN) -> None:
        progress = (self._clocked(steps), self._outside, self._started)
        self._started = self._run(self._x, self._P, self._F, self._Q, self._H, self._R, Z, *progress, out)
