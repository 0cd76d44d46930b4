"""The fibre-optic gyro: scale factor and bias by temperature, low-pass, mean over the output interval, noise, range."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import numpy as np
from numba import njit

from testbed.models.fog_thermal import FogThermal
from testbed.parts import Part
from testbed.sensors.base import Sensor
from testbed.sensors.data_sheet import GYRO_WORDS, Word
from testbed.sensors.decimation import Decimator, rate_ratio
from testbed.sensors.gyro_errors import GainError
from testbed.sensors.noise import GyroTerms
from testbed.sensors.noise_terms import NoiseStage
from testbed.sensors.stages import Surroundings
from testbed.signals import BASE_RATE_HZ, LinearFilter, random_stream, transfer
from testbed.units import Frequency, PositiveDuration, Quantity, Range, RatioPerKelvin

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from testbed.signals import ComplexArray, FloatArray

# The bound catches a step written in degC, which is read as an absolute temperature.
TemperatureStep = Annotated[float, Quantity("K", "62.5 mK", above=0.0, at_most=100.0)]


class Thermometer(Part):
    """The thermometer inside, read at the clock of the rate.

    Parameters
    ----------
    lag : float
        Time constant with which its place follows the ambient temperature [s].
    step : float
        One count [K].
    """

    lag: PositiveDuration = 900.0
    step: TemperatureStep = 0.0625


class Fog(Sensor, GyroTerms):
    r"""A fibre-optic or ring-laser gyro as its user sees it: the mean rate over each output interval, a temperature.

    .. math:: y_j = \frac{1}{T} \int_{t_j - T}^{t_j} L[(1 + s + s_T (T_c - T_0)) w + b] \, dt + n_j

    with the low-pass L, the thermal bias b and coil temperature T_c of `thermal`, and the noise n of the readings.
    Before t = 0 all has been as at t = 0.

    Parameters
    ----------
    bandwidth : float
        Half-power frequency of the first-order low-pass L [Hz].
    range : float
        Readings saturate at plus and minus this [rad/s].
    scale_factor_error : float
        s [-].
    scale_factor_temperature : float
        s_T [1/K].
    thermal : FogThermal
        Bias by temperature, and the temperatures inside.
    thermometer : Thermometer
        The thermometer inside.

    Notes
    -----
    Of the keys of data sheets it takes `output_rate`, `full_scale`, `rate_noise_density` (one-sided) and
    `in_run_bias_stability` (Allan floor); see `testbed.sensors.data_sheet`.
    """

    words: ClassVar[tuple[Word, ...]] = GYRO_WORDS

    bandwidth: Frequency
    range: Range
    scale_factor_error: GainError = 0.0
    scale_factor_temperature: RatioPerKelvin = 0.0
    thermal: FogThermal = FogThermal()
    thermometer: Thermometer = Thermometer()

    @property
    def truth_rate(self) -> float:
        """Rate of the truth that it needs on a base that is held [Hz]: its own; see `Sensor.truth_rate`."""
        return self.sample_rate

    @property
    def transfer_function(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Numerator and denominator of the low-pass in s [rad/s], highest power first."""
        corner = 2.0 * np.pi * self.bandwidth
        return (corner,), (1.0, corner)

    def response(self, freq_hz: ArrayLike) -> ComplexArray:
        """Return indicated over true rate at the reference temperature: scale factor, low-pass, mean of the 20 kHz
        samples.

        Parameters
        ----------
        freq_hz : array_like, shape (n_freq,)
            Frequency [Hz].

        Returns
        -------
        ndarray of complex, shape (n_freq,)
            Response [-].
        """
        freq = np.asarray(freq_hz, dtype=np.float64)
        numerator, denominator = self.transfer_function
        low_pass = transfer(list(numerator), list(denominator), freq)
        ratio = round(BASE_RATE_HZ / self.sample_rate)
        cycles = freq / BASE_RATE_HZ
        # The mean of `ratio` samples is a Dirichlet kernel; np.sinc(0) = 1 takes care of frequency zero.
        mean = np.sinc(ratio * cycles) / np.sinc(cycles) * np.exp(-1j * np.pi * (ratio - 1) * cycles)
        response: ComplexArray = (1.0 + self.scale_factor_error) * low_pass * mean
        return response

    def full_scale(self) -> float:
        """Return the largest rate that it can read [rad/s]."""
        return self.range

    def input_noise_psd(self, freq_hz: FloatArray) -> FloatArray:
        """Return the noise referred to the true rate, infinite above half the sample rate; see
        `Sensor.input_noise_psd`.
        """
        # A grid that ends at half the sample rate may end a rounding above it.
        seen = freq_hz <= 0.5 * self.sample_rate * (1.0 + 1e-9)
        density = np.full(freq_hz.shape, np.inf)
        gain = np.abs(self.response(freq_hz[seen])) ** 2
        density[seen] = self.noise_psd(freq_hz[seen], self.sample_rate) / gain
        return density

    def sheet_belief(self) -> dict[str, Any]:
        """Return low-pass, mean over the output interval and noise on the reading; see `Sensor.sheet_belief`.

        The mean is (1 - e^-x) / x, x = s T, taken as 1 / (1 + x/2 + x^2/12): 0.1 % off at a tenth of the sample rate.
        """
        numerator, low_pass = self.transfer_function
        mean = (1.0 / (12.0 * self.sample_rate**2), 0.5 / self.sample_rate, 1.0)
        return {
            "numerator": numerator,
            "denominator": tuple(map(float, np.polymul(low_pass, mean))),
            "output_noise": self.angle_random_walk,
            "range": self.range,
            **self.slow_terms(),
        }

    def datasheet(self) -> list[tuple[str, str]]:
        """Return noise and thermal coefficients in data-sheet units; see `Sensor.datasheet`."""
        hour, thermal = np.rad2deg(3600.0), self.thermal
        floor = (2.0 * np.log(2.0) / np.pi) ** 0.5
        allan = {tau: hour * self.allan_variance(tau) ** 0.5 for tau in (1.0, 100.0)}
        return [
            ("angle random walk N", f"{60.0 * np.rad2deg(self.angle_random_walk):.6g} deg/sqrt(h)"),
            ("bias instability B", f"{hour * self.bias_instability:.6g} deg/h"),
            ("its Allan floor, 0.664 B", f"{hour * floor * self.bias_instability:.6g} deg/h"),
            ("quantisation Q", f"{hour * self.quantization:.6g} arcsec"),
            *((f"Allan deviation at {tau:g} s, without thermal bias", f"{allan[tau]:.6g} deg/h") for tau in allan),
            ("Shupe term", f"{hour / 60.0 * thermal.shupe:.6g} deg/h/(K/min)"),
            ("gradient term", f"{hour * thermal.gradient:.6g} deg/h/K"),
            ("one count of the thermometer", f"{self.thermometer.step:g} K"),
        ]

    def start(self, input_rate_hz: float, seed: int, name: str) -> FogStage:
        """Return the gyro in equilibrium with its first sample; see `Sensor.start`."""
        return FogStage(self, input_rate_hz, seed, name)


