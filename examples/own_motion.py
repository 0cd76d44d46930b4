"""A motion of one's own, whole: a structure that is knocked again and again, and rings down."""

from typing import Any, ClassVar

import numpy as np

from testbed.models.motion import Motion
from testbed.units import Frequency, PositiveDuration, Rate


class RingDown(Motion):
    r"""A structure that is knocked again and again, and rings down.

    :math:`\dot\theta = a\, e^{-t'/\tau} \sin(2\pi f t')`, t' the time since the last knock.

    Parameters
    ----------
    frequency, rate : float
        Of the ringing f [Hz], at the knock a [rad/s].
    decay, every : float
        Time constant, and from knock to knock [s].
    """

    frequency: Frequency
    rate: Rate
    decay: PositiveDuration = 0.2
    every: PositiveDuration = 1.0

    example: ClassVar[dict[str, Any]] = {"frequency": "25 Hz", "rate": "1 deg/s", "decay": "0.1 s", "every": "0.7 s"}

    def start(self, duration, rng):
        """Return the rate [rad/s] as a function of time [s]."""

        def rate(t):
            since = np.mod(t, self.every)
            return self.rate * np.exp(-since / self.decay) * np.sin(2.0 * np.pi * self.frequency * since)

        return rate

    def top_frequency(self):
        """Return the frequency of the ringing [Hz]; the knock itself is a kink, no jump."""
        return self.frequency
