"""A motion of one's own, whole: a structure that rings down after a knock, again and again."""

import numpy as np

from testbed.models.motion import Motion
from testbed.units import Frequency, PositiveDuration, Rate


class RingDown(Motion):
    r"""A decaying sine after each knock, :math:`\dot\theta = a\, e^{-t'/\tau} \sin(2\pi f t')`, t' since the last knock.

    Parameters
    ----------
    frequency, rate : float
        Of the ringing [Hz], at the knock [rad/s].
    decay, every : float
        Time constant, and from knock to knock [s].
    """

    frequency: Frequency
    rate: Rate
    decay: PositiveDuration = 0.2
    every: PositiveDuration = 1.0

    example = {"frequency": "25 Hz", "rate": "1 deg/s", "decay": "0.1 s", "every": "0.7 s"}

    def start(self, duration, rng):
        def rate(t):
            since = np.mod(t, self.every)
            return self.rate * np.exp(-since / self.decay) * np.sin(2.0 * np.pi * self.frequency * since)

        return rate

    def top_frequency(self):
        return self.frequency
