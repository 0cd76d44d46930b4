"""The MHD angular rate sensor: fluid channel, transformer, amplifier, filter, delay, electronic noise, converter."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, ClassVar

import numpy as np
from pydantic import Field

from testbed.models.mhd_channel.channel import MhdChannel
from testbed.models.mhd_channel.linear_range import linear_range
from testbed.models.mhd_channel.ring import ChannelRing
from testbed.models.mhd_channel.thermal_drift import REFERENCE
from testbed.sensors.analogue import OnePole, SaturationStage
from testbed.sensors.base import Sensor
from testbed.sensors.converter import Converter, rounding_psd
from testbed.sensors.data_sheet import OUTPUT_RATE, RATE_NOISE_DENSITY, Word
from testbed.sensors.mhd_electronics import Delay, Linear, LowPass, Saturation, Transformer
from testbed.sensors.noise import ElectronicTerms
from testbed.sensors.noise_terms import NoiseStage
from testbed.sensors.sampled_noise import SampledNoise, Shape, sampled
from testbed.sensors.stages import Surroundings
from testbed.signals import random_stream
from testbed.units import DelayTime, Frequency, Quantity, ScaleFactor, Temperature, Voltage

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from testbed.sensors.analogue import AnalogueStage
    from testbed.sensors.noise_terms import NoiseTerm
    from testbed.signals import ComplexArray, FloatArray


class MhdArs(Sensor, ElectronicTerms):
    """An MHD angular rate sensor as its user sees it: readings in rad/s, after the calibrated scale factor.

    The signal passes channel, transformer, amplifier, its rails, anti-alias filter and delay, is sampled, receives the
    electronic noise and is converted. What is left out is not there.

    Parameters
    ----------
    channel : MhdChannel
        The fluid between its walls, at 20 degC.
    temperature : float
        Of fluid and magnet, constant [K]; the scenario's temperature at t = 0 if that is given and this is not. The
        calibration is that of 20 degC, so the magnet's drift shows in the readings.
    ring : ChannelRing, optional
        The channel's other dimensions; given, the Johnson noise of its resistance is added.
    gain : float
        Calibrated scale factor over the bare channel's, set so that the pass band reads true [-].
    scale_factor_error : float
        Relative error of that calibration [-].
    nonlinearity : float
        How far a reading at full scale departs from the line of small ones, over full scale; the departure grows with
        the cube of the rate [-].
    transformer : Transformer, optional
        High-pass between electrodes and amplifier.
    amplifier_pole : float
        Corner of the first-order amplifier [Hz].
    second_pole : float, optional
        A further pole of the amplifier [Hz].
    saturation : Saturation, optional
        The amplifier's rails and its recovery from them.
    anti_alias : LowPass, optional
        Butterworth filter in front of the converter.
    delay : float
        Dead time of everything behind the channel [s].
    scale_factor : float
        Output voltage per rate [V s/rad].
    adc_range : float
        The converter spans plus and minus this [V].
    adc_bits : int
        Its word length, two's complement [-].

    Notes
    -----
    Of the keys of data sheets it takes `output_rate` and `rate_noise_density`, one-sided, in place of `noise_density`,
    which is two-sided; see `testbed.sensors.data_sheet`.
    """

    any_clock = True
    words: ClassVar[tuple[Word, ...]] = (
        OUTPUT_RATE,
        replace(RATE_NOISE_DENSITY, field="noise_density", shown="nrad/s/sqrt(Hz)"),
    )

    channel: MhdChannel
    temperature: Temperature = REFERENCE
    ring: ChannelRing | None = None
    gain: Annotated[float, Field(gt=0.0, allow_inf_nan=False)] = 1.0
    scale_factor_error: Annotated[float, Quantity("", "0.5 %", above=-1.0)] = 0.0
    nonlinearity: Annotated[float, Quantity("", "0.1 %", above=-0.3)] = 0.0
    transformer: Transformer | None = None
    amplifier_pole: Frequency
    second_pole: Frequency | None = None
    saturation: Saturation | None = None
    anti_alias: LowPass | None = None
    delay: DelayTime = 0.0
    scale_factor: ScaleFactor
    adc_range: Voltage = 10.0
    adc_bits: Annotated[int, Field(strict=True, ge=2, le=32)] = 18

    @property
    def resolution(self) -> float:
        """One count of the converter [rad/s]."""
        return float(2.0 * self.adc_range / 2**self.adc_bits / self.scale_factor)

    @property
    def warm_channel(self) -> MhdChannel:
        """The channel at the sensor's temperature."""
        return self.channel.at(self.temperature)

    @property
    def channel_gain(self) -> float:
        """Reading per slip in the pass band: calibration, its error, and what the magnet has lost since [-]."""
        magnet = self.warm_channel.field / self.channel.field if self.channel.field else 1.0
        return self.gain * (1.0 + self.scale_factor_error) * magnet

    @property
    def johnson_noise(self) -> float:
        """Two-sided root density of the channel's Johnson noise, as a slip rate [rad/s/sqrt(Hz)]; 0 without `ring`."""
        if self.ring is None or not self.channel.field:
            return 0.0
        channel = self.warm_channel
        return self.ring.voltage_noise(channel, self.temperature) / self.ring.emf_per_rate(channel)

    def full_scale(self) -> float:
        """Return the largest rate that converter and amplifier can read [rad/s]."""
        rails = self.saturation.limit if self.saturation else self.adc_range
        return min(self.adc_range, rails) / self.scale_factor

    def input_noise_psd(self, freq_hz: FloatArray) -> FloatArray:
        """Return the noise referred to the true rate; see `Sensor.input_noise_psd`."""
        output = self.noise_psd(freq_hz) + rounding_psd(self.resolution, self.sample_rate)
        density: FloatArray = output / np.abs(self.response(freq_hz)) ** 2
        if self.ring is not None:
            density += self.johnson_noise**2 / np.abs(self.warm_channel.response(freq_hz)) ** 2
        return density

    def beyond(self, rate: float, stroke: float) -> list[str]:
        """Return where a motion drives a secondary flow that a linear channel leaves out; see `Sensor.beyond`."""
        numbers = linear_range(self.warm_channel, rate, stroke)
        if self.channel.flow != "linear" or numbers.holds:
            return []
        return [f"channel: the motion leaves the range of 'flow: linear': {numbers.words()}; take 'flow: similarity'"]

    def response(self, freq_hz: ArrayLike) -> ComplexArray:
        """Return indicated over true rate: channel (Su et al. 2024, equation (2)) and electronics, rails aside.

        Parameters
        ----------
        freq_hz : array_like, shape (n_freq,)
            Frequency [Hz].

        Returns
        -------
        ndarray of complex, shape (n_freq,)
            Response [-].

        Raises
        ------
        ValueError
            If a frequency is not finite.
        """
        freq = np.asarray(freq_hz, dtype=np.float64)
        response: ComplexArray = (
            self.channel_gain * self.warm_channel.response(freq) / (1.0 + 1j * freq / self.amplifier_pole)
        )
        for block in (*self.before_rails(), *self.behind_rails()):
            response = response * block.response(freq)
        return response

    def before_rails(self) -> list[Linear]:
        """Return the optional linear blocks before the amplifier's rails."""
        second = LowPass(corner=self.second_pole) if self.second_pole is not None else None
        return [block for block in (self.transformer, second) if block is not None]

    def behind_rails(self) -> list[Linear]:
        """Return the optional linear blocks behind them."""
        delay = Delay(time=self.delay) if self.delay else None
        return [block for block in (self.anti_alias, delay) if block is not None]

    def start(self, input_rate_hz: float, seed: int, name: str) -> MhdArsStage:
        """Return the sensor in equilibrium with its first sample; see `Sensor.start`."""
        return MhdArsStage(self, input_rate_hz, seed, name)


