"""The MEMS gyro: constant errors, input-referred noise, low-pass, decimation, reading clock, word, lost readings."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import numpy as np
from pydantic import Field, model_validator

from testbed.sensors.base import Sensor
from testbed.sensors.converter import Converter, rounding_psd
from testbed.sensors.data_sheet import GYRO_WORDS, LOW_PASSES, Sheet, Word, low_pass_schema
from testbed.sensors.gyro_errors import AgedSampler, Fir, GyroErrors
from testbed.sensors.noise import GyroTerms
from testbed.sensors.noise_terms import NoiseStage, Ramp
from testbed.sensors.sampled_noise import Rational
from testbed.sensors.stages import Surroundings
from testbed.signals import BASE_RATE_HZ, LinearFilter, random_stream, transfer
from testbed.units import Frequency, Quantity, Range, RateStd

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Self

    from numpy.typing import ArrayLike

    from testbed.sensors.clock import TickSampler
    from testbed.sensors.decimation import Decimator
    from testbed.signals import ComplexArray, FloatArray

WordSensitivity = Annotated[float, Quantity("LSB*s/rad", "2621440 LSB/(deg/s)", above=0.0)]
# A stated total noise is a typical figure: as far as this from what density and bandwidth make it is no contradiction.
_TRUSTED = 0.15
Coefficients = Annotated[tuple[Annotated[float, Field(allow_inf_nan=False)], ...], Field(min_length=1, max_length=33)]


def _whole_word(given: dict[str, Any]) -> float:
    """Return the sensitivity [LSB s/rad] of a word that spans the range, from the fields read before."""
    return float(2 ** (given.get("word_bits", 32) - 1) - 1) / float(given.get("range", 1.0))


class MemsGyro(GyroErrors, Sensor, GyroTerms):
    """A MEMS gyro as its user sees it: readings in rad/s.

    One chain: true rate, constant errors, noise, low-pass, decimation filter, reading clock, dead band, range and word,
    lost readings. The noise is referred to the rate and passes the low-pass with it, as in the real chip; it is drawn
    behind it, at the rate of the readings, or at the clock of the run where `fir` or `jitter` follow. The low-pass is
    given either by its coefficients or as a second order with `corner` and `damping`.

    Parameters
    ----------
    numerator, denominator : tuple of float, optional
        Low-pass in s [rad/s], highest power first.
    corner : float, optional
        Natural frequency of a second-order low-pass [Hz].
    damping : float
        Its damping ratio [-].
    range : float
        Readings saturate at plus and minus this [rad/s].
    word_bits : int
        Length of the output word, two's complement [-].
    sensitivity : float
        Counts per rate of the output word [LSB s/rad]; left out, the word spans the range.
    total_rms_noise : float, optional
        What the data sheet says that the noise comes to [rad/s]: compared with what it does, see `doubts`.

    Notes
    -----
    Data sheets have other keys, which are read too: `output_rate`, `full_scale`, `rate_noise_density` (one-sided),
    `in_run_bias_stability` (Allan floor), `bandwidth` (-3 dB) with `order` (2); see `testbed.sensors.data_sheet`.
    """

    any_clock = True
    words: ClassVar[tuple[Word, ...]] = GYRO_WORDS

    numerator: Coefficients | None = None
    denominator: Coefficients | None = None
    corner: Frequency | None = None
    damping: Annotated[float, Field(gt=0.0, allow_inf_nan=False)] = 0.5**0.5
    range: Range
    word_bits: Annotated[int, Field(strict=True, ge=2, le=32)] = 32
    sensitivity: WordSensitivity = Field(default_factory=_whole_word)
    total_rms_noise: RateStd | None = None

    @classmethod
    def sheet(cls, values: Mapping[str, Any], *, border: bool) -> Sheet:
        """Return the keys of a file with those of data sheets turned into parameters; see `Sensor.sheet`."""
        sheet = super().sheet(values, border=border)
        sheet.translate_low_pass()
        return sheet

    @classmethod
    def sheet_schema(cls) -> dict[str, Any]:
        """Return the JSON schema of the keys of data sheets; see `Sensor.sheet_schema`."""
        return {**super().sheet_schema(), **low_pass_schema()}

    @classmethod
    def known_keys(cls) -> list[str]:
        """Return every key that may stand in a file; see `Sensor.known_keys`."""
        return [*super().known_keys(), *LOW_PASSES[-1]]

    @classmethod
    def ways(cls) -> tuple[tuple[tuple[str, ...], ...], ...]:
        """Return the keys that say the same; see `Sensor.ways`."""
        return (*super().ways(), LOW_PASSES)

    @model_validator(mode="after")
    def _one_low_pass(self) -> Self:
        given = [self.numerator is not None, self.denominator is not None]
        if given != [self.corner is None] * 2:
            msg = "expected either numerator and denominator or corner"
            raise ValueError(msg)
        numerator, denominator = self.transfer_function
        if len(numerator) > len(denominator) or not denominator[0]:
            msg = f"numerator: expected at most the denominator's degree, got {len(numerator) - 1}"
            raise ValueError(msg)
        if np.any(np.roots(denominator).real >= 0.0):
            msg = "denominator: expected roots with negative real parts, got an unstable low-pass"
            raise ValueError(msg)
        return self

    @model_validator(mode="after")
    def _young_enough(self) -> Self:
        if self.jitter and self.clocked(BASE_RATE_HZ):
            msg = "jitter: expected none beside a clock of its own or a rate that does not divide the run's 20 kHz"
            raise ValueError(msg)
        if self.jitter > 1.0 / self.sample_rate:
            msg = (
                f"jitter: expected at most one period of the readings, {1e3 / self.sample_rate:g} ms, "
                f"got {self.jitter!r} s"
            )
            raise ValueError(msg)
        return self

    @property
    def resolution(self) -> float:
        """One count of the word [rad/s]."""
        return 1.0 / self.sensitivity

    @property
    def transfer_function(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Numerator and denominator of the low-pass in s [rad/s], highest power first."""
        if self.numerator is not None and self.denominator is not None:
            return self.numerator, self.denominator
        natural = 2.0 * np.pi * (self.corner or 0.0)
        return (natural**2,), (1.0, 2.0 * self.damping * natural, natural**2)

    def response(self, freq_hz: ArrayLike) -> ComplexArray:
        """Return indicated over true rate at the reference temperature: scale factor, low-pass, decimation, mean age.

        Asymmetry and dead band, which are not linear, are left out.

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
        low_pass = transfer(np.array(numerator), np.array(denominator), freq)
        clock = self.clock_response(freq, self.sample_rate, BASE_RATE_HZ)
        return (1.0 + self.scale_factor_error) * low_pass * clock

    def full_scale(self) -> float:
        """Return the largest rate that it can read [rad/s]."""
        return float(min(self.range, (2 ** (self.word_bits - 1) - 1) / self.sensitivity))

    def input_noise_psd(self, freq_hz: FloatArray) -> FloatArray:
        """Return the noise referred to the true rate; see `Sensor.input_noise_psd`."""
        rounding = rounding_psd(self.resolution, self.sample_rate)
        terms = self.noise_psd(freq_hz) / (1.0 + self.scale_factor_error) ** 2
        density: FloatArray = terms + rounding / np.abs(self.response(freq_hz)) ** 2
        return density

    def sheet_belief(self) -> dict[str, Any]:
        """Return low-pass, noise before it and rounding behind it; see `Sensor.sheet_belief`."""
        numerator, denominator = self.transfer_function
        rounding = rounding_psd(self.resolution, self.sample_rate) ** 0.5
        return {
            "numerator": numerator,
            "denominator": denominator,
            "input_noise": self.angle_random_walk,
            # Of a fine word it keeps R positive and changes nothing.
            "output_noise": max(rounding, 3e-4 * self.angle_random_walk),
            "turn_on_bias": self.turn_on_bias,
            "range": self.full_scale(),
            "resolution": 1.0 / self.sensitivity,
            **self.slow_terms(),
        }

    def output_rms(self) -> float:
        """Return the noise of the readings from 0.1 Hz up, all that folds in and the rounding included [rad/s]."""
        freq = np.geomspace(0.1, 1e6, 4000)
        power = self.noise_psd(freq) * np.abs(self.response(freq) / (1.0 + self.scale_factor_error)) ** 2
        return float(np.sqrt(2.0 * np.trapezoid(power, freq) + 1.0 / (12.0 * self.sensitivity**2)))

    def doubts(self) -> list[str]:
        """Return where the stated total noise is not what density and bandwidth make; see `Sensor.doubts`."""
        stated, made = self.total_rms_noise, self.output_rms()
        if not stated or abs(stated / made - 1.0) <= _TRUSTED:
            return []
        hint = "see bandwidth and order"
        for factor, meaning in ((2.0**0.5, "two-sided: give it as angle_random_walk"), (0.5**0.5, "sqrt(2) too large")):
            if abs(stated / made / factor - 1.0) <= _TRUSTED:
                hint = f"the density may be {meaning}"
        stated_deg, made_deg = np.rad2deg([stated, made])
        return [
            f"total_rms_noise is {stated_deg:.4g} deg/s, but density and bandwidth make {made_deg:.4g} deg/s: {hint}"
        ]

    def datasheet(self) -> list[tuple[str, str]]:
        """Return the noise in data-sheet units and what it comes to; see `Sensor.datasheet`."""
        density, hour = np.rad2deg(self.angle_random_walk), np.rad2deg(3600.0)
        floor = (2.0 * np.log(2.0) / np.pi) ** 0.5
        allan = {tau: hour * self.allan_variance(tau) ** 0.5 for tau in (1.0, 100.0)}
        delay = self.delay(self.sample_rate, BASE_RATE_HZ)
        return [
            ("angle random walk N", f"{60.0 * density:.6g} deg/sqrt(h)"),
            ("N as root density, two-sided", f"{density:.6g} deg/s/sqrt(Hz)"),
            ("N as root density, one-sided (vendors)", f"{2.0**0.5 * density:.6g} deg/s/sqrt(Hz)"),
            ("bias instability B", f"{hour * self.bias_instability:.6g} deg/h"),
            ("its Allan floor, 0.664 B", f"{hour * floor * self.bias_instability:.6g} deg/h"),
            ("rate random walk K", f"{60.0 * hour * self.rate_random_walk:.6g} deg/h/sqrt(h)"),
            ("quantisation Q", f"{1e6 * self.quantization:.6g} urad"),
            ("Markov bias, correlation time", f"{hour * self.markov_bias:.6g} deg/h, {self.markov_time:g} s"),
            ("one count of the word", f"{np.rad2deg(self.resolution):.6g} deg/s"),
            *((f"Allan deviation at {tau:g} s, before the low-pass", f"{allan[tau]:.6g} deg/h") for tau in allan),
            ("delay by decimation and age", f"{1e3 * delay:.6g} ms"),
        ]

    def start(self, input_rate_hz: float, seed: int, name: str) -> MemsGyroStage:
        """Return the gyro in equilibrium with its first sample, its noise stationary; see `Sensor.start`."""
        return MemsGyroStage(self, input_rate_hz, seed, name)


class MemsGyroStage:
    """A MEMS gyro in time; made by `MemsGyro.start`."""

    def __init__(self, gyro: MemsGyro, input_rate_hz: float, seed: int, name: str) -> None:
        sampler = gyro.sampler(input_rate_hz, seed, name)
        ratio = max(round(input_rate_hz / gyro.sample_rate), 1)
        if isinstance(gyro.fir, tuple) and input_rate_hz != BASE_RATE_HZ:
            msg = f"input_rate_hz: expected {BASE_RATE_HZ:g} Hz, the clock of the fir's weights, got {input_rate_hz:g}"
            raise ValueError(msg)
        self._gyro = gyro

        def stream(term: str) -> np.random.Generator:
            return random_stream(seed, name, term)

        numerator, denominator = gyro.transfer_function
        # A constant passes the low-pass, settled as it is, and weights and ages by its gain at zero alone.
        self._turn_on = gyro.turn_on_bias * stream("turn_on_bias").standard_normal() if gyro.noise else 0.0
        self._turn_on *= numerator[-1] / denominator[-1]
        # Weights and ages work on the samples of the run, so their noise has to be there too.
        self._early = gyro.fir is not None or gyro.jitter > 0.0
        self.separable = not (self._early and gyro.noise)
        passed, rate_hz = Rational(numerator, denominator), input_rate_hz if self._early else gyro.sample_rate
        self._noise = NoiseStage(gyro.sampled_terms(passed, rate_hz, seed, name) if gyro.noise else {})
        self._ramp = Ramp(gyro.rate_ramp if gyro.noise else 0.0, input_rate_hz)
        self._low_pass = LinearFilter(list(numerator), list(denominator), input_rate_hz)
        self._fir = Fir(gyro.weights(ratio))
        self._decimator: Decimator | TickSampler | AgedSampler = sampler
        if gyro.jitter:
            self._decimator = AgedSampler(ratio, gyro.jitter * input_rate_hz, stream("jitter") if gyro.noise else None)
        self._converter = Converter(gyro.resolution, gyro.word_bits, gyro.full_scale(), rounding=gyro.noise)
        self._losses, self._settled = stream("dropped"), False

    def process(self, true_rate: FloatArray) -> FloatArray:
        """Return the readings [rad/s] that fall into a block of the true rate [rad/s], level, still and at T_0."""
        return self.process_in(true_rate, Surroundings())

    def process_in(self, true_rate: FloatArray, surroundings: Surroundings) -> FloatArray:
        """Return the readings [rad/s] that fall into a block of the true rate [rad/s]; NaN where one is lost."""
        return self.finish(self.clean(true_rate, surroundings))

    def clean(self, true_rate: FloatArray, surroundings: Surroundings) -> FloatArray:
        """Return what it would read without noise, dead band, word and losses [rad/s]; see `SplitStage`."""
        sensed = self._gyro.distort(true_rate, surroundings)
        if self._gyro.rate_ramp:
            sensed = sensed + self._ramp.process(true_rate.size)
        if sensed.size and not self._settled:
            # As it was before the record: in equilibrium with the rate that is on.
            self._low_pass.settle(float(sensed[0]))
            self._settled = True
        filtered = self._low_pass.process(sensed)
        if self._early:
            filtered += self._noise.process(filtered.size)
        return self._decimator.process(self._fir.process(filtered))

    def finish(self, clean: FloatArray) -> FloatArray:
        """Return the readings that become of it [rad/s]; see `SplitStage`."""
        taken = clean + self._turn_on
        if not self._early:
            taken = taken + self._noise.process(taken.size)
        readings = self._converter.process(np.where(np.abs(taken) < self._gyro.dead_band, 0.0, taken))
        if self._gyro.noise and self._gyro.dropped:
            readings[self._losses.random(readings.size) < self._gyro.dropped] = np.nan
        return readings
