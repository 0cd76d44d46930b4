"""A sensor of one's own, whole: a band-pass with white noise on its readings; filters take it by `belief: exact`."""

import numpy as np

from testbed.sensors.base import Sensor
from testbed.sensors.decimation import Decimator, rate_ratio
from testbed.signals import LinearFilter, random_stream, transfer
from testbed.units import Frequency, Range, RateDensity


class BandPass(Sensor):
    r"""White noise on readings of a band, :math:`G(s) = \omega_2 s / (s + \omega_1) / (s + \omega_2)`.

    Parameters
    ----------
    lower, upper, noise_density, range : float
        Corners [Hz], two-sided root density of the noise [rad/s/sqrt(Hz)] and largest value [rad/s] of the reading.
    """

    sample_rate: Frequency = 2000.0
    lower: Frequency = 2.0
    upper: Frequency = 400.0
    noise_density: RateDensity = 1e-6
    range: Range = np.radians(100.0)

    @property
    def _transfer(self):
        low, high = 2.0 * np.pi * self.lower, 2.0 * np.pi * self.upper
        return [high, 0.0], [1.0, low + high, low * high]

    def response(self, freq_hz):
        """Return indicated over true rate [-]."""
        return transfer(*self._transfer, freq_hz)

    def full_scale(self):
        """Return the largest reading [rad/s]."""
        return self.range

    def input_noise_psd(self, freq_hz):
        """Return the noise referred to the true rate [rad^2/s]."""
        return self.noise_density**2 / np.abs(self.response(freq_hz)) ** 2

    def start(self, input_rate_hz, seed, name):
        """Return the sensor at rest."""
        return BandPassStage(self, input_rate_hz, random_stream(seed, name, "white"))


class BandPassStage:
    """The sensor in time: `process` turns blocks of the true rate into readings [rad/s]; state is kept between them."""

    def __init__(self, sensor, input_rate_hz, stream):
        self._range, self._stream = sensor.range, stream
        self._filter = LinearFilter(*sensor._transfer, input_rate_hz)
        self._decimator = Decimator(rate_ratio(input_rate_hz, sensor.sample_rate))
        self._std = sensor.noise * sensor.noise_density * np.sqrt(sensor.sample_rate)

    def process(self, true_rate):  # noqa: D102
        taken = self._decimator.process(self._filter.process(true_rate))
        return np.clip(taken + self._std * self._stream.standard_normal(taken.size), -self._range, self._range)
