"""Two sensors, each through a fixed linear path: what the complementary and the blending filter share."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np
from scipy.linalg import expm

from testbed.errors import quoted
from testbed.fusion.base import BlockFilter, CommonParameters, Rows
from testbed.fusion.kernels.covariance import NODES
from testbed.fusion.model import build_model
from testbed.fusion.schedule import even_rates
from testbed.fusion.start import REST_STD, constant_response, unknown_spread
from testbed.fusion.transitions import EVEN, N_NODE, Steps
from testbed.fusion.two_paths.design import (
    BAND_ORDER,
    HIGH_HZ,
    LOW_HZ,
    at,
    band_end,
    best_crossover,
    input_psd,
    inverted,
    low_pass,
    over,
    without_far_zeros,
    zeros_at_dc,
)
from testbed.fusion.two_paths.kernel import MEMORY_ENTRIES, VARIANCE, two_paths
from testbed.fusion.two_paths.loop import Loop, butterworth_loop
from testbed.fusion.two_paths.noise import alone_variance, noise_variance, slow_variance
from testbed.fusion.two_paths.paths import parallel
from testbed.units import Frequency, Range

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from testbed.fusion.belief import SensorBelief
    from testbed.fusion.model import FusionModel
    from testbed.fusion.realisation import Realisation
    from testbed.parts import Part
    from testbed.signals import ComplexArray, FloatArray

# Modes of the slow path slower than this [rad/s] keep what they got wrong at the start, of a sine of this frequency;
# its mean is taken over so many seconds.
_SLOW_MODES, _ALTERNATING_HZ, _MEAN_OVER = 3.0, 0.5, 5.0


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


class Lag(NamedTuple):
    """How the slow path by itself errs for a sine of the amplitude that the filter is made for.

    Parameters
    ----------
    freq_hz : float
        The frequency named [Hz].
    of : callable
        Mean square of the error, Hz -> rad^2/s^2.
    """

    freq_hz: float
    of: Callable[[FloatArray], FloatArray]


class TwoPaths(BlockFilter):
    r"""A fast and a slow sensor through inverses of their own, and a loop between them.

    .. math:: \hat\omega = B\, z_{fast} / G_{fast} + u, \quad \dot u = k e + c, \quad \dot c = q e - z c, \quad
        e = B\, z_{slow} / G_{slow} - \hat\omega

    Settled it is the sum of a low-pass L of the slow path, which k, q and z say (`testbed.fusion.two_paths.loop`), w_c
    for short, and the matching high-pass of the fast one. From an unknown start, and after each loss, k follows the
    scalar Riccati equation, :math:`w' = w_c^2 - w^2`, which is w coth(w t): the slow path's mean at first, the loop
    later. From a known rest it is w tanh(w t).

    The bandwidth is the one with the least error for the sine named, noise and lag A |1 - B| / sqrt(2). The claimed
    variance is that error, the noise part from the covariance of sensors and filter together (periodic, exact), slow
    noise by its density, and what the loop has not settled yet. While the fast sensor is missing the variance grows as
    such a sine departs from its value, until the slow path alone is better and is followed. While the slow one is
    missing the fast one is integrated and its drift added.

    Where readings have stamps, or rates of another ratio, each path moves by its exact transition: the slow one to its
    own readings, the fast one and the loop at those of the fast sensor. The design is that of the nearest whole ratio,
    and the claim the mean over its cycle.

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
        If there are not two sensors, the faster one is not the better one at high frequency, the slower one sees no
        constant rate, or the sensors cannot be joined this way.
    """

    Parameters: ClassVar[type[Part]] = TwoPathParameters
    any_clock = True
    needs_both = True
    # Of the low-pass L at a crossover that is given.
    order: ClassVar[int]
    start_leaves = (math.radians(0.05), math.radians(0.1))

    def __init__(
        self, belief: Mapping[str, SensorBelief], sample_rate_hz: Mapping[str, float], parameters: TwoPathParameters
    ) -> None:
        super().__init__(belief, sample_rate_hz, parameters)
        even = sample_rate_hz if self.schedule.even else even_rates(sample_rate_hz)
        self.model = build_model(belief, even, order=1, q=0.0)
        self.model.check_cycle()
        _refuse_delay({name: belief[name] for name in self.model.sensors})
        self._slow, self._fast = _roles(belief, self.model)
        self.rows = Rows(once=(f"innovation_{self.model.sensors[self._slow]}",))
        slow, fast = (belief[self.model.sensors[i]] for i in (self._slow, self._fast))
        slow_rate_hz = self.model.sample_rate_hz / self.model.strides[self._slow]
        readings = slow
        slow = without_far_zeros(slow, math.pi * slow_rate_hz)

        def come(freq_hz: FloatArray) -> ComplexArray:
            return _as_they_come(readings, freq_hz, slow_rate_hz) / slow.realisation().response(freq_hz)

        fast = without_far_zeros(fast, 2.0 * math.pi * self.model.sample_rate_hz)
        if zeros_at_dc(fast) > 1:
            msg = f"belief: expected at most one zero at s = 0 for the fast sensor, got {zeros_at_dc(fast)}"
            raise ValueError(msg)
        power = parameters.amplitude**2 / 2.0
        named = np.array([parameters.frequency])
        alone_band, alone = _best_alone(slow, slow_rate_hz, parameters.frequency, power, complex(come(named)[0]))

        def lateness(freq_hz: FloatArray) -> ComplexArray:
            return 1.0 - over(alone_band, freq_hz) * come(freq_hz)

        late = complex(lateness(named)[0])
        if parameters.crossover is None:
            loop = self._best_loop(
                slow, fast, alone_band, Lag(parameters.frequency, lambda f: power * np.abs(lateness(f)) ** 2)
            )
        else:
            loop = butterworth_loop(self.order, 2.0 * math.pi * parameters.crossover)
        self.loop, self.crossover_hz = loop, loop.crossover / (2.0 * math.pi)
        low = loop.low_pass()
        share = at(low, parameters.frequency)

        def candidate(bandwidth_hz: float) -> FloatArray:
            band = band_end(slow, fast, 2.0 * math.pi * bandwidth_hz)
            whole = power * abs((1.0 - share) * (1.0 - at(band, parameters.frequency)) + share * late) ** 2
            paths = parallel(slow, fast, loop, band)
            return whole + noise_variance(paths, self.model, self._slow, self._fast)

        self.bandwidth_hz = parameters.bandwidth or _best_bandwidth(candidate, self.model.sample_rate_hz)
        settled = candidate(self.bandwidth_hz)
        # Readings of another ratio never repeat.
        self._settled = settled if self.schedule.even else settled.mean(keepdims=True)
        band = band_end(slow, fast, 2.0 * math.pi * self.bandwidth_hz)
        T = 1.0 / self.model.sample_rate_hz
        beginning = _beginning(slow, inverted(slow, alone_band))
        self._inverses = inverted(fast, band), inverted(slow, alone_band)
        of_fast, of_slow = (_stepped(one, [T]) for one in self._inverses)
        self._paths: tuple[tuple[Any, ...], ...] = (of_fast, (*of_slow, beginning.modes))
        self._x = tuple(np.zeros(path[0].shape[1]) for path in self._paths)
        fading = -math.expm1(-loop.leak * T) / loop.leak if loop.leak else T
        rest = parameters.start == "rest"
        spread = unknown_spread([belief[name] for name in self.model.sensors])
        unknown = spread.constant**2 + spread.alternating**2
        density = float(input_psd(slow)(np.array([self.crossover_hz]))[0])
        self._setting = np.array(
            [
                T,
                loop.crossover,
                loop.slope_gain * fading,
                loop.gain / loop.crossover,
                density,
                alone,
                2.0 * math.pi * parameters.frequency,
                power,
                2.0 * self.model.strides[self._slow],
                parameters.rest_rate if rest else math.nan,
                math.exp(-beginning.slowest * T),
                _drift(fast, 1e-3 * self.crossover_hz),
                parameters.rest_rate * fast.numerator[-1] / fast.denominator[-1] if rest else 0.0,
                math.sqrt(_drift(fast, 1e-3 * self.crossover_hz)) / fast.output_noise,
                slow_variance(slow, fast, low),
                parameters.rest_rate * slow.numerator[-1] / slow.denominator[-1] if rest else 0.0,
                beginning.share * spread.alternating,
                spread.alternating**2,
                math.exp(-2.0 * beginning.fastest * T),
                _MEAN_OVER * slow_rate_hz,
                slow_rate_hz / (math.sqrt(2.0) * math.pi * _ALTERNATING_HZ),
                math.exp(-loop.leak * T),
            ]
        )
        self._memory = np.zeros(MEMORY_ENTRIES)
        self._memory[VARIANCE] = REST_STD**2 if rest else unknown

    def _best_loop(self, slow: SensorBelief, fast: SensorBelief, band: tuple[FloatArray, FloatArray], lag: Lag) -> Loop:
        """Return the loop for what is believed of the noise, of the slow path's band end, and of how it errs."""
        freq_hz = lag.freq_hz
        return butterworth_loop(
            self.order, best_crossover(slow, fast, self.order, freq_hz, float(lag.of(np.array([freq_hz]))[0]))
        )

    def _advance(self, Z: FloatArray, out: FloatArray, steps: Steps = EVEN) -> None:
        if steps is not EVEN and len(self._paths[0][0]) == 1:
            T = 1.0 / self.model.sample_rate_hz
            spans = np.arange(N_NODE) / NODES * T
            # To the bit what a filter of regular steps has.
            spans[NODES] = T
            between = (_stepped(one, spans) for one in self._inverses)
            self._paths = tuple((*new[:3], *old[3:]) for new, old in zip(between, self._paths, strict=True))
        memory = (self._memory, self._settled, self._setting)
        two_paths(*self._x, *self._paths, *memory, Z[self._fast], Z[self._slow], steps, out)


