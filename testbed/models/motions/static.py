"""Standstill."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from testbed.models.motion import Motion

if TYPE_CHECKING:
    from testbed.models.motion import RateFunction


class Static(Motion):
    """Standstill: the commanded rate is zero."""

    @property
    def draws(self) -> bool:
        """Whether it is random; see `Motion.draws`."""
        return False

    def start(self, duration: float, rng: np.random.Generator) -> RateFunction:
        """Return the rate [rad/s], zero, as a function of time [s]."""
        return np.zeros_like

    def top_frequency(self) -> float:
        """Return 0 Hz."""
        return 0.0
