"""Band-limited Gaussian motion of given spectral density."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from pydantic import model_validator
from scipy.interpolate import make_interp_spline

from testbed.models.motion import Motion, RateFunction
from testbed.units import Frequency, RatePsd

if TYPE_CHECKING:
    from typing import Self

    from testbed.signals import FloatArray

_OVERSAMPLING = 16


class Random(Motion):
    r"""Gaussian random rate with the constant two-sided density `psd` for `low` <= |f| <= `high` and nothing outside.

    A periodic realisation, :math:`\sum_k \sqrt{S/P}\,(a_k \cos 2\pi k t/P + b_k \sin 2\pi k t/P)\sqrt 2` with standard normal a, b over the
    lines k/P of the band, on a grid of 16 points per period of `high`, joined by a quintic spline. The period P exceeds the run, so nothing repeats.
    The variance is 2 S (high - low). Memory grows with duration times `high` (128 byte each): 1 MB for a minute of 100 Hz.

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
        # At least 50 lines lie in the band, so that the sum is close to Gaussian also in a short run.
        period = max(1.05 * duration, 50.0 / (self.high - self.low))
        n = int(np.ceil(_OVERSAMPLING * self.high * period))
        k = np.arange(int(np.ceil(self.low * period)), int(np.floor(self.high * period)) + 1)
        lines = np.zeros(n // 2 + 1, dtype=complex)
        # One line carries the two-sided power 2 S / P; irfft gives 2 |X| / n for a line X.
        lines[k] = (
            0.5
            * n
            * np.sqrt(2.0 * self.psd / period)
            * (rng.standard_normal(k.size) - 1j * rng.standard_normal(k.size))
        )
        grid = np.fft.irfft(lines, n)
        spline = make_interp_spline(np.arange(n + 1) * (period / n), np.append(grid, grid[0]), k=5, bc_type="periodic")

        def rate(t: FloatArray) -> FloatArray:
            value: FloatArray = spline(t)
            return value

        return rate

    def top_frequency(self) -> float:
        """Return the upper edge of the band [Hz]."""
        return self.high
