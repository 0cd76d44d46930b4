"""The plain Kalman filter with fixed Q and R, several sample rates."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np
from pydantic import Field

from testbed.fusion.base import DEG, BlockFilter, CovarianceParameters, EstimateBlock, Variance
from testbed.fusion.kernels.covariance import (
    HEADER_ROWS,
    INNOVATION,
    INNOVATION_ROWS,
    INNOVATION_VARIANCE,
    RATE,
    STD,
    kalman_kernel,
)

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import ArrayLike

    from testbed.fusion.belief import SensorBelief
    from testbed.parts import Part


class KalmanParameters(CovarianceParameters):
    """Parameters of `Kalman`.

    Parameters
    ----------
    R : dict of str to float
        Variance of a reading [rad^2/s^2] for sensors whose belief is to be overruled.
    """

    default_q: ClassVar[dict[int, float]] = {1: 0.3 * DEG**2, 2: 1e6 * DEG**2, 3: 1e10 * DEG**2}

    R: dict[str, Variance] = Field(default={})


class Kalman(BlockFilter):
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

    def __init__(
        self, belief: Mapping[str, SensorBelief], sample_rate_hz: Mapping[str, float], parameters: KalmanParameters
    ) -> None:
        super().__init__(belief, sample_rate_hz, parameters)
        self._R = self.measurement_noise("R", parameters.R, explicit=True).astype(self._x.dtype)
        self._outside = np.zeros(self._R.size, dtype=np.int64)
        self._started = False
        self._run = kalman_kernel(self._x.size, self._R.size, self._form)

    def process(self, readings: Mapping[str, ArrayLike]) -> EstimateBlock:
        """Filter the next block.

        Parameters
        ----------
        readings : mapping of str to array_like, shape (n_sensor_samples,)
            Readings that are due in the block [rad/s]; not finite means predict only.

        Returns
        -------
        EstimateBlock
            At the fastest rate, shape (n_time,).

        Raises
        ------
        ValueError
            If a sensor is missing, unknown or has not as many readings as are due.
        """
        Z = self.spread(readings)
        out = np.empty((HEADER_ROWS + INNOVATION_ROWS * len(Z), Z.shape[1]))
        progress = (self._outside, self._started)
        self._started = self._run(self._x, self._P, self._F, self._Q, self._H, self._R, Z, *progress, out)
        diagnostics = {}
        for i, name in enumerate(self.model.sensors):
            row = HEADER_ROWS + INNOVATION_ROWS * i
            diagnostics[f"innovation_{name}"] = out[row + INNOVATION]
            diagnostics[f"innovation_variance_{name}"] = out[row + INNOVATION_VARIANCE]
        return EstimateBlock(out[RATE], out[STD], diagnostics)
