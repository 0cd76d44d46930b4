"""Overlapping Allan deviation of a rate record with confidence limits."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from testbed.allan.freedom import chi_square_limits, equivalent_freedom, record_exponent
from testbed.allan.types import AllanCurve

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from testbed.signals import FloatArray

_PER_DECADE = 10
# Share of the usual number of samples that a mean must have, and of the differences that an averaging time must have.
_LEAST, _LEAST_USED = 0.8, 0.02


def allan_deviation(rate: ArrayLike, sample_rate_hz: float, tau: ArrayLike | None = None) -> AllanCurve:
    r"""Return the overlapping Allan deviation.

    .. math:: \sigma^2(mT) = \frac{1}{2 (mT)^2 (n - 2m + 1)} \sum_k (\theta_{k+2m} - 2\theta_{k+m} + \theta_k)^2

    Where samples are lost, means of m samples stand for the differences of the angle, of those that are there if they
    are at least 80 % of their usual number. What the lost ones add to the variance of a mean is that of the single
    samples, and is taken off; the degrees of freedom shrink by the share of the differences that are left.

    Parameters
    ----------
    rate : array_like, shape (n_time,)
        Rate [rad/s] (any unit: the deviation has the same); NaN where a sample is lost.
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
        If the record is no vector of at least 4 samples, one is infinite, fewer than half are left, or a tau is under
        one sample or over half the record.

    References
    ----------
    Riley, "Handbook of Frequency Stability Analysis", NIST SP 1065 (2008);
    Greenhall and Riley, "Uncertainty of stability variances based on finite differences", PTTI 2003.

    Examples
    --------
    White noise of 1 rad/s falls as the root of the averaging time.

    >>> white = np.random.default_rng(1).standard_normal(10_000)
    >>> curve = allan_deviation(white, 1.0, tau=[1.0, 100.0])
    >>> bool(curve.lower[1] < 0.1 < curve.upper[1])
    True
    """
    record = _checked(rate, sample_rate_hz)
    n_time = record.size
    m = _default_factors(n_time) if tau is None else _factors(tau, sample_rate_hz, n_time)
    # The mean drops out of second differences; without it the sum keeps its digits.
    record = record - np.nanmean(record)
    lost = np.isnan(record)
    angle = np.concatenate([[0.0], np.cumsum(_bridged(record, lost))])
    used = None
    if lost.any():
        m, variance, used = _with_gaps(record, lost, m)
    else:
        variance = np.array([_variance(angle, int(k)) for k in m])
    exponents = [record_exponent(angle, int(k)) for k in m]
    full = np.array([equivalent_freedom(int(k), n_time + 1, int(a)) for k, a in zip(m, exponents, strict=True)])
    edf = full if used is None else full * used
    low, high = chi_square_limits(variance, edf)
    deviation = np.sqrt(variance)
    return AllanCurve(m / sample_rate_hz, deviation, np.sqrt(low), np.sqrt(high), edf, n_time, sample_rate_hz, used)


def _checked(rate: ArrayLike, sample_rate_hz: float) -> FloatArray:
    record: FloatArray = np.asarray(rate, dtype=np.float64)
    if record.ndim != 1 or record.size < 4:
        msg = f"rate: expected a vector of at least 4 samples, got shape {record.shape}"
        raise ValueError(msg)
    if np.isinf(record).any():
        first = int(np.argmax(np.isinf(record)))
        msg = f"rate: expected finite samples, got {record[first]} at sample {first}"
        raise ValueError(msg)
    if 2 * np.count_nonzero(np.isnan(record)) > record.size:
        msg = f"rate: expected at least half of {record.size} samples, got {np.count_nonzero(~np.isnan(record))}"
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


def _bridged(record: FloatArray, lost: NDArray[np.bool_]) -> FloatArray:
    """Return the record with straight lines over lost samples, for telling the type of noise only."""
    if not lost.any():
        return record
    places = np.arange(record.size)
    bridged: FloatArray = np.interp(places, places[~lost], record[~lost])
    return bridged


def _with_gaps(record: FloatArray, lost: NDArray[np.bool_], m: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the factors at which differences are left, the variances and the shares of the differences."""
    total = np.concatenate([[0.0], np.cumsum(np.where(lost, 0.0, record))])
    count = np.concatenate([[0], np.cumsum(~lost)])
    steps = np.diff(record)
    single = float(np.nanmean(steps**2)) / 2.0 if np.isfinite(steps).any() else 0.0
    least = _LEAST * float(count[-1]) / record.size
    found = [(k, *_gap_variance(total, count, int(k), single, least)) for k in m]
    kept = np.array([row for row in found if row[2] > _LEAST_USED and row[1] > 0.0])
    if not kept.size:
        msg = "rate: expected samples beside each other, got gaps between all"
        raise ValueError(msg)
    return kept[:, 0], kept[:, 1], kept[:, 2]


def _gap_variance(
    total: FloatArray, count: NDArray[np.int64], m: int, single: float, least: float
) -> tuple[float, float]:
    """Return the Allan variance of means over what is left of m samples, and the share of the differences."""
    n = (count[m:] - count[:-m]).astype(np.float64)
    mean = (total[m:] - total[:-m]) / np.maximum(n, 1.0)
    enough = n >= least * m
    both = enough[m:] & enough[:-m]
    if not both.any():
        return 0.0, 0.0
    difference = (mean[m:] - mean[:-m])[both]
    missing = 0.5 * float(np.mean((1.0 / n[m:][both] + 1.0 / n[:-m][both]) - 2.0 / m))
    variance = float(difference @ difference) / (2.0 * difference.size) - single * missing
    return variance, difference.size / both.size
