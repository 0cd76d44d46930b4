"""From an angle to the mirror's deflection: lead, latency, hold, dynamics."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from testbed.signals import FloatArray, LinearFilter

if TYPE_CHECKING:
    from testbed.pointing.actuator import Dynamics


class Latency:
    """A pure delay of a sampled signal, linear between its samples; nothing before the first.

    Parameters
    ----------
    delay : float
        [s].
    sample_rate_hz : float
        Rate of the samples [Hz].
    """

    def __init__(self, delay: float, sample_rate_hz: float) -> None:
        # A whole number of samples stays one in spite of rounding.
        samples = round(delay * sample_rate_hz, 6)
        self._whole = math.floor(samples)
        self._part = samples - self._whole
        self._past = np.zeros(self._whole + 1)

    def process(self, x: FloatArray) -> FloatArray:
        """Return the signal as it was a delay ago, unit of `x`, shape (n_time,) of `x`."""
        y = np.concatenate([self._past, x])
        self._past = y[y.size - self._whole - 1 :]
        late: FloatArray = (1.0 - self._part) * y[1 : 1 + x.size] + self._part * y[: x.size]
        return late


class Hold:
    """Holds every `ratio`-th sample, beginning with the first, until the next.

    Parameters
    ----------
    ratio : int
        Samples from one to the next that is taken.
    """

    def __init__(self, ratio: int) -> None:
        self._ratio, self._done, self._last = ratio, 0, 0.0

    def process(self, x: FloatArray) -> FloatArray:
        """Return the held signal, unit of `x`, shape (n_time,) of `x`."""
        index = self._done + np.arange(x.size)
        taken = x[-self._done % self._ratio :: self._ratio]
        values = np.concatenate([[self._last], taken])
        held: FloatArray = values[index // self._ratio - -(-self._done // self._ratio) + 1]
        self._done, self._last = self._done + x.size, float(values[-1])
        return held


class CommandPath:
    r"""Deflection that follows the command :math:`\theta + \tau \omega`, late, held and through the mirror.

    The mirror is discretised exactly, for a command that is linear between the samples of the base clock, or held from
    one sample of its own clock to the next.

    Parameters
    ----------
    mirror : Dynamics
        Deflection over command.
    sample_rate_hz : float
        Base clock [Hz].
    lead, latency : float
        tau and the delay of the command [s].
    hold : int
        Base samples from one command to the next; 0 holds nothing.
    """

    def __init__(
        self, mirror: Dynamics, sample_rate_hz: float, *, lead: float = 0.0, latency: float = 0.0, hold: int = 0
    ) -> None:
        self._lead = lead
        self._latency = Latency(latency, sample_rate_hz)
        self._hold = Hold(hold) if hold else None
        numerator, denominator = list(mirror.numerator), list(mirror.denominator)
        self._mirror = LinearFilter(numerator, denominator, sample_rate_hz, hold="zero" if hold else "first")

    def process(self, angle: FloatArray, rate: FloatArray) -> FloatArray:
        """Return the deflection over the next samples.

        Parameters
        ----------
        angle, rate : ndarray, shape (n_time,)
            What is to be followed [rad], [rad/s].

        Returns
        -------
        ndarray, shape (n_time,)
            Deflection [rad].
        """
        command = self._latency.process(angle + self._lead * rate)
        return self._mirror.process(command if self._hold is None else self._hold.process(command))
