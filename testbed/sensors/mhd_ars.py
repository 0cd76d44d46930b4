"""The MHD angular rate sensor: fluid channel, amplifier, electronic noise, converter."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import numpy as np
from pydantic import Field
from scipy.signal import lfilter

from testbed.models.mhd_channel import MhdChannel
from testbed.sensors.base import Converter, Decimator, Sensor, rate_ratio, rounding_psd
from testbed.sensors.noise import ElectronicTerms
from testbed.sensors.noise_terms import NoiseStage
from testbed.units import Frequency, ScaleFactor, Voltage

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from testbed.signals import ComplexArray, FloatArray


class MhdArs(Sensor, ElectronicTerms):
    """An MHD angular rate sensor as its user sees it: readings in rad/s, after the calibrated scale factor.

    Parameters
    ----------
    channel : MhdChannel
        The fluid between its walls.
    gain : float
        Calibrated scale factor over the bare channel's, set so that the pass band reads true [-].
    amplifier_pole : float
        Corner of the first-order amplifier [Hz].
    scale_factor : float
        Output voltage per rate [V s/rad].
    adc_range : float
        The converter spans plus and minus this [V].
    adc_bits : int
        Its word length, two's complement [-].
    """

    channel: MhdChannel
    gain: Annotated[float, Field(gt=0.0, allow_inf_nan=False)] = 1.0
    amplifier_pole: Frequency
    scale_factor: ScaleFactor
    adc_range: Voltage = 10.0
    adc_bits: Annotated[int, Field(strict=True, ge=2, le=32)] = 18

    @property
    def resolution(self) -> float:
        """One count of the converter [rad/s]."""
        return float(2.0 * self.adc_range / 2**self.adc_bits / self.scale_factor)

    def full_scale(self) -> float:
        """Return the largest rate that the converter can read [rad/s]."""
        return self.adc_range / self.scale_factor

    def input_noise_psd(self, freq_hz: FloatArray) -> FloatArray:
        """Return the noise referred to the true rate; see `Sensor.input_noise_psd`."""
        output = self.noise_psd(freq_hz) + rounding_psd(self.resolution, self.sample_rate)
        density: FloatArray = output / np.abs(self.response(freq_hz)) ** 2
        return density

    def response(self, freq_hz: ArrayLike) -> ComplexArray:
        """Return indicated over true rate: channel (Su et al. 2024, equation (2)), gain, amplifier.

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
        response: ComplexArray = self.gain * self.channel.response(freq) / (1.0 + 1j * freq / self.amplifier_pole)
        return response

    def start(self, input_rate_hz: float, seed: int, name: str) -> MhdArsStage:
        """Return the sensor at rest; see `Sensor.start`."""
        return MhdArsStage(self, input_rate_hz, seed, name)


class MhdArsStage:
    """An MHD angular rate sensor in time; made by `MhdArs.start`. `heights` [m] are the points of its `profile`."""

    def __init__(self, sensor: MhdArs, input_rate_hz: float, seed: int, name: str) -> None:
        self._decimator = Decimator(rate_ratio(input_rate_hz, sensor.sample_rate))
        self._channel = sensor.channel.start(input_rate_hz)
        self.heights = sensor.channel.heights
        self._amplifier = OnePole(sensor.amplifier_pole, input_rate_hz)
        self._gain = sensor.gain
        self._noise = NoiseStage(sensor.noise_terms(sensor.sample_rate, seed, name) if sensor.noise else {})
        self._converter = Converter(sensor.resolution, sensor.adc_bits, sensor.full_scale(), rounding=sensor.noise)

    def process(self, true_rate: FloatArray) -> FloatArray:
        """Return the readings [rad/s] that fall into a block of the true rate [rad/s]."""
        analogue = self._amplifier.process(self._gain * self._channel.process(true_rate))
        taken = self._decimator.process(analogue)
        return self._converter.process(taken + self._noise.process(taken.size))

    def profile(self) -> FloatArray:
        """Return the slip u(h) at `heights` as of the last sample, shape (nodes + 1,) [rad/s]."""
        return self._channel.profile()


class OnePole:
    r"""A first-order low-pass, exact for an input that is a cubic through the last four samples.

    .. math:: y_k = p y_{k-1} + \sum_{j=0}^{3} c_j u_{k-j}, \quad p = e^{-h}, \quad h = 2 \pi f_p T

    The c_j match the response to third order in s: within 1e-3 at 1/20 of the sample rate, where a
    straight line between samples would lose 0.8 %.

    Parameters
    ----------
    pole_hz : float
        Corner [Hz].
    sample_rate_hz : float
        Rate of the samples [Hz].
    """

    def __init__(self, pole_hz: float, sample_rate_hz: float) -> None:
        h = 2.0 * np.pi * pole_hz / sample_rate_hz
        order = np.arange(4)
        factorial = np.array([1.0, 1.0, 2.0, 6.0])
        # Taylor coefficients in sT of (1 - p exp(-sT)) / (1 + sT / h) and of exp(-j sT).
        numerator = -np.exp(-h) * (-1.0) ** order / factorial
        numerator[0] += 1.0
        wanted = np.convolve(numerator, (-1.0 / h) ** order)[:4]
        delays = (-1.0) ** order[:, None] * order[None, :] ** order[:, None] / factorial[:, None]
        self._b = np.linalg.solve(delays, wanted)
        self._a = np.array([1.0, -np.exp(-h)])
        self._state = np.zeros(3)

    def process(self, u: FloatArray) -> FloatArray:
        """Return the filtered samples, shape (n_time,), unit of `u`; at rest before the first."""
        if not u.size:
            return np.empty(0)
        y: FloatArray
        y, self._state = lfilter(self._b, self._a, u, zi=self._state)
        return y
