"""The settled Kalman filter: constant gains, chosen for a signal and not by hand."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from testbed.fusion.analysis.optimum import optimum, settled_filters
from testbed.fusion.base import BlockFilter, Rows
from testbed.fusion.kernels.covariance import fixed_gain_kernel
from testbed.fusion.model import build_model
from testbed.parts import Part
from testbed.units import Frequency, Range

if TYPE_CHECKING:
    from collections.abc import Mapping

    from testbed.fusion.belief import SensorBelief
    from testbed.signals import FloatArray


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
    r"""Kalman filter with the gains of the periodic Riccati solution, order and q those of the optimum of a sine.

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
    rows = Rows(per_sensor=("innovation", "innovation_variance"))

    def __init__(
        self, belief: Mapping[str, SensorBelief], sample_rate_hz: Mapping[str, float], parameters: SteadyStateParameters
    ) -> None:
        super().__init__(belief, sample_rate_hz, parameters)
        best = optimum(belief, sample_rate_hz, [(parameters.frequency, parameters.amplitude)])
        self.model = build_model(belief, sample_rate_hz, order=best.order, q=best.q)
        self._x, self._P = np.zeros(len(self.model.F)), self.model.P0.copy()
        fixed = settled_filters(belief, sample_rate_hz, order=best.order, q=np.array([best.q]))
        self._K = np.ascontiguousarray(fixed.K[:, 0])
        self._C = np.einsum("ij,pjk,ik->pi", self.model.H, fixed.prior[:, 0], self.model.H) + self.model.R
        self._settled = np.ascontiguousarray(fixed.posterior()[:, 0])
        self._progress = np.zeros(2 + len(self.model.H), dtype=np.int64)
        self._run = fixed_gain_kernel(self._x.size, len(self.model.H))

    def _advance(self, Z: FloatArray, out: FloatArray) -> None:
        model, gains = self.model, (self._K, self._C, self._settled)
        self._run(self._x, self._P, model.F, model.Q, model.H, *gains, Z, self._progress, out)