class MhdArsStage:
    """An MHD angular rate sensor in time; made by `MhdArs.start`. `heights` [m] are the points of its `profile`."""

    def __init__(self, sensor: MhdArs, input_rate_hz: float, seed: int, name: str) -> None:
        self._decimator = sensor.sampler(input_rate_hz, seed, name)
        self._channel = sensor.warm_channel.start(input_rate_hz)
        self.heights = sensor.channel.heights
        self._gain, self._first = sensor.channel_gain, np.nan
        # As if the field's path or the amplifier's first stage bent, before any pole.
        self._bend = sensor.nonlinearity / (sensor.adc_range / sensor.scale_factor) ** 2
        self._before, self._behind = _analogue_chain(sensor, input_rate_hz)
        # Rails are not linear, so in front of them the Johnson noise has to be there sample by sample.
        self._early = sensor.saturation is not None
        johnson = _johnson_terms(sensor, input_rate_hz if self._early else sensor.sample_rate, seed, name)
        self.separable = not (self._early and johnson and sensor.noise)
        self._johnson = NoiseStage(johnson if sensor.noise else {})
        self._noise = NoiseStage(sensor.noise_terms(sensor.sample_rate, seed, name) if sensor.noise else {})
        self._converter = Converter(
            sensor.resolution, sensor.adc_bits, sensor.adc_range / sensor.scale_factor, rounding=sensor.noise
        )

    def process(self, true_rate: FloatArray) -> FloatArray:
        """Return the readings [rad/s] that fall into a block of the true rate [rad/s]."""
        return self.finish(self.clean(true_rate, Surroundings()))

    def clean(self, true_rate: FloatArray, surroundings: Surroundings) -> FloatArray:
        """Return what it would read without noise and word [rad/s]; see `SplitStage`."""
        if true_rate.size and np.isnan(self._first):
            self._first = float(true_rate[0])
            # The fluid has turned with the walls before the record: a constant rate, such as the Earth's, is no step.
            self._channel.begin(self._first)
        signal = self._gain * self._channel.process(true_rate)
        signal = signal * (1.0 + self._bend * signal**2) if self._bend else signal
        for stage in self._before:
            signal = stage.process(signal)
        if self._early:
            signal = signal + self._johnson.process(signal.size)
        for stage in self._behind:
            signal = stage.process(signal)
        return self._decimator.process(signal)

    def finish(self, clean: FloatArray) -> FloatArray:
        """Return the readings that become of it [rad/s]; see `SplitStage`."""
        taken = clean if self._early else clean + self._johnson.process(clean.size)
        return self._converter.process(taken + self._noise.process(taken.size))

    def profile(self) -> FloatArray:
        """Return the slip u(h) at `heights` as of the last sample, shape (nodes + 1,) [rad/s]."""
        return self._channel.profile()


