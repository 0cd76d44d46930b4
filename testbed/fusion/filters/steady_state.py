"""The settled Kalman filter: constant gains, chosen for a signal and not by hand."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from testbed.fusion.analysis.optimum import optimum, settled_filters
from testbed.fusion.base import BlockFilter, EstimateBlock, FilterParameters
from testbed.fusion.kernels.covariance import (
    HEADER_ROWS,
    INNOVATION,
    INNOVATION_ROWS,
    INNOVATION_VARIANCE,
    RATE,
    STD,
    fixed_gain_kernel,
)
from testbed.parts import Part
from testbed.units import Frequency, Range

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import ArrayLike

    from testbed.fusion.belief import SensorBelief


class SteadyStateParameters(Part):
    """The signal that `SteadyState` is best for.

    Parameters
    ----------
    frequency : float
        Of a sine [Hz].
    amplitude : float
        Of that sine [rad/s].
    """

    frequency: Frequency = 10.0
    amplitude: Range = math.radians(1.0)


class SteadyState(BlockFilter):
    r"""Kalman filter with the gains of the periodic Riccati solution, order and q those of the `optimum` of a sine.

    .. math:: x^- = F x, \quad x = x^- + K_p (z - H x^-)

    p counts the steps of the cycle in which the readings of all sensors repeat. Nothing is tuned: gains follow from the
    belief's noise and from the sine named. A missing reading is left out; while none comes the claimed variance grows.

    Parameters
    ----------
    belief : mapping of str to SensorBelief
        Dynamics and noise of each sensor.
    sample_rate_hz : mapping of str to float
        Rate of each sensor [Hz].
    parameters : SteadyStateParameters
        The signal.

    References
    ----------
    Anderson, Moore, Optimal Filtering (1979), chapter 4.4 (time-invariant filter); several rates:
    `testbed.fusion.analysis.optimum`.
    """

    Parameters: ClassVar[type[Part]] = SteadyStateParameters

    def __init__(
        self, belief: Mapping[str, SensorBelief], sample_rate_hz: Mapping[str, float], parameters: SteadyStateParameters
    ) -> None:
        # Sensors without a belief are refused first, with the message that all filters share.
        super().__init__(belief, sample_rate_hz, FilterParameters(order=1, q=1.0))
        best = optimum(belief, sample_rate_hz, [(parameters.frequency, parameters.amplitude)])
        super().__init__(belief, sample_rate_hz, FilterParameters(order=best.order, q=best.q))
        fixed = settled_filters(belief, sample_rate_hz, order=best.order, q=np.array([best.q]))
        self._K = np.ascontiguousarray(fixed.K[:, 0])
        self._C = np.einsum("ij,pjk,ik->pi", self.model.H, fixed.prior[:, 0], self.model.H) + self.model.R
        self._settled = np.ascontiguousarray(fixed.posterior()[:, 0])
        self._progress = np.zeros(2 + len(self.model.H), dtype=np.int64)
        self._run = fixed_gain_kernel(self._x.size, len(self.model.H))

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
        model = self.model
        gains = (self._K, self._C, self._settled)
        self._run(self._x, self._P, model.F, model.Q, model.H, *gains, Z, self._progress, out)
        diagnostics = {}
        for i, name in enumerate(model.sensors):
            row = HEADER_ROWS + INNOVATION_ROWS * i
            diagnostics[f"innovation_{name}"] = out[row + INNOVATION]
            diagnostics[f"innovation_variance_{name}"] = out[row + INNOVATION_VARIANCE]
        return EstimateBlock(out[RATE], out[STD], diagnostics)
