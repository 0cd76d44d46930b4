"""Allan deviation of a rate record and the noise coefficients of IEEE Std 952 in it, with confidence limits.

The Allan variance of a record is an integral over its two-sided density,
sigma^2(tau) = integral g(f, tau) S(f) df, g = 2 sin^4(pi f tau) / (m sin(pi f T))^2, tau = m T, and adds over
independent terms.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import nnls
from scipy.stats import chi2, norm

from testbed.sensors.allan_freedom import STRIDES, curve_exponents, equivalent_freedom, record_exponent

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from testbed.signals import FloatArray

_CONFIDENCE = 0.95
_PER_DECADE = 10
# Standard deviations above zero at which a squared coefficient counts as seen, so that noise passes for a term once in
# 700 fits.
_DETECTION = 3.0
# Log-spaced frequencies of the covariance integral, and passes until the weights settle.
_FREQUENCIES = 4000
_REWEIGHTINGS = 6
_TERMS = ("quantization", "angle_random_walk", "bias_instability", "rate_random_walk", "rate_ramp")


@dataclass(frozen=True)
class AllanCurve:
    """An overlapping Allan deviation with its 95 % limits.

    Parameters
    ----------
    tau : ndarray, shape (n_tau,)
        Averaging times [s], whole multiples of the sample period.
    deviation, lower, upper : ndarray, shape (n_tau,)
        Allan deviation and its limits [rad/s].
    edf : ndarray, shape (n_tau,)
        Equivalent degrees of freedom [-].
    n_time : int
        Number of samples of the record.
    sample_rate_hz : float
        Its sample rate [Hz].
    """

    tau: FloatArray
    deviation: FloatArray
    lower: FloatArray
    upper: FloatArray
    edf: FloatArray
    n_time: int
    sample_rate_hz: float


@dataclass(frozen=True)
class Coefficient:
    """A fitted coefficient with its 95 % interval.

    Parameters
    ----------
    value : float
        Estimate in SI; NaN if the record does not identify the term.
    lower, upper : float
        Limits in SI; for a term that is not identified 0 and the upper limit.
    """

    value: float
    lower: float
    upper: float

    @property
    def identified(self) -> bool:
        """Whether the record shows the term at all."""
        return self.lower > 0.0


@dataclass(frozen=True)
class AllanFit:
    """Coefficients of IEEE Std 952: Q [rad], N [rad/sqrt(s)], B [rad/s], K [rad/s^1.5], R [rad/s^2]."""

    quantization: Coefficient
    angle_random_walk: Coefficient
    bias_instability: Coefficient
    rate_random_walk: Coefficient
    rate_ramp: Coefficient


def allan_deviation(rate: ArrayLike, sample_rate_hz: float, tau: ArrayLike | None = None) -> AllanCurve:
    r"""Return the overlapping Allan deviation.

    .. math:: \sigma^2(mT) = \frac{1}{2 (mT)^2 (n - 2m + 1)} \sum_k (\theta_{k+2m} - 2\theta_{k+m} + \theta_k)^2

    Parameters
    ----------
    rate : array_like, shape (n_time,)
        Rate [rad/s] (any unit: the deviation has the same).
    sample_rate_hz : float
        Sample rate [Hz].
    tau : array_like, shape (n_tau,), optional
        Averaging times [s], rounded to whole samples; ten per decade up to a quarter of the record if left out.

    Returns
    -------
    AllanCurve
        Deviation with 95 % limits from equivalent degrees of freedom, the type of noise from the lag-one
        autocorrelation.

    Raises
    ------
    ValueError
        If the record is no finite vector of at least 4 samples, or a tau is under one sample or over half the record.

    References
    ----------
    Riley, "Handbook of Frequency Stability Analysis", NIST SP 1065 (2008);
    Greenhall and Riley, "Uncertainty of stability variances based on finite differences", PTTI 2003.
    """
    record = _checked(rate, sample_rate_hz)
    n_time = record.size
    m = _default_factors(n_time) if tau is None else _factors(tau, sample_rate_hz, n_time)
    # The mean drops out of second differences; without it the sum keeps its digits.
    angle = np.concatenate([[0.0], np.cumsum(record - record.mean())])
    variance = np.array([_variance(angle, int(k)) for k in m])
    exponents = [record_exponent(angle, int(k)) for k in m]
    edf = np.array([equivalent_freedom(int(k), n_time + 1, int(a)) for k, a in zip(m, exponents, strict=True)])
    low, high = _limits(variance, edf)
    return AllanCurve(m / sample_rate_hz, np.sqrt(variance), np.sqrt(low), np.sqrt(high), edf, n_time, sample_rate_hz)


def _checked(rate: ArrayLike, sample_rate_hz: float) -> FloatArray:
    record: FloatArray = np.asarray(rate, dtype=np.float64)
    if record.ndim != 1 or record.size < 4:
        msg = f"rate: expected a vector of at least 4 samples, got shape {record.shape}"
        raise ValueError(msg)
    if not np.isfinite(record).all():
        first = int(np.argmin(np.isfinite(record)))
        msg = f"rate: expected finite samples, got {record[first]} at sample {first}"
        raise ValueError(msg)
    if not (sample_rate_hz > 0.0 and np.isfinite(sample_rate_hz)):
        msg = f"sample_rate_hz: expected a positive number, got {sample_rate_hz}"
        raise ValueError(msg)
    return record


def _default_factors(n_time: int) -> FloatArray:
    longest = n_time // 4
    count = 1 + int(np.ceil(_PER_DECADE * np.log10(longest)))
    factors: FloatArray = np.unique(np.round(np.geomspace(1, longest, count)))
    return factors


def _factors(tau: ArrayLike, sample_rate_hz: float, n_time: int) -> FloatArray:
    m: FloatArray = np.unique(np.round(np.atleast_1d(np.asarray(tau, dtype=np.float64)) * sample_rate_hz))
    if not (m.size and m[0] >= 1 and m[-1] <= n_time // 2):
        longest = n_time // 2 / sample_rate_hz
        msg = f"tau: expected {1 / sample_rate_hz:g} to {longest:g} s, got {np.asarray(tau).tolist()}"
        raise ValueError(msg)
    return m


def _variance(angle: FloatArray, m: int) -> float:
    first = angle[m:] - angle[:-m]
    second = first[m:] - first[:-m]
    return float(np.dot(second, second) / (2.0 * m**2 * second.size))


def _limits(variance: FloatArray, edf: FloatArray) -> tuple[FloatArray, FloatArray]:
    tail = (1.0 - _CONFIDENCE) / 2.0
    low: FloatArray = variance * edf / chi2.ppf(1.0 - tail, edf)
    high: FloatArray = variance * edf / chi2.ppf(tail, edf)
    return low, high


def fit_allan(curve: AllanCurve) -> AllanFit:
    r"""Fit the five terms of IEEE Std 952 to an Allan variance, none negative.

    .. math:: \sigma^2 = \frac{3 Q^2}{\tau^2} + \frac{N^2}{\tau} + \frac{2 \ln 2}{\pi} B^2
        + \frac{K^2 \tau}{3} + \frac{R^2 \tau^2}{2}

    Weighted least squares in variance, the weights from the fitted curve and its degrees of freedom (iterated). The
    correlation between averaging times, which overlap, follows from the fitted density and enters the intervals. The
    columns of B and K are those of sampled noise, which differ at a few samples from the ones above. Other noise, such
    as a Markov bias or what a low-pass leaves of white noise at short tau, is no term of the model and is taken for the
    nearest: give `allan_deviation` the tau at which the model holds.

    Parameters
    ----------
    curve : AllanCurve
        From `allan_deviation`, at least 5 averaging times.

    Returns
    -------
    AllanFit
        Each term with its 95 % interval; a term that the record does not identify has the value NaN, lower 0 and an
        upper limit.

    Raises
    ------
    ValueError
        If there are fewer than 5 averaging times or the record is constant.
    """
    if curve.tau.size < len(_TERMS) or not np.all(curve.deviation > 0.0):
        msg = f"curve: expected at least {len(_TERMS)} averaging times and deviations above zero, got {curve.deviation}"
        raise ValueError(msg)
    problem = _Problem(curve)
    squares = problem.solve()
    return AllanFit(*(problem.coefficient(k, squares) for k in range(len(_TERMS))))


def _columns(tau: FloatArray, m: FloatArray) -> FloatArray:
    flicker = np.array([_flicker_floor(int(k)) for k in m])
    return np.stack([3.0 / tau**2, 1.0 / tau, flicker, tau / 3.0 * (1.0 + 0.5 / m**2), tau**2 / 2.0], axis=1)


@functools.lru_cache(maxsize=256)
def _flicker_floor(m: int) -> float:
    """Return sigma^2 / B^2 of sampled flicker with 1/f up to half the sample rate; 2 ln 2 / pi for many samples."""
    if m > STRIDES:
        return 2.0 * float(np.log(2.0)) / np.pi
    steps = 64 * m
    cycles = (np.arange(steps, dtype=np.float64) + 0.5) / (2.0 * steps)
    density = 2.0 * _allan_window(cycles, np.array(float(m))) / (2.0 * np.pi * cycles)
    return float(density.mean() / 2.0)


def _allan_window(cycles: FloatArray, m: FloatArray) -> FloatArray:
    """Return g of the module docstring at f T = `cycles`."""
    window: FloatArray = 2.0 * np.sin(np.pi * cycles * m) ** 4 / (m * np.sin(np.pi * cycles)) ** 2
    return window


class _Problem:
    """Least squares in Allan variance; `squares` are Q^2, N^2, B^2, K^2, R^2."""

    def __init__(self, curve: AllanCurve) -> None:
        self._tau, self._n_time = curve.tau, curve.n_time
        self._m = np.round(curve.tau * curve.sample_rate_hz)
        self._measured = curve.deviation**2
        self._columns = _columns(self._tau, self._m)
        cycles = np.geomspace(0.03 / self._n_time, 0.5, _FREQUENCIES)
        self._freq = cycles * curve.sample_rate_hz
        self._white_angle = (2.0 * np.sin(np.pi * cycles)) ** 2 * curve.sample_rate_hz
        self._window = _allan_window(cycles, self._m[:, None])
        # Of the mean over the record of the second differences.
        self._mean_window = self._window * np.sinc(cycles * (self._n_time - 2.0 * self._m[:, None])) ** 2

    def solve(self) -> FloatArray:
        """Return the non-negative squares, the weights from the fitted curve itself."""
        model = self._measured
        for _ in range(_REWEIGHTINGS):
            spread = self._spread(model)
            weighted = self._columns / spread[:, None]
            scale = np.linalg.norm(weighted, axis=0)
            solution, _ = nnls(weighted / scale, self._measured / spread)
            squares: FloatArray = solution / scale
            model = self._columns @ squares
        return squares

    def coefficient(self, k: int, squares: FloatArray) -> Coefficient:
        """Return term k with its interval."""
        square = float(squares[k])
        std = self._std(k, squares)
        quantile = float(norm.ppf(0.5 + _CONFIDENCE / 2.0))
        if square > _DETECTION * std:
            low, high = _limits(squares[k : k + 1], np.array([2.0 * square**2 / std**2]))
            return Coefficient(float(np.sqrt(square)), float(np.sqrt(low[0])), float(np.sqrt(high[0])))
        # A limit must hold if the term is as large as the limit says, and then it adds to the spread.
        raised = squares.copy()
        raised[k] = square + quantile * std
        limit = square + quantile * self._std(k, raised)
        return Coefficient(float("nan"), 0.0, float(np.sqrt(limit)))

    def _spread(self, model: FloatArray) -> FloatArray:
        """Return the standard deviations of the Allan variances if `model` is their expectation."""
        alphas = curve_exponents(self._m, model)
        pairs = zip(self._m, alphas, strict=True)
        edf = np.array([equivalent_freedom(int(m), self._n_time + 1, int(a)) for m, a in pairs])
        spread: FloatArray = model * np.sqrt(2.0 / edf)
        return spread

    def _std(self, k: int, squares: FloatArray) -> float:
        """Return the standard deviation of square k; terms that the fit set to zero are left out."""
        spread = self._spread(self._columns @ squares)
        present = [i for i in range(squares.size) if squares[i] > 0.0 or i == k]
        weighted = self._columns[:, present] / spread[:, None]
        scale = np.linalg.norm(weighted, axis=0)
        row = (np.linalg.pinv(weighted / scale) / spread / scale[:, None])[present.index(k)]
        return float(np.sqrt(row @ self._covariance(squares, spread) @ row))

    def _covariance(self, squares: FloatArray, spread: FloatArray) -> FloatArray:
        """Return the covariance of the variances: correlation ~ integral g_i g_j S^2 df, the given spread."""
        turn = 2.0 * np.pi * self._freq
        density = squares[0] * self._white_angle + squares[1] + squares[2] / turn + squares[3] / turn**2
        weighted = self._window * density * np.sqrt(self._freq)
        product = weighted @ weighted.T
        size = np.sqrt(np.diag(product))
        covariance: FloatArray = product / size / size[:, None] * spread * spread[:, None]
        # A ramp is no noise, but it multiplies the mean of the second differences of the noise.
        mean_square = 2.0 * np.trapezoid(self._mean_window * density, self._freq, axis=1)
        cross = self._tau * np.sqrt(squares[4] / 2.0 * mean_square)
        covariance += 4.0 * cross * cross[:, None]
        return covariance