def _stepped(path: Realisation, spans: Sequence[float] | FloatArray) -> tuple[Any, ...]:
    """Return (Phi, Gamma, ramp, C, D, still) of a path, the first three for each length of a step [s], exact for an
    input linear between samples.
    """
    n = path.B.size
    powers = np.empty((len(spans), n + 2, n + 2))
    for power, span in zip(powers, spans, strict=True):
        block = np.zeros((n + 2, n + 2))
        block[:n, :n], block[:n, n], block[n, n + 1] = path.A * span, path.B * span, 1.0
        power[:] = expm(block)
    matrices = (powers[:, :n, :n].copy(), powers[:, :n, n].copy(), powers[:, :n, n + 1].copy())
    return (*matrices, path.C, path.D, constant_response(path.A, path.B))


def _roles(belief: Mapping[str, SensorBelief], model: FusionModel) -> tuple[int, int]:
    """Return the places of the sensor that is better at low frequency and of the other, which must be read at every
    step.
    """
    ends = np.array([input_psd(belief[name])(np.array([LOW_HZ, HIGH_HZ])) for name in model.sensors])
    slow = int(np.argmin(ends[:, 0]))
    fast = 1 - slow
    if not belief[model.sensors[slow]].sees_constant:
        msg = (
            f"belief: expected {quoted(model.sensors[slow])}, the quieter sensor at low frequency, to see a constant "
            "rate; without that the error grows without bound"
        )
        raise ValueError(msg)
    name = model.sensors[fast]
    if ends[fast, 1] > ends[slow, 1] or model.strides[fast] != 1 or belief[name].output_noise == 0.0:
        msg = (
            f"belief: expected {quoted(name)}, the noisier sensor at low frequency, to be the quieter one at 1 kHz, "
            "to have the highest sample rate and an output_noise"
        )
        raise ValueError(msg)
    return slow, fast


