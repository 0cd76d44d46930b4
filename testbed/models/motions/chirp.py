"""A sine whose frequency sweeps."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np
from pydantic import model_validator

from testbed.models.motion import Motion, RateFunction
from testbed.units import Frequency, PositiveDuration, Rate

if TYPE_CHECKING:
    from typing import Self

    from testbed.signals import FloatArray


class Chirp(Motion):
    r"""Sine of constant rate amplitude whose frequency runs from a first to a last.

    From `start_frequency` f0 to `stop_frequency` f1 over the sweep time T;
    linear: :math:`f(t) = f_0 + (f_1 - f_0) t/T`; logarithmic: :math:`f(t) = f_0 (f_1/f_0)^{t/T}`; the rate is
    :math:`a \sin(2\pi \int_0^t f)`. After T it stays at f1 with continuous phase.

    Parameters
    ----------
    start_frequency, stop_frequency : float
        First and last frequency [Hz], different from each other.
    rate : float
        Rate amplitude [rad/s].
    sweep : {"linear", "logarithmic"}, optional
        How the frequency moves.
    sweep_time : float, optional
        Length of the sweep [s]; the whole run if not given.

    Raises
    ------
    ValueError
        If both frequencies are equal.
    """

    example: ClassVar[dict[str, Any]] = {"start_frequency": "1 Hz", "stop_frequency": "20 Hz", "rate": "1 deg/s"}

    start_frequency: Frequency
    stop_frequency: Frequency
    rate: Rate
    sweep: Literal["linear", "logarithmic"] = "logarithmic"
    sweep_time: PositiveDuration | None = None

    @model_validator(mode="after")
    def _sweeps(self) -> Self:
        if self.start_frequency == self.stop_frequency:
            msg = "expected stop_frequency to differ from start_frequency (a sine does not sweep)"
            raise ValueError(msg)
        return self

    @property
    def draws(self) -> bool:
        """Whether it is random; see `Motion.draws`."""
        return False

    def start(self, duration: float, rng: np.random.Generator) -> RateFunction:
        """Return the rate [rad/s] as a function of time [s]."""
        f0, f1, T = self.start_frequency, self.stop_frequency, self.sweep_time or duration
        log_ratio = np.log(f1 / f0)

        def rate(t: FloatArray) -> FloatArray:
            swept = np.minimum(t, T)
            if self.sweep == "linear":
                cycles = f0 * swept + 0.5 * (f1 - f0) / T * swept**2
            else:
                cycles = f0 * T / log_ratio * np.expm1(log_ratio * swept / T)
            value: FloatArray = self.rate * np.sin(2.0 * np.pi * (cycles + f1 * (t - swept)))
            return value

        return rate

    def top_frequency(self) -> float:
        """Return the higher of both frequencies [Hz]."""
        return max(self.start_frequency, self.stop_frequency)