def _johnson_terms(sensor: MhdArs, sample_rate_hz: float, seed: int, name: str) -> dict[str, NoiseTerm]:
    """Return the Johnson noise behind the electronics, or in front of the rails if there are any."""
    blocks = [*sensor.before_rails(), *([] if sensor.saturation else sensor.behind_rails())]
    passed = LowPass(corner=sensor.amplifier_pole).rational()
    for block in blocks:
        passed = passed.through(block.rational())
    shape = Shape(white=sensor.channel_gain * sensor.johnson_noise)
    if not shape.white:
        return {}
    return {"johnson": SampledNoise(sampled(shape, passed, sample_rate_hz), random_stream(seed, name, "johnson"))}


def _analogue_chain(sensor: MhdArs, input_rate_hz: float) -> tuple[list[AnalogueStage], list[AnalogueStage]]:
    """Return the stages up to the amplifier's rails, and the others."""
    before: list[AnalogueStage] = [OnePole(sensor.amplifier_pole, input_rate_hz)]
    before += [block.start(input_rate_hz) for block in sensor.before_rails()]
    behind: list[AnalogueStage] = [block.start(input_rate_hz) for block in sensor.behind_rails()]
    if sensor.saturation is not None:
        limit = sensor.saturation.limit / sensor.scale_factor
        behind.insert(0, SaturationStage(limit, sensor.saturation.recovery_time, input_rate_hz))
    return before, behind