def _refuse_delay(belief: Mapping[str, SensorBelief]) -> None:
    late = [name for name, one in belief.items() if one.delay > 0.0]
    if late:
        msg = f"belief: expected sensors without a delay, got {late}: no inverse makes up for one; `kalman` takes it"
        raise ValueError(msg)


def _as_they_come(slow: SensorBelief, freq_hz: FloatArray, sample_rate_hz: float) -> ComplexArray:
    """Return readings over a sine, held for their interval: half of it late; shape of the frequencies [-].

    The mean over an interval, as optical gyros read, has its first zero at the rate of the readings.
    """
    held: ComplexArray = np.exp(-1j * np.pi * freq_hz / sample_rate_hz)
    return slow.realisation().response(freq_hz) * held


def _drift(fast: SensorBelief, freq_hz: float) -> float:
    """Return the density of the white noise whose integral the fast path's noise is at low frequency [rad^2/s^3]."""
    response = abs(fast.realisation().response(np.array([freq_hz]))[0])
    return float((2.0 * math.pi * freq_hz * fast.output_noise / response) ** 2)


class _Beginning(NamedTuple):
    """What the slow path does that begins in equilibrium with its first reading of a rate that alternates.

    Parameters
    ----------
    modes : ndarray, shape (n_state,)
        Its slow modes in equilibrium with a unit reading [-], zero for the others.
    share : float
        What they make of the rate [-].
    slowest, fastest : float
        How fast the slowest of them decays, and the slowest of the others [1/s].
    """

    modes: FloatArray
    share: float
    slowest: float
    fastest: float


