"""The noise coefficients of IEEE Std 952 in an Allan deviation, with confidence limits and a verdict on the model.

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
from scipy.special import chdtrc, ndtri

from testbed.allan.freedom import CONFIDENCE, STRIDES, chi_square_limits, curve_exponents, equivalent_freedom

if TYPE_CHECKING:
    from testbed.allan.types import AllanCurve
    from testbed.signals import FloatArray

# Standard deviations above zero at which a squared coefficient counts as seen, so that noise passes for a term once in
# 700 fits.
_DETECTION = 3.0
# Log-spaced frequencies of the covariance integral, and passes until the weights settle.
_FREQUENCIES = 4000
_REWEIGHTINGS = 6
# Chance that a record of the model's own kind is refused.
_REFUSAL = 1e-3
_TERMS = ("quantization", "angle_random_walk", "bias_instability", "rate_random_walk", "rate_ramp")


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
class Goodness:
    """How well the five terms describe a curve.

    Parameters
    ----------
    reduced_chi_square : float
        Mean square of the normalised residuals over its expectation; 1 if the model holds [-].
    freedom : float
        Degrees of freedom of that mean, correlation between averaging times and the fitted terms taken off [-].
    p_value : float
        Chance of so large a value if the model holds [-].
    worst_tau : float
        Averaging time of the largest residual [s].
    """

    reduced_chi_square: float
    freedom: float
    p_value: float
    worst_tau: float

    @property
    def accepted(self) -> bool:
        """Whether the model describes the curve; if not, the coefficients mean nothing."""
        return self.p_value >= _REFUSAL


@dataclass(frozen=True)
class AllanFit:
    """Coefficients of IEEE Std 952: Q [rad], N [rad/sqrt(s)], B [rad/s], K [rad/s^1.5], R [rad/s^2].

    `squares` are the fitted Q^2, N^2, B^2, K^2, R^2, identified or not, whose sum was compared with the curve;
    `goodness` says whether it describes the curve: if not, the coefficients mean nothing.
    """

    quantization: Coefficient
    angle_random_walk: Coefficient
    bias_instability: Coefficient
    rate_random_walk: Coefficient
    rate_ramp: Coefficient
    squares: tuple[float, ...]
    goodness: Goodness


def fit_allan(curve: AllanCurve) -> AllanFit:
    r"""Fit the five terms of IEEE Std 952 to an Allan variance, none negative.

    .. math:: \sigma^2 = \frac{3 Q^2}{\tau^2} + \frac{N^2}{\tau} + \frac{2 \ln 2}{\pi} B^2
        + \frac{K^2 \tau}{3} + \frac{R^2 \tau^2}{2}

    Weighted least squares in variance, the weights from the fitted curve and its degrees of freedom (iterated). The
    correlation between averaging times, which overlap, follows from the fitted density and enters the intervals. The
    columns of B and K are those of sampled noise, which differ at a few samples from the ones above. Other noise, such
    as a Markov bias or what a low-pass leaves of white noise at short tau, is no term of the model: `goodness` tells,
    and `AllanCurve.between` gives the averaging times at which the model holds.

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
        If there are fewer than 5 averaging times, or the record is constant or a ramp without noise.

    Examples
    --------
    >>> from testbed.allan import allan_deviation
    >>> white = np.random.default_rng(1).standard_normal(10_000)
    >>> found = fit_allan(allan_deviation(white, 1.0)).angle_random_walk
    >>> bool(found.lower < 1.0 < found.upper)
    True
    """
    problem = _Problem(curve)
    squares = problem.solve()
    coefficients = {name: problem.coefficient(k, squares) for k, name in enumerate(_TERMS)}
    return AllanFit(**coefficients, squares=tuple(squares.tolist()), goodness=problem.goodness(squares))


def judge_fit(curve: AllanCurve) -> Goodness:
    """Return the verdict of `fit_allan` alone, in half the time.

    Parameters
    ----------
    curve : AllanCurve
        As for `fit_allan`.
    """
    problem = _Problem(curve)
    return problem.goodness(problem.solve())


def term_variance(curve: AllanCurve, term: str, square: float) -> FloatArray:
    """Return the Allan variance that a term adds to a curve.

    Parameters
    ----------
    curve : AllanCurve
        Gives the averaging times.
    term : str
        Its name in `AllanFit`.
    square : float
        Its squared coefficient, in SI.

    Returns
    -------
    ndarray, shape (n_tau,)
        Allan variance [rad^2/s^2].
    """
    columns = _columns(curve.tau, np.round(curve.tau * curve.sample_rate_hz))
    variance: FloatArray = square * columns[:, _TERMS.index(term)]
    return variance


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
        if curve.tau.size < len(_TERMS) or not np.all(curve.deviation > 0.0):
            msg = (
                f"curve: expected at least {len(_TERMS)} averaging times and deviations above zero, "
                f"got {curve.deviation}"
            )
            raise ValueError(msg)
        self._tau, self._n_time = curve.tau, curve.n_time
        self._used = 1.0 if curve.used is None else curve.used
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
        if not squares[:-1].any():
            msg = "curve: expected noise, got a ramp alone"
            raise ValueError(msg)
        return squares

    def coefficient(self, k: int, squares: FloatArray) -> Coefficient:
        """Return term k with its interval."""
        square = float(squares[k])
        std = self._std(k, squares)
        quantile = float(ndtri(0.5 + CONFIDENCE / 2.0))
        if square > _DETECTION * std:
            low, high = chi_square_limits(squares[k : k + 1], np.array([2.0 * square**2 / std**2]))
            return Coefficient(float(np.sqrt(square)), float(np.sqrt(low[0])), float(np.sqrt(high[0])))
        # A limit must hold if the term is as large as the limit says, and then it adds to the spread.
        raised = squares.copy()
        raised[k] = square + quantile * std
        limit = square + quantile * self._std(k, raised)
        return Coefficient(float("nan"), 0.0, float(np.sqrt(limit)))

    def goodness(self, squares: FloatArray) -> Goodness:
        """Return the verdict on the model.

        A variance with few degrees of freedom is skew: its cube root is as good as normal (Wilson and Hilferty 1931).
        The sum of correlated squares counts as chi square with its mean and variance (Satterthwaite 1946).
        """
        model = self._columns @ squares
        spread = self._spread(model)
        third = (spread / model) ** 2 / 9.0
        residual = (np.cbrt(self._measured / model) - 1.0 + third) / np.sqrt(third)
        fitted = np.linalg.qr((self._columns / spread[:, None])[:, squares > 0.0])[0]
        remaining = np.eye(residual.size) - fitted @ fitted.T
        correlation = self._covariance(squares, spread) / spread / spread[:, None]
        product = remaining @ correlation
        mean, mean_square = float(np.trace(product)), float(np.sum(product * product.T))
        reduced, freedom = float(residual @ residual) / mean, mean**2 / mean_square
        worst = float(self._tau[np.argmax(np.abs(residual))])
        return Goodness(reduced, freedom, float(chdtrc(freedom, reduced * freedom)), worst)

    def _spread(self, model: FloatArray) -> FloatArray:
        """Return the standard deviations of the Allan variances if `model` is their expectation."""
        alphas = curve_exponents(self._m, model)
        pairs = zip(self._m, alphas, strict=True)
        edf = self._used * np.array([equivalent_freedom(int(m), self._n_time + 1, int(a)) for m, a in pairs])
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
