"""Mean and spread of a signal that nothing is known of, accumulated block by block."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from testbed.metrics.errors import finite

if TYPE_CHECKING:
    from testbed.signals import FloatArray


class RateSpread:
    """Mean and standard deviation of the finite samples of a rate, and how many are none.

    The sums are taken about the first sample, so that a large constant costs no digits.
    """

    def __init__(self) -> None:
        self.missing = 0
        self._n, self._about, self._sum, self._square = 0, 0.0, 0.0, 0.0

    def add(self, rate: FloatArray) -> None:
        """Add samples [rad/s], shape (n_time,); not finite ones are counted as missing."""
        there = rate[np.isfinite(rate)]
        self.missing += rate.size - there.size
        if not there.size:
            return
        if not self._n:
            self._about = float(there[0])
        above = there - self._about
        self._n += there.size
        self._sum += float(above.sum())
        self._square += float(above @ above)

    def result(self) -> dict[str, float | None]:
        """Return mean and standard deviation [deg/s], None without samples."""
        if not self._n:
            return {"mean_deg_s": None, "spread_deg_s": None}
        mean = self._sum / self._n
        spread = np.sqrt(max(self._square / self._n - mean**2, 0.0))
        return {
            "mean_deg_s": finite(np.rad2deg(self._about + mean)),
            "spread_deg_s": finite(np.rad2deg(spread)),
        }
