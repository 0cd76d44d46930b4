"""The settled Kalman filter: constant gains, chosen for a signal and not by hand."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from testbed.fusion.analysis.optimum import optimum
from testbed.fusion.base import BlockFilter, CommonParameters, Rows, Switch
from testbed.fusion.kernels.covariance import COUNTS, EVERY, settling_kernel
from testbed.fusion.model import build_model
from testbed.fusion.model_filter import initial_state
from testbed.units import DEG, Frequency, Range

if TYPE_CHECKING:
    from collections.abc import Mapping

    from testbed.fusion.belief import SensorBelief
    from testbed.parts import Part
    from testbed.signals import FloatArray

# Seconds between two looks at the gains.
_CHECK_EVERY = 1.0


class SteadyStateParameters(CommonParameters):
    """The signal that `SteadyState` is best for, and its start.

    Parameters
    ----------
    frequency : float
        Of a sine [Hz].
    amplitude : float
        Of that sine [rad/s].
    coloured : bool
        Give the belief's slow noise (1/f, turn-on bias, rate random walk) states of its own.
    """

    frequency: Frequency = 10.0
    amplitude: Range = math.radians(1.0)
    coloured: Switch = True


class SteadyState(BlockFilter):
    r"""Kalman filter that stops computing its covariance once it has settled, order and q those of the `optimum` of a
    sine.

    .. math:: x^- = F x, \quad x = x^- + K_p (z - H x^-)

    p counts the steps of the cycle in which the readings of all sensors repeat. Nothing is tuned: gains follow from the
    belief's noise and from the sine named. From the start, and from the settled covariance on after every missing
    reading, K_p is that of the recursion, until no gain changes by more than 1e-3 of itself within a second; gains made
    for two sensors, applied while one is silent, would be unstable. With states of 1/f noise they never settle within
    an hour.

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
    start_leaves = (0.0045 * DEG, 0.0045 * DEG)
    fault_leaves = (0.4 * DEG, 0.1 * DEG)

    def __init__(
        self, belief: Mapping[str, SensorBelief], sample_rate_hz: Mapping[str, float], parameters: SteadyStateParameters
    ) -> None:
        super().__init__(belief, sample_rate_hz, parameters)
        best = optimum(belief, sample_rate_hz, [(parameters.frequency, parameters.amplitude)])
        self.model = build_model(
            belief,
            sample_rate_hz,
            order=best.order,
            q=best.q,
            coloured=parameters.coloured,
            start=parameters.start,
        )
        n, n_sensor = len(self.model.F), len(self.model.H)
        n_step = math.lcm(*self.model.strides)
        self._x, self._P = initial_state(self.model, parameters), self.model.P0.copy()
        self._cycle = (
            np.zeros((n_step, n, n_sensor)),
            np.zeros((n_step, n_sensor)),
            np.zeros((n_step, n, n)),
            np.zeros((n, n_sensor)),
        )
        self._progress = np.zeros(COUNTS + n_sensor, dtype=np.int64)
        self._progress[EVERY] = round(_CHECK_EVERY * self.model.sample_rate_hz)
        self._run = settling_kernel(n, n_sensor, self.model.n_slow)

    def _advance(self, Z: FloatArray, out: FloatArray) -> None:
        model = self.model
        self._run(self._x, self._P, model.F, model.Q, model.H, model.R, Z, self._cycle, self._progress, out)
