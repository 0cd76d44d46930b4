"""A constant rate."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from testbed.models.motion import Motion, RateFunction
from testbed.units import Rate

if TYPE_CHECKING:
    from testbed.signals import FloatArray


class Constant(Motion):
    """Constant rate after the ramp-in.

    Parameters
    ----------
    rate : float
        Rate [rad/s].
    """

    example: ClassVar[dict[str, Any]] = {"rate": "1 deg/s"}

    rate: Rate

    @property
    def draws(self) -> bool:
        """Whether it is random; see `Motion.draws`."""
        return False

    def start(self, duration: float, rng: np.random.Generator) -> RateFunction:
        """Return the rate [rad/s] as a function of time [s]."""

        def rate(t: FloatArray) -> FloatArray:
            return np.full_like(t, self.rate)

        return rate

    def top_frequency(self) -> float:
        """Return 0 Hz."""
        return 0.0
