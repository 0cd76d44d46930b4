"""Degrees of freedom of an overlapping Allan variance, after Greenhall and Riley (PTTI 2003)."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import gammaincinv

if TYPE_CHECKING:
    from testbed.signals import FloatArray

# Strides per tau in the sum over lags; from this many samples per tau on, sampled noise counts as continuous.
STRIDES = 64
CONFIDENCE = 0.95
# Averages below which the type of noise cannot be told.
_AVERAGES = 30


def chi_square_quantile(probability: float, freedom: FloatArray | float) -> FloatArray:
    r"""Return the value that a chi square stays below: :math:`x = 2 P^{-1}(\nu / 2, p)`.

    Parameters
    ----------
    probability : float
        p [-].
    freedom : float or ndarray, shape (n,)
        Degrees of freedom nu [-].
    """
    # scipy.stats does the same, but takes a third of a second to load.
    x: FloatArray = np.asarray(2.0 * gammaincinv(0.5 * np.asarray(freedom), probability), np.float64)
    return x


def chi_square_limits(variance: FloatArray, edf: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the 95 % limits of variances with these degrees of freedom.

    Parameters
    ----------
    variance : ndarray, shape (n_tau,)
        Estimated variances, any unit.
    edf : ndarray, shape (n_tau,)
        Their equivalent degrees of freedom [-].

    Returns
    -------
    tuple of two ndarray, shape (n_tau,)
        Lower and upper limits, unit of `variance`.
    """
    tail = (1.0 - CONFIDENCE) / 2.0
    low: FloatArray = variance * edf / chi_square_quantile(1.0 - tail, edf)
    high: FloatArray = variance * edf / chi_square_quantile(tail, edf)
    return low, high


def curve_exponents(m: FloatArray, variance: FloatArray) -> FloatArray:
    """Return alpha of S ~ f^alpha at each averaging factor from the slope of a smooth curve within a factor of three.

    Parameters
    ----------
    m : ndarray, shape (n_tau,)
        Averaging factors [-].
    variance : ndarray, shape (n_tau,)
        Allan variance, from a model [rad^2/s^2].

    Returns
    -------
    ndarray, shape (n_tau,)
        2 (quantisation), 0, -1 or -2 [-].
    """
    x, y = np.log(m), np.log(variance)
    near = (np.abs(x - x[:, None]) <= np.log(3.0)).astype(np.float64)
    count, mean_x, mean_y = near.sum(axis=1), near @ x, near @ y
    mean_x, mean_y = mean_x / count, mean_y / count
    # Straight lines through the neighbours; a lone averaging time counts as white noise.
    run = near @ x**2 - count * mean_x**2
    slope = np.where(count > 1.0, (near @ (x * y) - count * mean_x * mean_y) / np.where(count > 1.0, run, 1.0), -1.0)
    return _known_exponent(-1.0 - slope)


def record_exponent(angle: FloatArray, m: int) -> float:
    """Return alpha of S ~ f^alpha from the lag-one autocorrelation of the averaged record [1]_.

    Parameters
    ----------
    angle : ndarray, shape (n_time + 1,)
        Integral of the rate [rad].
    m : int
        Averaging factor; where fewer than 30 averages are left, the noise at the longest factor with 30 is taken [-].

    Returns
    -------
    float
        2 (quantisation), 0, -1 or -2 [-].

    References
    ----------
    .. [1] Riley and Greenhall, "Power law noise identification using the lag 1 autocorrelation", EFTF 2004.
    """
    factor = max(1, min(m, (angle.size - 1) // _AVERAGES))
    series = np.diff(angle[::factor])
    delta, differences = _integration_order(series), 0
    while delta >= 0.25 and differences < 2:
        series = np.diff(series)
        delta, differences = _integration_order(series), differences + 1
    return float(_known_exponent(np.array(-2.0 * (delta + differences))))


def _integration_order(series: FloatArray) -> float:
    """Return delta = r / (1 + r) of the lag-one autocorrelation r: -alpha / 2 of stationary noise."""
    centred = series - series.mean()
    power = float(centred @ centred)
    lag_one = float(centred[1:] @ centred[:-1]) / power if power > 0.0 else 0.0
    return lag_one / (1.0 + lag_one)


def _known_exponent(alpha: FloatArray) -> FloatArray:
    """Return a term's exponent; between white rate and white angle the one with the wider limits."""
    known: FloatArray = np.where(alpha >= 1.5, 2.0, np.clip(np.round(alpha), -2.0, 0.0))
    return known


@functools.lru_cache(maxsize=4096)
def equivalent_freedom(m: int, n_angle: int, alpha: int) -> float:
    """Return the equivalent degrees of freedom of an overlapping Allan variance (Greenhall and Riley 2003).

    The variance of the estimate follows from the autocorrelation of the second differences, summed over lags up to 3
    tau.

    Parameters
    ----------
    m : int
        Averaging factor tau / T [-].
    n_angle : int
        Number of angle samples, one more than rate samples [-].
    alpha : int
        Exponent of the rate's density: 2 quantisation, 0 angle random walk, -1 flicker, -2 rate random walk.

    Returns
    -------
    float
        Degrees of freedom [-].
    """
    n_difference = n_angle - 2 * m
    if alpha == 2:
        # Independent angle errors: the second differences correlate at lags 0, m, 2 m only.
        rest = np.maximum(0.0, 1.0 - np.array([m, 2 * m]) / n_difference)
        return float(36.0 * n_difference / (36.0 + 2.0 * rest @ [16.0, 1.0]))
    strides = min(m, STRIDES)
    count = 1 + strides * (n_difference - 1) // m
    lags = np.arange(min(count, 3 * strides + 1))
    correlation = _second_difference_correlation(lags / strides, m, alpha)
    weight = np.where(lags == 0, 1.0, 2.0) * (1.0 - lags / count)
    return float(count * correlation[0] ** 2 / np.sum(weight * correlation**2))


def _second_difference_correlation(lag: FloatArray, m: int, alpha: int) -> FloatArray:
    """Return the autocovariance of second differences at lags in units of tau, up to a constant."""

    def angle_kernel(t: FloatArray, power: int) -> FloatArray:
        size = np.abs(t)
        logarithm = np.log(np.where(size > 0.0, size, 1.0))
        return {2: -size, 1: size**2 * logarithm, 0: size**3, -1: -(size**4) * logarithm, -2: -(size**5)}[power]

    def angle_covariance(t: FloatArray) -> FloatArray:
        if m >= STRIDES:
            return angle_kernel(t, alpha + 2)
        kernel = 2.0 * angle_kernel(t, alpha) - angle_kernel(t - 1.0 / m, alpha) - angle_kernel(t + 1.0 / m, alpha)
        return kernel * float(m) ** 2

    shifts, weights = (0.0, 1.0, -1.0, 2.0, -2.0), (6.0, -4.0, -4.0, 1.0, 1.0)
    total = np.zeros(lag.size)
    for shift, weight in zip(shifts, weights, strict=True):
        total += weight * angle_covariance(lag + shift)
    return total
