"""Analogue electronics behind the electrodes: each block gives its response and starts its stage in time."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Protocol

import numpy as np
from pydantic import Field

from testbed.parts import Part
from testbed.sensors.analogue import DelayStage, LowPassStage
from testbed.sensors.sampled_noise import Rational
from testbed.signals import LinearFilter
from testbed.units import DelayTime, Duration, Frequency, Quantity, Voltage

if TYPE_CHECKING:
    from testbed.sensors.analogue import AnalogueStage
    from testbed.signals import ComplexArray, FloatArray

Inductance = Annotated[float, Quantity("H", "1 uH", above=0.0)]
Resistance = Annotated[float, Quantity("ohm", "20 uohm", above=0.0)]


class Linear(Protocol):
    """One linear block of the chain."""

    def response(self, freq_hz: FloatArray) -> ComplexArray:
        """Return output over input at `freq_hz` [Hz], shape (n_freq,) [-]."""

    def rational(self) -> Rational:
        """Return numerator and denominator in s [rad/s]; a delay's are 1, noise being no other later."""

    def start(self, sample_rate_hz: float) -> AnalogueStage:
        """Return the block at rest, for samples at `sample_rate_hz` [Hz]."""


class Transformer(Part):
    r"""Step-up transformer of the electrodes, whose magnetising inductance shorts slow signals: s/(s + R/L).

    Parameters
    ----------
    magnetizing_inductance : float
        L, seen from the primary [H].
    source_resistance : float
        R of fluid, electrodes and winding, seen there too [ohm].
    """

    magnetizing_inductance: Inductance
    source_resistance: Resistance

    @property
    def corner_freq_hz(self) -> float:
        """Lower corner R/(2 pi L) [Hz]."""
        return self.source_resistance / (2.0 * np.pi * self.magnetizing_inductance)

    def response(self, freq_hz: FloatArray) -> ComplexArray:
        """Return output over input at `freq_hz` [Hz], shape (n_freq,) [-]."""
        turn = 1j * freq_hz
        response: ComplexArray = turn / (turn + self.corner_freq_hz)
        return response

    def rational(self) -> Rational:
        """Return numerator and denominator in s [rad/s]."""
        return Rational((1.0, 0.0), (1.0, 2.0 * np.pi * self.corner_freq_hz))

    def start(self, sample_rate_hz: float) -> LinearFilter:
        """Return the transformer at rest: exact for an input linear between samples, which errs on H - 1 only."""
        return LinearFilter([1.0, 0.0], [1.0, 2.0 * np.pi * self.corner_freq_hz], sample_rate_hz)


class LowPass(Part):
    """Butterworth low-pass, unit gain at DC: a further pole of the amplifier, or the anti-alias filter.

    Parameters
    ----------
    corner : float
        Half-power frequency [Hz].
    order : int
        Number of poles, 1 to 8 [-].
    """

    corner: Frequency
    order: Annotated[int, Field(strict=True, ge=1, le=8)] = 1

    def _poles(self) -> ComplexArray:
        """Return the poles over the corner's angular frequency, on the left half of the unit circle."""
        k = np.arange(self.order)
        poles: ComplexArray = np.exp(0.5j * np.pi * (1.0 + (2.0 * k + 1.0) / self.order))
        return poles

    def response(self, freq_hz: FloatArray) -> ComplexArray:
        """Return output over input at `freq_hz` [Hz], shape (n_freq,) [-]."""
        s = 1j * freq_hz[..., None] / self.corner
        response: ComplexArray = np.prod(1.0 / (1.0 - s / self._poles()), axis=-1)
        return response

    def rational(self) -> Rational:
        """Return numerator and denominator in s [rad/s]."""
        poles = 2.0 * np.pi * self.corner * self._poles()
        return Rational((float(np.prod(-poles).real),), tuple(np.poly(poles).real))

    def start(self, sample_rate_hz: float) -> LowPassStage:
        """Return the filter at rest."""
        poles = self._poles()
        # Partial fractions: prod 1/(1 - s/p_i) = sum r_i/(1 - s/p_i), r_i = prod_{j != i} 1/(1 - p_i/p_j).
        apart = 1.0 - poles[:, None] / poles[None, :]
        np.fill_diagonal(apart, 1.0)
        upper = poles.imag > -1e-9
        # Of a conjugate pair one is run and counted twice; the real pole of an odd order counts once.
        weight = np.where(poles.imag > 1e-9, 2.0, 1.0) / np.prod(apart, axis=1)
        return LowPassStage(-2.0 * np.pi * self.corner / sample_rate_hz * poles[upper], weight[upper])


class Delay(Part):
    """Dead time exp(-s d), a whole or fractional number of samples.

    Parameters
    ----------
    time : float
        d [s].
    """

    time: DelayTime

    def response(self, freq_hz: FloatArray) -> ComplexArray:
        """Return output over input at `freq_hz` [Hz], shape (n_freq,) [-]."""
        response: ComplexArray = np.exp(-2j * np.pi * freq_hz * self.time)
        return response

    def rational(self) -> Rational:
        """Return 1 over 1: noise that is late is the same noise."""
        return Rational((1.0,), (1.0,))

    def start(self, sample_rate_hz: float) -> DelayStage:
        """Return the delay line, empty."""
        return DelayStage(self.time * sample_rate_hz)


class Saturation(Part):
    """Rails of the amplifier, and how long it sticks to one after an overload.

    Parameters
    ----------
    limit : float
        Output clips at plus and minus this [V].
    recovery_time : float
        Time constant with which the overload is forgotten [s]; 0 recovers at once.
    """

    limit: Voltage
    recovery_time: Duration = 0.0
