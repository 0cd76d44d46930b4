"""A sensor of one's own, whole: a band-pass with white noise on its readings (docs/filters.md says how it is fused)."""

import numpy as np

from testbed.sensors.base import Decimator, Sensor, rate_ratio
from testbed.signals import LinearFilter, random_stream, transfer
from testbed.units import Frequency, PositiveNumber, Range, RateDensity


class BandPass(Sensor):
    r"""A rate sensor that sees a band: :math:`G(s) = (\omega_0 s / Q) / (s^2 + \omega_0 s / Q + \omega_0^2)`.

    Parameters
    ----------
    center, quality : float
        Middle of the band [Hz] and Q [-].
    noise_density, range : float
        Two-sided root density of the noise on the reading [rad/s/sqrt(Hz)], largest reading [rad/s].
    """

    sample_rate: Frequency = 2000.0
    center: Frequency = 30.0
    quality: PositiveNumber = 0.1
    noise_density: RateDensity = 1e-6
    range: Range = np.radians(100.0)

    @property
    def _transfer(self):
        w = 2.0 * np.pi * self.center
        return [w / self.quality, 0.0], [1.0, w / self.quality, w**2]

    def response(self, freq_hz):
        return transfer(*self._transfer, freq_hz)

    def full_scale(self):
        return self.range

    def input_noise_psd(self, freq_hz):
        return self.noise_density**2 / np.abs(self.response(freq_hz)) ** 2

    def start(self, input_rate_hz, seed, name):
        return BandPassStage(self, input_rate_hz, random_stream(seed, name, "white"))


class BandPassStage:
    """The sensor in time; state is kept between blocks."""

    def __init__(self, sensor, input_rate_hz, stream):
        self._sensor, self._stream = sensor, stream
        self._filter = LinearFilter(*sensor._transfer, input_rate_hz)
        self._decimator = Decimator(rate_ratio(input_rate_hz, sensor.sample_rate))
        self._std = sensor.noise * sensor.noise_density * np.sqrt(sensor.sample_rate)

    def process(self, true_rate):
        """Return the readings [rad/s] that fall into a block of the true rate [rad/s]."""
        taken = self._decimator.process(self._filter.process(true_rate))
        noisy = taken + self._std * self._stream.standard_normal(taken.size)
        return np.clip(noisy, -self._sensor.range, self._sensor.range)
