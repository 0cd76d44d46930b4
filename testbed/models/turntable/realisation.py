"""Realisations of a Gaussian process of given spectral density, as functions of time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.interpolate import make_interp_spline

if TYPE_CHECKING:
    from collections.abc import Callable

    from testbed.models.motion import RateFunction
    from testbed.signals import FloatArray

_OVERSAMPLING = 16
# At least so many lines lie in the band, so that the sum is close to Gaussian also in a short run.
_LEAST_LINES = 50.0


def gaussian_rate(
    density: Callable[[FloatArray], FloatArray],
    band: tuple[float, float],
    duration: float,
    rng: np.random.Generator,
) -> RateFunction:
    r"""Return a periodic realisation that holds every line of the band.

    .. math:: \sum_k \sqrt{2 S(k/P)/P}\,(a_k \cos 2\pi k t/P + b_k \sin 2\pi k t/P), \quad a_k, b_k \sim N(0, 1)

    on a grid of 16 points per period of the upper edge, joined by a quintic spline. The period P exceeds the run, so
    nothing repeats. The variance is twice the integral of S over the band. Memory grows with duration times the upper
    edge (128 byte each): 1 MB for a minute of 100 Hz.

    Parameters
    ----------
    density : callable
        Two-sided density S [rad^2/s] at frequencies [Hz] within the band, shape (n_freq,) -> (n_freq,).
    band : tuple of 2 float
        Lower and upper edge [Hz]; nothing is outside.
    duration : float
        Length of the run [s].
    rng : numpy.random.Generator
        Of the coefficients.
    """
    low, high = band
    period = max(1.05 * duration, _LEAST_LINES / (high - low))
    n = int(np.ceil(_OVERSAMPLING * high * period))
    k = np.arange(int(np.ceil(low * period)), int(np.floor(high * period)) + 1)
    lines = np.zeros(n // 2 + 1, dtype=complex)
    # One line carries the two-sided power 2 S / P; irfft gives 2 |X| / n for a line X.
    amplitude = 0.5 * n * np.sqrt(2.0 * density(k / period) / period)
    lines[k] = amplitude * (rng.standard_normal(k.size) - 1j * rng.standard_normal(k.size))
    grid = np.fft.irfft(lines, n)
    spline = make_interp_spline(np.arange(n + 1) * (period / n), np.append(grid, grid[0]), k=5, bc_type="periodic")

    def rate(t: FloatArray) -> FloatArray:
        value: FloatArray = spline(t)
        return value

    return rate