class FogStage:
    """A fibre-optic gyro in time; made by `Fog.start`.

    `temperature` holds the thermometer's readings of the last block [K], at the instants of the rate; `drift` the
    thermal bias as its axis feels it [rad/s], at the input's clock. Coefficients that scatter are those of the seed,
    with noise and without: it says which cycle this is.
    """

    def __init__(self, fog: Fog, input_rate_hz: float, seed: int, name: str) -> None:
        self._fog, self._ratio = fog, rate_ratio(input_rate_hz, fog.sample_rate)
        self.separable = not fog.thermal.scatter
        self._thermal = fog.thermal.drawn(random_stream(seed, name, "scatter")).start(input_rate_hz)
        self._thermometer = Settled(LinearFilter([1.0], [fog.thermometer.lag, 1.0], input_rate_hz))
        numerator, denominator = fog.transfer_function
        self._low_pass = Settled(LinearFilter(list(numerator), list(denominator), input_rate_hz))
        self._mean, self._decimator = IntervalMean(self._ratio), Decimator(self._ratio)
        self._noise = NoiseStage(fog.noise_terms(fog.sample_rate, seed, name) if fog.noise else {})
        self.temperature: FloatArray = np.empty(0)
        self.drift: FloatArray = np.empty(0)

    def process(self, true_rate: FloatArray) -> FloatArray:
        """Return the readings [rad/s] that fall into a block of the true rate [rad/s], at the reference temperature."""
        return self.process_in(true_rate, Surroundings())

    def process_in(self, true_rate: FloatArray, surroundings: Surroundings) -> FloatArray:
        """Return the readings [rad/s] that fall into a block of the true rate [rad/s]."""
        return self.finish(self.clean(true_rate, surroundings))

    def clean(self, true_rate: FloatArray, surroundings: Surroundings) -> FloatArray:
        """Return what it would read without noise and range [rad/s]; see `SplitStage`."""
        fog, ambient = self._fog, surroundings.temperature
        if ambient is None:
            ambient = np.full(true_rate.size, fog.thermal.reference_temperature)
        self.drift = self._thermal.process(ambient)
        self.temperature = self._round(self._decimator.process(self._thermometer.process(ambient)))
        heat = self._thermal.coil_temperature - fog.thermal.reference_temperature
        gain = 1.0 + fog.scale_factor_error + fog.scale_factor_temperature * heat
        return self._mean.process(self._low_pass.process(gain * true_rate + self.drift))

    def finish(self, clean: FloatArray) -> FloatArray:
        """Return the readings that become of it [rad/s]; see `SplitStage`."""
        return np.clip(clean + self._noise.process(clean.size), -self._fog.range, self._fog.range)

    def _round(self, temperature: FloatArray) -> FloatArray:
        if not self._fog.noise:
            return temperature
        # Counts of 0 degC, as the chips have them.
        rounded: FloatArray = np.rint((temperature - 273.15) / self._fog.thermometer.step) * self._fog.thermometer.step
        return rounded + 273.15


