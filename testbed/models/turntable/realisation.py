"""Realisations of a Gaussian process of given spectral density, as functions of time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from testbed.errors import ScenarioError

if TYPE_CHECKING:
    from collections.abc import Callable

    from scipy.interpolate import BSpline

    from testbed.models.motion import RateFunction
    from testbed.signals import ComplexArray, FloatArray

_OVERSAMPLING = 16
# At least so many lines lie in the band, so that the sum is close to Gaussian also in a short run.
_LEAST_LINES = 50.0
# 32 MB, and while it is made some 230 MB and a second.
MOST_POINTS = 1 << 22
# How many sines cost as much time as the spline.
SPLINE_COST = 16


def grid(band: tuple[float, float], duration: float) -> tuple[float, int]:
    """Return the period of a realisation [s] and the points of its grid, at least 16 per period of the upper edge.

    Parameters
    ----------
    band : tuple of 2 float
        Lower and upper edge [Hz].
    duration : float
        Length of the run [s].

    Raises
    ------
    ScenarioError
        If these are more than `MOST_POINTS`.
    """
    from scipy.fft import next_fast_len

    low, high = band
    period = max(1.05 * duration, _LEAST_LINES / (high - low))
    points = _OVERSAMPLING * high * period
    if not points <= MOST_POINTS:
        msg = (
            f"noise from {low:g} Hz to {high:g} Hz over {duration:g} s: expected at most {MOST_POINTS} points, "
            f"16 for each period of the upper edge in the run or in 50 over the bandwidth, got {points:.3g}: "
            "lower the upper edge, widen the band or shorten the run"
        )
        raise ScenarioError(msg)
    return period, int(next_fast_len(int(np.ceil(points)), real=True))


def periodic_spline(lines: ComplexArray, n: int, period: float) -> BSpline:
    r"""Return the quintic spline through the points of a periodic signal that is given by its lines.

    The spline's coefficients are a convolution of the points, so a division of the lines: with theta = 2 pi k / n

    .. math:: c_k = X_k / b_k, \quad b_k = (66 + 52 \cos\theta + 2 \cos 2\theta) / 120

    Parameters
    ----------
    lines : ndarray of complex, shape (n // 2 + 1,)
        Discrete Fourier transform X of the points, as `numpy.fft.rfft` gives it.
    n : int
        Number of points.
    period : float
        Period [s].
    """
    from scipy.interpolate import BSpline

    theta = 2.0 * np.pi / n * np.arange(n // 2 + 1)
    lines /= (66.0 + 52.0 * np.cos(theta) + 2.0 * np.cos(2.0 * theta)) / 120.0
    coefficients = np.fft.irfft(lines, n)
    # Each basis function is centred on a point; two before the first and three behind the last reach into the period.
    knots = np.arange(-5, n + 6) * (period / n)
    around = np.concatenate([coefficients[-2:], coefficients, coefficients[:3]])
    return BSpline(knots, around, 5, extrapolate="periodic")


def gaussian_rate(
    density: Callable[[FloatArray], FloatArray],
    band: tuple[float, float],
    duration: float,
    rng: np.random.Generator,
) -> RateFunction:
    r"""Return a periodic realisation that holds every line of the band.

    .. math:: \sum_k \sqrt{2 S(k/P)/P}\,(a_k \cos 2\pi k t/P + b_k \sin 2\pi k t/P), \quad a_k, b_k \sim N(0, 1)

    as a `periodic_spline`. The period P exceeds the run, so nothing repeats. The variance is twice the integral of S
    over the band. Memory grows with duration times the upper edge (128 byte each): 1 MB for a minute of 100 Hz.

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

    Raises
    ------
    ScenarioError
        If it takes more points than `MOST_POINTS`.
    """
    period, n = grid(band, duration)
    k = np.arange(int(np.ceil(band[0] * period)), int(np.floor(band[1] * period)) + 1)
    lines = np.zeros(n // 2 + 1, dtype=complex)
    # One line carries the two-sided power 2 S / P; irfft gives 2 |X| / n for a line X.
    amplitude = 0.5 * n * np.sqrt(2.0 * density(k / period) / period)
    lines[k] = amplitude * (rng.standard_normal(k.size) - 1j * rng.standard_normal(k.size))
    spline = periodic_spline(lines, n, period)

    def rate(t: FloatArray) -> FloatArray:
        value: FloatArray = spline(t)
        return value

    return rate