def _beginning(slow: SensorBelief, inverse: Realisation) -> _Beginning:
    """Return what the inverse of the slow sensor does at its beginning."""
    rate = -np.diag(inverse.A)
    lasting = (rate > 0.0) & (rate < _SLOW_MODES)
    modes = np.where(lasting, constant_response(inverse.A, inverse.B), 0.0)
    reading = abs(slow.realisation().response(np.array([_ALTERNATING_HZ]))[0])
    share = float(np.abs(inverse.C * modes).sum() * reading)
    slowest = float(rate[lasting].min()) if lasting.any() else 1.0
    return _Beginning(modes, share, slowest, float(rate[~lasting].min()))


def _best_alone(
    slow: SensorBelief, sample_rate_hz: float, freq_hz: float, power: float, come: complex
) -> tuple[tuple[FloatArray, FloatArray], float]:
    """Return the band end with which the slow sensor alone errs least for a sine, and that error [rad^2/s^2].

    `come` is how its readings come at the sine, over the model that is inverted [-]. Its poles are two more than the
    inverse needs, so that the steps of readings that are held do not come through.
    """
    from scipy.optimize import minimize_scalar

    def band_of(bandwidth_hz: float) -> tuple[FloatArray, FloatArray]:
        excess = slow.n_state - np.trim_zeros(np.array(slow.numerator), "f").size + 1
        return low_pass(BAND_ORDER, 2.0 * math.pi * bandwidth_hz, BAND_ORDER + excess + 1)

    def error(log_f: float) -> float:
        band = band_of(math.exp(log_f))
        lag = power * abs(1.0 - at(band, freq_hz) * come) ** 2
        return math.log(lag + alone_variance(slow, band, sample_rate_hz))

    highest = sample_rate_hz / 8.0
    bounds = math.log(min(1.0, 0.1 * highest)), math.log(highest)
    best = minimize_scalar(error, bounds=bounds, method="bounded", options={"xatol": 1e-2})
    return band_of(math.exp(best.x)), math.exp(best.fun)


def _best_bandwidth(candidate: Callable[[float], FloatArray], sample_rate_hz: float) -> float:
    """Return the bandwidth with the least mean square error [Hz], up to a quarter of the sample rate."""
    from scipy.optimize import minimize_scalar

    def error(log_f: float) -> float:
        return math.log(candidate(math.exp(log_f)).mean())

    bounds = math.log(1.0), math.log(sample_rate_hz / 4.0)
    return math.exp(minimize_scalar(error, bounds=bounds, method="bounded", options={"xatol": 1e-2}).x)
