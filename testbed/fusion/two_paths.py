r"""Two sensors, each through a fixed linear path: what the complementary and the blending filter share.

The fast path inverts the sensor that is quieter at high frequency, up to a bandwidth; the slow path takes the other one over below a
crossover. Both are low-passes of the form that the settled Kalman filter of a signal of order m has,

.. math:: L_m(s) = 1 - s^m / b_m(s / w)\,w^{-m},

b_m the Butterworth polynomial: they lag in the m-th derivative only.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from scipy.linalg import expm
from scipy.optimize import minimize_scalar
from scipy.signal import buttap

from testbed.fusion.base import BlockFilter, EstimateBlock, FilterParameters
from testbed.fusion.belief import SensorBelief
from testbed.fusion.kernels import RATE, STD
from testbed.fusion.two_path_kernel import MEMORY_ROWS, OUT_ROWS, SLOW_INNOVATION, two_paths
from testbed.parts import Part
from testbed.units import Frequency, Range

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from numpy.typing import ArrayLike

    from testbed.fusion.belief import Realisation
    from testbed.fusion.model import FusionModel
    from testbed.signals import FloatArray

# Order of the band end: the rate through three integrators, as in the optimum of most signals.
BAND_ORDER = 3
# Where the two sensors are compared, and the crossover is looked for.
LOW_HZ, HIGH_HZ = 1e-5, 1e3
_DOUBLINGS = 40


class TwoPathParameters(Part):
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


def low_pass(order: int, w: float, poles: int | None = None) -> tuple[FloatArray, FloatArray]:
    """Return numerator and denominator of L with 1 - L = O(s^order), highest power first.

    Parameters
    ----------
    order : int
        Power of s that 1 - L starts with [-].
    w : float
        Corner of the Butterworth poles [rad/s].
    poles : int, optional
        Their number [-]; `order` if not given, more make L fall faster.
    """
    n = poles or order
    a = np.real(np.poly(buttap(n)[1])) * w ** np.arange(n + 1)
    return a[-order:], a


def input_psd(sensor: SensorBelief) -> Callable[[FloatArray], FloatArray]:
    """Return the two-sided input-referred noise density of a belief, Hz -> rad^2/s.

    Parameters
    ----------
    sensor : SensorBelief
        Dynamics and noise.
    """
    realised = sensor.realisation()

    def psd(freq_hz: FloatArray) -> FloatArray:
        density: FloatArray = sensor.input_noise**2 + sensor.output_noise**2 / np.abs(realised.response(freq_hz)) ** 2
        return density

    return psd


def best_crossover(slow: SensorBelief, fast: SensorBelief, order: int) -> float:
    r"""Return the corner w [rad/s] of L that leaves the least noise.

    .. math:: \min_w \int |L|^2 S_{slow} + |1 - L|^2 S_{fast}\, df

    by trapezoid in ln f from 1e-5 Hz to 1 kHz, 100 points per decade. For white noise N of the slow sensor and n (1 + (w_c / w)^2)^(1/2) of
    the fast one it is w_c n / N for order 1 and w_c n / N / sqrt(3) for order 2.

    Parameters
    ----------
    slow, fast : SensorBelief
        The sensor that is better at low frequency, and the other.
    order : int
        Order of L.
    """
    freq = np.logspace(math.log10(LOW_HZ), math.log10(HIGH_HZ), 801)
    s = 2j * np.pi * freq
    of_slow, of_fast = input_psd(slow)(freq), input_psd(fast)(freq)

    def noise(log_w: float) -> float:
        b, a = low_pass(order, math.exp(log_w))
        L = np.polyval(b, s) / np.polyval(a, s)
        return math.log(np.trapezoid((np.abs(L) ** 2 * of_slow + np.abs(1.0 - L) ** 2 * of_fast) * freq, np.log(freq)))

    bounds = math.log(2.0 * math.pi * LOW_HZ), math.log(2.0 * math.pi * HIGH_HZ)
    return math.exp(minimize_scalar(noise, bounds=bounds, method="bounded", options={"xatol": 1e-4}).x)


def band_end(slow: SensorBelief, fast: SensorBelief, bandwidth: float) -> tuple[FloatArray, FloatArray]:
    """Return numerator and denominator of the `low_pass` B that makes either sensor's inverse proper.

    Parameters
    ----------
    slow, fast : SensorBelief
        The sensors.
    bandwidth : float
        Corner of B [rad/s].
    """
    excess = max(len(one.denominator) - _numerator(one).size for one in (slow, fast))
    return low_pass(BAND_ORDER, bandwidth, BAND_ORDER + max(excess - 1, 0))


def _numerator(sensor: SensorBelief) -> FloatArray:
    return np.trim_zeros(np.array(sensor.numerator), "f")


def inverse(sensor: SensorBelief) -> tuple[FloatArray, FloatArray]:
    """Return numerator and denominator of the inverse of a sensor, zeros at s = 0 left out.

    Parameters
    ----------
    sensor : SensorBelief
        Its belief.

    Raises
    ------
    ValueError
        If the inverse is unstable.
    """
    b = np.trim_zeros(_numerator(sensor), "b")
    if np.any(np.roots(b).real >= 0.0):
        msg = f"belief: expected a sensor whose inverse is stable, got the zeros {np.roots(b).tolist()} rad/s"
        raise ValueError(msg)
    return np.array(sensor.denominator), b


def realised(numerator: FloatArray, denominator: FloatArray) -> Realisation:
    """Return the modal realisation of a transfer function.

    Parameters
    ----------
    numerator, denominator : ndarray, shapes (n_num,), (n_den,)
        Coefficients in s, highest power first.
    """
    return SensorBelief(numerator=tuple(numerator), denominator=tuple(denominator)).realisation()


def zeros_at_dc(sensor: SensorBelief) -> int:
    """Return how many zeros a sensor has at s = 0 [-].

    Parameters
    ----------
    sensor : SensorBelief
        Its belief.
    """
    b = np.array(sensor.numerator)
    return b.size - np.trim_zeros(b, "b").size


class TwoPaths(BlockFilter):
    r"""A fast and a slow sensor through fixed paths, parameters derived from the belief's noise.

    The bandwidth is the one with the least error for the sine named, noise and lag A |1 - L| / sqrt(2). The claimed variance is that
    error: the noise part from the covariance of sensors and filter together (periodic, exact), the lag at its mean. While the fast sensor is
    missing the rate stays and the variance grows as such a sine departs from its value; while the slow one is missing its drift is added.

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
        If there are not two sensors, the faster one is not the better one at high frequency, or the sensors cannot be joined this way.
    """

    Parameters: ClassVar[type[Part]] = TwoPathParameters

    def __init__(
        self, belief: Mapping[str, SensorBelief], sample_rate_hz: Mapping[str, float], parameters: TwoPathParameters
    ) -> None:
        super().__init__(belief, sample_rate_hz, FilterParameters(order=1, q=0.0))
        self._slow, self._fast = _roles(belief, self.model)
        slow, fast = (belief[self.model.sensors[i]] for i in (self._slow, self._fast))
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
        self._setting = np.array([*setting, math.exp(-2.0 * slowest * T), patience])
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
        out = np.empty((OUT_ROWS, Z.shape[1]))
        two_paths(self._x, self._memory, *self._matrices, self._setting, Z[self._fast], Z[self._slow], out)
        name = self.model.sensors[self._slow]
        return EstimateBlock(out[RATE], out[STD], {f"innovation_{name}": out[SLOW_INNOVATION]})


def _roles(belief: Mapping[str, SensorBelief], model: FusionModel) -> tuple[int, int]:
    """Return the places of the sensor that is better at low frequency and of the other, which must be read at every step."""
    if len(model.sensors) != 2:
        msg = f"belief: expected two sensors to divide the band between, got {list(model.sensors)}"
        raise ValueError(msg)
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


def noise_variance(paths: Paths, model: FusionModel, slow: int, fast: int) -> FloatArray:
    """Return the variance that the sensors' noise leaves at each step of the cycle [rad^2/s^2], shape (n_step,).

    Covariance of [states of the sensors, x, fast reading, held value] with the true rate at zero, step by step over the cycle of slow
    readings, settled by doubling.

    Parameters
    ----------
    paths : Paths
        The filter.
    model : FusionModel
        The sensors: F, Q, H, R of order 1.
    slow, fast : int
        Which sensor is which.

    Raises
    ------
    ValueError
        If the error does not settle: the loop around the slow sensor is unstable.
    """
    M, W, read = _joint_steps(paths, model, slow, fast)
    around = np.linalg.multi_dot([*M[::-1], np.eye(len(read))])
    if np.max(np.abs(np.linalg.eigvals(around))) >= 1.0:
        msg = "crossover: expected one well inside the band of the slow sensor, got an unstable loop; give a lower one"
        raise ValueError(msg)
    total = np.zeros_like(around)
    for step, noise in zip(M, W, strict=True):
        total = step @ total @ step.T + noise
    for _ in range(_DOUBLINGS):
        total, around = total + around @ total @ around.T, around @ around
    variance = []
    for step, noise in zip(M, W, strict=True):
        total = step @ total @ step.T + noise
        variance.append(read @ total @ read)
    return np.array(variance)


def _joint_steps(
    paths: Paths, model: FusionModel, slow: int, fast: int
) -> tuple[list[FloatArray], list[FloatArray], FloatArray]:
    """Return transition and noise of each step of the cycle, and the row that reads the error."""
    F, Q, H = model.F[1:, 1:], model.Q[1:, 1:], model.H[:, 1:]
    Phi, Gamma, ramp, E = paths.discrete(1.0 / model.sample_rate_hz)
    n, m = len(F), len(Phi)
    z, held = n + m, n + m + 1
    move = np.eye(held + 1)
    move[:n, :n] = F
    move[z, :] = 0.0
    move[z, :n] = H[fast] @ F
    move[n:z, n:z], move[n:z, z], move[n:z, held] = Phi, Gamma - ramp, E
    move[n:z, :n] = np.outer(ramp, H[fast] @ F)
    # Process noise and the noise of the fast reading enter the sensors, the reading and, through its slope, the filter.
    enter = np.zeros((held + 1, n + 1))
    enter[:n, :n], enter[z] = np.eye(n), [*H[fast], 1.0]
    enter[n:z] = np.outer(ramp, enter[z])
    noise = enter @ np.block([[Q, np.zeros((n, 1))], [np.zeros((1, n)), model.R[fast]]]) @ enter.T
    take = np.eye(held + 1)
    take[held, :n], take[held, held] = H[slow], 0.0
    if paths.innovate:
        take[held, n:z], take[held, z] = -paths.H, -paths.J
    due = take @ noise @ take.T
    due[held, held] += model.R[slow]
    pause = model.strides[slow] - 1
    read = np.zeros(held + 1)
    read[n:z], read[z] = paths.C, paths.D
    return [take @ move, *[move] * pause], [due, *[noise] * pause], read
