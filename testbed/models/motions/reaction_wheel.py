"""Jitter of a reaction wheel: harmonics of its speed, amplified by the modes of the structure."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import numpy as np
from pydantic import Field, model_validator

from testbed.models.motion import Motion, RateFunction
from testbed.parts import Part
from testbed.units import Angle, Frequency, Inertia, PositiveDuration, Quantity

if TYPE_CHECKING:
    from typing import Self

    from testbed.signals import ComplexArray, FloatArray

Speed = Annotated[float, Quantity("rad/s", "2400 rev/min", above=0.0)]
Imbalance = Annotated[float, Quantity("kg*m^2", "13.7 g*cm^2", at_least=0.0)]
Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
DampingRatio = Annotated[float, Field(gt=0.0, lt=1.0, allow_inf_nan=False)]
Gain = Annotated[float, Field(allow_inf_nan=False)]


class WheelHarmonic(Part):
    """One harmonic of the wheel's disturbance torque, C n^2 sin(h (angle of the wheel) + phase).

    Parameters
    ----------
    number : float
        Harmonic number h, a whole number for imbalance, any other for bearings [-].
    coefficient : float
        Amplitude coefficient C, for h = 1 the dynamic imbalance [kg m^2].
    phase : float, optional
        Phase of the torque at t = 0 [rad]; drawn from the scenario's seed if not given.
    """

    number: Positive
    coefficient: Imbalance
    phase: Angle | None = None


class StructuralMode(Part):
    """One mode of the structure between wheel and instrument.

    Parameters
    ----------
    frequency : float
        Natural frequency [Hz].
    damping : float
        Damping ratio [-].
    gain : float
        Modal gain g: its share of compliance over that of the rigid body, I phi_wheel phi_instrument [-]; either sign.
    """

    frequency: Frequency
    damping: DampingRatio
    gain: Gain


class ReactionWheel(Motion):
    r"""Rate of a platform that is shaken by a reaction wheel of speed n(t).

    The empirical model of wheels [1]_, torques :math:`T_i = C_i n^2 \sin(h_i \psi + \varphi_i)` with the wheel's angle
    :math:`\psi = \int_0^t n`, acting on a platform of inertia I with modes:

    .. math:: \frac{\dot\theta}{T} = \frac{A(s)}{I s}, \quad
        A(s) = 1 + \sum_m \frac{g_m s^2}{s^2 + 2 \zeta_m \omega_m s + \omega_m^2}, \qquad
        \dot\theta = \sum_i \frac{C_i n}{I h_i} |A_i| \sin(h_i \psi + \varphi_i + \arg A_i - \pi/2), \quad
        A_i = A(j h_i n)

    During a ramp each harmonic has the amplitude and phase of its present frequency (quasi-steady): right while it
    stays within half a width of a mode for longer than the mode needs to ring up, h |dn/dt| << (zeta_m omega_m)^2.

    Parameters
    ----------
    speed : float
        Wheel speed n at t = 0 [rad/s].
    harmonics : tuple of WheelHarmonic
        Torques of the wheel, all of different number.
    inertia : float
        Inertia I of the platform about the sensing axis [kg m^2].
    modes : tuple of StructuralMode, optional
        Modes of the structure; none is a rigid platform.
    stop_speed : float, optional
        Speed at the end of the ramp [rad/s]; constant speed if not given.
    ramp_time : float, optional
        Length of the ramp, which is linear in time [s]; the whole run if not given. Then the speed stays.

    Raises
    ------
    ValueError
        If a harmonic number is repeated or the ramp is none.

    References
    ----------
    .. [1] R. Masterson, D. Miller, R. Grogan (2002), J. Sound Vib. 249:575, doi 10.1006/jsvi.2001.3868.
    """

    example: ClassVar[dict[str, Any]] = {
        "speed": "600 rev/min",
        "harmonics": [{"number": 1, "coefficient": "13.7 g*cm^2"}, {"number": 5.2, "coefficient": "2 g*cm^2"}],
        "inertia": "25 kg*m^2",
        "modes": [{"frequency": "50 Hz", "damping": 0.01, "gain": 0.5}],
        "stop_speed": "300 rev/min",
        "ramp_time": "1.5 s",
    }

    speed: Speed
    harmonics: Annotated[tuple[WheelHarmonic, ...], Field(min_length=1)]
    inertia: Inertia
    modes: tuple[StructuralMode, ...] = ()
    stop_speed: Speed | None = None
    ramp_time: PositiveDuration | None = None

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if len({harmonic.number for harmonic in self.harmonics}) != len(self.harmonics):
            msg = "harmonics: expected all different numbers"
            raise ValueError(msg)
        if self.stop_speed == self.speed or (self.stop_speed is None and self.ramp_time is not None):
            msg = "expected a stop_speed that differs from speed for a ramp, and no ramp_time without it"
            raise ValueError(msg)
        return self

    def amplification(self, freq_hz: FloatArray) -> ComplexArray:
        """Return A(s) at s = 2 pi j f: the structure's rate over that of a rigid body.

        Parameters
        ----------
        freq_hz : ndarray, shape (n_freq,)
            Frequencies [Hz].

        Returns
        -------
        ndarray of complex, shape (n_freq,)
            Amplification [-].
        """
        total = np.ones(freq_hz.shape, dtype=complex)
        for mode in self.modes:
            ratio = freq_hz / mode.frequency
            total -= mode.gain * ratio**2 / (1.0 - ratio**2 + 2j * mode.damping * ratio)
        return total

    @property
    def draws(self) -> bool:
        """Whether it is random; see `Motion.draws`."""
        return any(one.phase is None for one in self.harmonics)

    def start(self, duration: float, rng: np.random.Generator) -> RateFunction:
        """Return the rate [rad/s] as a function of time [s]."""
        drawn = rng.uniform(0.0, 2.0 * np.pi, len(self.harmonics))
        phases = [p if h.phase is None else h.phase for h, p in zip(self.harmonics, drawn.tolist(), strict=True)]
        length = self.ramp_time or duration
        slope = 0.0 if self.stop_speed is None else (self.stop_speed - self.speed) / length

        def rate(t: FloatArray) -> FloatArray:
            ramping = np.minimum(t, length)
            speed = self.speed + slope * ramping
            wheel_angle = (self.speed + 0.5 * slope * ramping) * ramping + speed * (t - ramping)
            total = np.zeros_like(t)
            for harmonic, phase in zip(self.harmonics, phases, strict=True):
                total += self._line(harmonic, speed, harmonic.number * wheel_angle + phase)
            return total

        return rate

    def _line(self, harmonic: WheelHarmonic, speed: FloatArray, phase: FloatArray) -> FloatArray:
        # At constant speed one value of the amplification is enough.
        present = speed[:1] if self.stop_speed is None else speed
        amplification = self.amplification(harmonic.number * present / (2.0 * np.pi))
        amplitude = harmonic.coefficient * present / (self.inertia * harmonic.number) * np.abs(amplification)
        value: FloatArray = amplitude * np.sin(phase + np.angle(amplification) - 0.5 * np.pi)
        return value

    def lines(self) -> tuple[float, ...]:
        """Return the frequencies of the harmonics [Hz] at constant speed; none for a ramp."""
        if self.stop_speed is not None:
            return ()
        return tuple(harmonic.number * self.speed / (2.0 * np.pi) for harmonic in self.harmonics)

    def n_term(self) -> int:
        """Return how many sines cost as much time as the harmonics, each through all modes in a ramp."""
        return len(self.harmonics) * (1 if self.stop_speed is None else 4 + 4 * len(self.modes))

    def top_frequency(self) -> float:
        """Return the highest harmonic at the highest speed [Hz]."""
        number = max(harmonic.number for harmonic in self.harmonics)
        return number * max(self.speed, self.stop_speed or 0.0) / (2.0 * np.pi)
