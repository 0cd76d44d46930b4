"""The settled Kalman filter: constant gains, chosen for a signal and not by hand."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from testbed.fusion.analysis.even import EvenDesign, most_even
from testbed.fusion.analysis.optimum import Optimum, optimum
from testbed.fusion.base import BlockFilter, CommonParameters, Rows, Switch
from testbed.fusion.kernels.covariance import COUNTS, EVERY, PRESENT, settling_kernel
from testbed.fusion.model import TIME_UNIT, build_model
from testbed.fusion.model_filter import initial_state
from testbed.fusion.schedule import even_rates
from testbed.fusion.transitions import EVEN, Steps, even, transition_nodes
from testbed.units import DEG, Frequency, Range

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from testbed.fusion.belief import SensorBelief
    from testbed.parts import Part
    from testbed.signals import FloatArray

# Seconds between two looks at the gains.
_CHECK_EVERY = 1.0
# Standard deviation that the rate is granted to depart from its last value while no sensor is read, over the amplitude:
# a sine departs by 1, but for a whole period and not from step to step anew, as the recursion takes it.
_DEPARTURE = 3.0


class SteadyStateParameters(CommonParameters):
    """The signal that `SteadyState` is best for, and its start.

    Parameters
    ----------
    frequency : float, optional
        Of a sine [Hz]; left out: no frequency from 0.1 to 500 Hz is to cost much more than its optimum.
    amplitude : float
        Of the sine [rad/s].
    coloured : bool
        Give the belief's slow noise (1/f, turn-on bias, rate random walk) states of its own.
    """

    frequency: Frequency | None = None
    amplitude: Range = math.radians(1.0)
    coloured: Switch = True


class SteadyState(BlockFilter):
    r"""Kalman filter that stops computing its covariance once it has settled, made for a sine or evenly for all.

    Order and q are those of the `optimum` of the sine, or the ones that no sine makes much worse than its own.

    .. math:: x^- = F x, \quad x = x^- + K_p (z - H x^-)

    p counts the steps of the cycle in which the readings of all sensors repeat. Nothing is tuned: gains follow from the
    belief's noise and from the sine named. From the start, and from the settled covariance on after every missing
    reading, K_p is that of the recursion, until no gain changes by more than 1e-3 of itself within a second; gains made
    for two sensors, applied while one is silent, would be unstable. With states of 1/f noise they never settle within
    an hour. While a sensor is missing q is that of the same design for those that are left; while all are, the rate is
    believed to depart by no more than three amplitudes from its last value.

    Where readings have stamps, or rates of another ratio, the cycle has no end: the gains stay those of the recursion,
    its order and q those of the nearest whole ratios.

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
    any_clock = True
    rows = Rows(per_sensor=("innovation", "innovation_variance"))
    start_leaves = (0.0045 * DEG, 0.0045 * DEG)
    fault_leaves = (0.4 * DEG, 0.1 * DEG)

    def __init__(
        self, belief: Mapping[str, SensorBelief], sample_rate_hz: Mapping[str, float], parameters: SteadyStateParameters
    ) -> None:
        super().__init__(belief, sample_rate_hz, parameters)
        even = sample_rate_hz if self.schedule.even else even_rates(sample_rate_hz)
        best = _design(belief, even, parameters)
        q, self._granted = _of_those_left(belief, even, parameters, best)
        *others, self.model = (
            build_model(
                belief,
                sample_rate_hz,
                order=best.order,
                q=one,
                coloured=parameters.coloured,
                start=parameters.start,
                any_ratio=True,
            )
            for one in q
        )
        self._Q = np.array([one.Q for one in (*others, self.model)])
        self._densities = np.array([one.Qc for one in (*others, self.model)])
        self._nodes: tuple[FloatArray, FloatArray] | None = None
        n, n_sensor = len(self.model.F), len(self.model.H)
        n_step = math.lcm(*self.model.strides) if self.schedule.even else 1
        self._x, self._P = initial_state(self.model, parameters), self.model.P0.copy()
        self._cycle = (
            np.zeros((n_step, n, n_sensor)),
            np.zeros((n_step, n_sensor)),
            np.zeros((n_step, n, n)),
            np.zeros((n, n_sensor)),
        )
        self._progress = np.zeros(COUNTS + n_sensor, dtype=np.int64)
        self._progress[EVERY] = round(_CHECK_EVERY * self.model.sample_rate_hz)
        self._progress[PRESENT] = len(self._Q) - 1
        self._last = np.array([self._x[0], self._P[0, 0], (_DEPARTURE * parameters.amplitude) ** 2])
        self._run = settling_kernel(n, n_sensor, self.model.n_slow)

    def _advance(self, Z: FloatArray, out: FloatArray, steps: Steps = EVEN) -> None:
        model, memory = self.model, (self._cycle, self._progress, self._last, self._granted)
        self._run(self._x, self._P, model.F, self._Q, model.H, model.R, Z, self._clocked(steps), *memory, out)

    def _clocked(self, steps: Steps) -> tuple[Any, ...]:
        """Return `steps` and the tables as the kernel takes them; between stamps no gain is looked at again."""
        if steps is EVEN:
            return even(self.model.F, self._Q)
        if self._nodes is None:
            self._progress[EVERY] = np.iinfo(np.int64).max
            step = 1.0 / self.model.sample_rate_hz
            F, Q = zip(*(transition_nodes(self.model.A, one, step) for one in self._densities), strict=True)
            self._nodes = F[0], np.array(Q)
        return (*steps, *self._nodes)


def _design(
    belief: Mapping[str, SensorBelief],
    sample_rate_hz: Mapping[str, float],
    parameters: SteadyStateParameters,
    orders: Sequence[int] = (1, 2, 3),
) -> Optimum | EvenDesign:
    """Return the order and the signal noise for the sensors that have a rate."""
    if parameters.frequency is None:
        return most_even(belief, sample_rate_hz, parameters.amplitude, orders=orders)
    return optimum(belief, sample_rate_hz, [(parameters.frequency, parameters.amplitude)], orders=orders)


def _of_those_left(
    belief: Mapping[str, SensorBelief],
    sample_rate_hz: Mapping[str, float],
    parameters: SteadyStateParameters,
    best: Optimum | EvenDesign,
) -> tuple[list[float], FloatArray]:
    r"""Return for every set of sensors, bit i of its number for sensor i, the signal noise and what it grants to the
    derivatives of the rate, shape (2^n_sensor, order).

    Where none of a set sees a constant rate no filter settles: signal noise of the whole, nothing taken off. Else a
    sine of amplitude A is believed to be no faster than the filter, which ends at :math:`(q / S)^{1 / 2m}`.
    """
    sensors, q = list(sample_rate_hz), []
    granted = np.full((2 ** len(sensors), best.order), np.inf)
    for number in range(len(granted) - 1):
        left = {name: sample_rate_hz[name] for i, name in enumerate(sensors) if number >> i & 1}
        if not any(belief[name].sees_constant for name in left):
            q.append(best.q)
            continue
        q.append(_design(belief, left, parameters, (best.order,)).q)
        density = 1.0 / sum(1.0 / _white(belief[name]) for name in left)
        end = TIME_UNIT * (q[-1] / density) ** (0.5 / best.order)
        granted[number, 1:] = (parameters.amplitude * end ** np.arange(1, best.order)) ** 2
    return [*q, best.q], granted


def _white(belief: SensorBelief) -> float:
    """Return the input-referred white noise of a sensor at the middle of its band [rad^2/s]."""
    return belief.input_noise**2 + (belief.output_noise / belief.largest_gain()) ** 2
