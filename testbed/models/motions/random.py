"""Band-limited Gaussian motion of given spectral density."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from pydantic import model_validator

from testbed.models.motion import Motion, RateFunction
from testbed.models.turntable.realisation import SPLINE_COST, gaussian_rate
from testbed.units import Frequency, RatePsd

if TYPE_CHECKING:
    from typing import Self


class Random(Motion):
    r"""Gaussian random rate with the constant two-sided density in a band and nothing outside.

    The density is `psd` for frequencies f of either sign from `low` to `high`.

    One realisation of `testbed.models.turntable.realisation.gaussian_rate`; the variance is 2 S (high - low).

    Parameters
    ----------
    psd : float
        Two-sided density of the rate [rad^2/s = (rad/s)^2/Hz].
    low, high : float
        Edges of the band [Hz].

    Raises
    ------
    ValueError
        If `high` is not above `low`.
    """

    example: ClassVar[dict[str, Any]] = {"psd": "1e-3 (deg/s)^2/Hz", "low": "10 Hz", "high": "50 Hz"}

    psd: RatePsd
    low: Frequency
    high: Frequency

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if self.high <= self.low:
            msg = f"expected high above low, got {self.low} Hz ... {self.high} Hz"
            raise ValueError(msg)
        return self

    def start(self, duration: float, rng: np.random.Generator) -> RateFunction:
        """Return the rate [rad/s] as a function of time [s]."""
        return gaussian_rate(lambda freq: np.full_like(freq, self.psd), (self.low, self.high), duration, rng)

    def n_term(self) -> int:
        """Return how many sines cost as much time as the spline."""
        return SPLINE_COST

    def top_frequency(self) -> float:
        """Return the upper edge of the band [Hz]."""
        return self.high