class Settled:
    """A filter of gain one that has seen its first sample for ever, instead of rest.

    Parameters
    ----------
    linear : LinearFilter
        The filter, at rest.
    """

    def __init__(self, linear: LinearFilter) -> None:
        self._filter, self._first = linear, np.nan

    def process(self, u: FloatArray) -> FloatArray:
        """Return the filtered samples, shape (n_time,), unit of `u`."""
        if u.size and np.isnan(self._first):
            self._first = float(u[0])
        return self._filter.process(u - self._first) + self._first


@njit(cache=True)
def run_mean(u, state, y):  # type: ignore[no-untyped-def] # pragma: no cover
    """Fill `y` with the means of the intervals that end in `u`; return how many. State: [sum, samples, ratio]."""
    n = 0
    for k in range(u.size):
        state[0] += u[k]
        state[1] += 1.0
        if state[1] == state[2]:
            y[n] = state[0] / state[2]
            state[0] = state[1] = 0.0
            n += 1
    return n


class IntervalMean:
    """Mean of the `ratio` samples up to every `ratio`-th, beginning with the first, which counts for all before it.

    Any division into blocks gives the same bits.
    """

    def __init__(self, ratio: int) -> None:
        self._state, self._started = np.array([0.0, ratio - 1.0, float(ratio)]), False

    def process(self, u: FloatArray) -> FloatArray:
        """Return the means of the intervals that end in this block, unit of `u`."""
        if u.size and not self._started:
            self._state[0], self._started = self._state[1] * u[0], True
        means = np.empty(u.size)
        return means[: run_mean(u, self._state, means)].copy()
