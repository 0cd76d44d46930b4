"""Two sensors, each through a fixed linear path: what the complementary and the blending filter share."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from scipy.optimize import minimize_scalar

from testbed.fusion.base import BlockFilter, CommonParameters, Rows
from testbed.fusion.kernels.covariance import GATE, PATIENCE
from testbed.fusion.model import build_model
from testbed.fusion.two_paths.design import (
    HIGH_HZ,
    LOW_HZ,
    Paths,
    band_end,
    best_crossover,
    input_psd,
    low_pass,
    without_far_zeros,
)
from testbed.fusion.two_paths.kernel import MEMORY_ROWS, two_paths
from testbed.fusion.two_paths.noise import noise_variance
from testbed.units import Frequency, Range

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from testbed.fusion.belief import SensorBelief
    from testbed.fusion.model import FusionModel
    from testbed.parts import Part
    from testbed.signals import FloatArray


class TwoPathParameters(CommonParameters):
    """What a filter of two paths is made for; None is derived from the belief's noise.

    Parameters
    ----------
    crossover : float, optional
        Where the slow sensor takes over [Hz].
    bandwidth : float, optional
        Up to where the fast sensor is inverted [Hz].
    frequency, amplitude : float
        The sine that the bandwidth, and the claimed standard deviation, are for [Hz], [rad/s].
    """

    crossover: Frequency | None = None
    bandwidth: Frequency | None = None
    frequency: Frequency = 10.0
    amplitude: Range = math.radians(1.0)


class TwoPaths(BlockFilter):
    r"""A fast and a slow sensor through fixed paths, parameters derived from the belief's noise.

    The bandwidth is the one with the least error for the sine named, noise and lag A |1 - L| / sqrt(2). The claimed
    variance is that error: the noise part from the covariance of sensors and filter together (periodic, exact), the lag
    at its mean. While the fast sensor is missing the rate stays and the variance grows as such a sine departs from its
    value; while the slow one is missing its drift is added. A spike counts as missing, by the gate of the other
    filters.

    Parameters
    ----------
    belief : mapping of str to SensorBelief
        Dynamics and noise of two sensors.
    sample_rate_hz : mapping of str to float
        Rate of each sensor [Hz]; the sensor that is better at high frequency has the fastest.
    parameters : TwoPathParameters
        What it is made for.

    Raises
    ------
    ValueError
        If there are not two sensors, the faster one is not the better one at high frequency, or the sensors cannot be
        joined this way.
    """

    Parameters: ClassVar[type[Part]] = TwoPathParameters
    needs_both = True
    start_leaves = (math.radians(0.05), math.radians(0.1))

    def __init__(
        self, belief: Mapping[str, SensorBelief], sample_rate_hz: Mapping[str, float], parameters: TwoPathParameters
    ) -> None:
        super().__init__(belief, sample_rate_hz, parameters)
        self.model = build_model(belief, sample_rate_hz, order=1, q=0.0)
        self._slow, self._fast = _roles(belief, self.model)
        self.rows = Rows(once=(f"innovation_{self.model.sensors[self._slow]}",))
        clock = 2.0 * math.pi * self.model.sample_rate_hz
        slow, fast = (without_far_zeros(belief[self.model.sensors[i]], clock) for i in (self._slow, self._fast))
        order = self.order(fast)
        self.crossover_hz = parameters.crossover or best_crossover(slow, fast, order) / (2.0 * math.pi)
        power = parameters.amplitude**2 / 2.0

        def candidate(bandwidth_hz: float) -> tuple[Paths, FloatArray]:
            band = band_end(slow, fast, 2.0 * math.pi * bandwidth_hz)
            paths = self.paths(slow, fast, 2.0 * math.pi * self.crossover_hz, band)
            lag = power * abs(_band_error(band, parameters.frequency)) ** 2
            return paths, lag + noise_variance(paths, self.model, self._slow, self._fast)

        self.bandwidth_hz = parameters.bandwidth or _best_bandwidth(candidate, self.model.sample_rate_hz)
        paths, settled = candidate(self.bandwidth_hz)
        T = 1.0 / self.model.sample_rate_hz
        slowest = np.min(-np.roots(low_pass(order, 2.0 * math.pi * self.crossover_hz)[1]).real)
        low = np.array([1e-3 * self.crossover_hz])
        drift = float((2.0 * math.pi * low[0]) ** 2 * input_psd(fast)(low)[0])
        forgotten = math.sqrt(drift) / fast.output_noise
        patience = 2 * self.model.strides[self._slow]
        setting = (paths.innovate, T, 2.0 * math.pi * parameters.frequency, power, forgotten, drift)
        gate = (GATE**2, PATIENCE, self.model.R[self._fast], self.model.R[self._slow])
        self._setting = np.array([*setting, math.exp(-2.0 * slowest * T), patience, *gate])
        self._x, self._memory = np.zeros(len(paths.A)), np.zeros(MEMORY_ROWS)
        self._matrices = (*paths.discrete(T), paths.C, paths.D, paths.H, paths.J, settled)

    def order(self, fast: SensorBelief) -> int:
        """Return the order of the low-pass L at the crossover [-].

        Parameters
        ----------
        fast : SensorBelief
            The sensor that is better at high frequency.
        """
        raise NotImplementedError

    def paths(
        self, slow: SensorBelief, fast: SensorBelief, crossover: float, band: tuple[FloatArray, FloatArray]
    ) -> Paths:
        """Return the paths for a crossover and a band end.

        Parameters
        ----------
        slow, fast : SensorBelief
            The sensor that is better at low frequency, and the other.
        crossover : float
            [rad/s].
        band : tuple of ndarray, shapes (n_num,), (n_den,)
            Numerator and denominator of B in s.
        """
        raise NotImplementedError

    def _advance(self, Z: FloatArray, out: FloatArray) -> None:
        two_paths(self._x, self._memory, *self._matrices, self._setting, Z[self._fast], Z[self._slow], out)


def _roles(belief: Mapping[str, SensorBelief], model: FusionModel) -> tuple[int, int]:
    """Return the places of the sensor that is better at low frequency and of the other, which must be read at every
    step.
    """
    ends = np.array([input_psd(belief[name])(np.array([LOW_HZ, HIGH_HZ])) for name in model.sensors])
    slow = int(np.argmin(ends[:, 0]))
    fast = 1 - slow
    name = model.sensors[fast]
    if ends[fast, 1] > ends[slow, 1] or model.strides[fast] != 1 or belief[name].output_noise == 0.0:
        msg = (
            f"belief: expected {name!r}, the noisier sensor at low frequency, to be the quieter one at 1 kHz, "
            "to have the highest sample rate and an output_noise"
        )
        raise ValueError(msg)
    return slow, fast


def _band_error(band: tuple[FloatArray, FloatArray], freq_hz: float) -> complex:
    """Return 1 - B at a frequency [-]."""
    s = 2j * math.pi * freq_hz
    return complex(1.0 - np.polyval(band[0], s) / np.polyval(band[1], s))


def _best_bandwidth(candidate: Callable[[float], tuple[Paths, FloatArray]], sample_rate_hz: float) -> float:
    """Return the bandwidth with the least mean square error [Hz], up to a quarter of the sample rate."""

    def error(log_f: float) -> float:
        return math.log(candidate(math.exp(log_f))[1].mean())

    bounds = math.log(1.0), math.log(sample_rate_hz / 4.0)
    return math.exp(minimize_scalar(error, bounds=bounds, method="bounded", options={"xatol": 1e-2}).x)
