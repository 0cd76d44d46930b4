"""A sine of given rate or angle."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from pydantic import model_validator

from testbed.models.motion import Motion, RateFunction
from testbed.units import Angle, Frequency, Rate

if TYPE_CHECKING:
    from typing import Self

    from testbed.signals import FloatArray


class Sine(Motion):
    r"""Sine of one frequency; the quantity that is given follows sin(2 pi f t + phase).

    With `rate` a: :math:`\dot\theta = a \sin(2\pi f t + \varphi)`. With `angle` b: :math:`\theta = b \sin(2\pi f t +
    \varphi)`, so
    :math:`\dot\theta = 2\pi f b \cos(2\pi f t + \varphi)`.

    Parameters
    ----------
    frequency : float
        Frequency [Hz].
    rate : float, optional
        Rate amplitude [rad/s]; exactly one of `rate` and `angle` is given.
    angle : float, optional
        Angle amplitude [rad].
    phase : float, optional
        Phase at t = 0 [rad].

    Raises
    ------
    ValueError
        If neither or both of `rate` and `angle` are given.
    """

    example: ClassVar[dict[str, Any]] = {"frequency": "10 Hz", "rate": "1 deg/s"}

    frequency: Frequency
    rate: Rate | None = None
    angle: Angle | None = None
    phase: Angle = 0.0

    @model_validator(mode="after")
    def _one_amplitude(self) -> Self:
        if (self.rate is None) == (self.angle is None):
            msg = "expected exactly one of rate (such as '1 deg/s') and angle (such as '5 mrad')"
            raise ValueError(msg)
        return self

    @property
    def draws(self) -> bool:
        """Whether it is random; see `Motion.draws`."""
        return False

    def start(self, duration: float, rng: np.random.Generator) -> RateFunction:
        """Return the rate [rad/s] as a function of time [s]."""
        w = 2.0 * np.pi * self.frequency
        amplitude, lead = (self.rate, 0.0) if self.rate is not None else ((self.angle or 0.0) * w, np.pi / 2)
        phase = self.phase + lead

        def rate(t: FloatArray) -> FloatArray:
            value: FloatArray = amplitude * np.sin(w * t + phase)
            return value

        return rate

    def lines(self) -> tuple[float, ...]:
        """Return the one frequency [Hz]."""
        return (self.frequency,)

    def top_frequency(self) -> float:
        """Return the frequency [Hz]."""
        return self.frequency
