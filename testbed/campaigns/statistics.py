r"""What errors under many seeds say: intervals of an RMSE, and which filter is better.

Mean squares of one run are not white: a few slow terms carry them. A chi-square of :math:`\nu = 2 m^2 / v` degrees of
freedom has their mean m and variance v, so that n of them have n nu.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from testbed.signals import FloatArray

COVERAGE = 0.95


def rms_interval(squares: FloatArray) -> tuple[float, float, float]:
    """Return the RMSE over seeds with its 95 % interval, by a chi-square of the moments.

    Parameters
    ----------
    squares : ndarray, shape (n_seed,)
        Mean square error under each seed [deg^2/s^2].

    Returns
    -------
    tuple of float
        Lower limit, value and upper limit [deg/s]; limits are NaN for a single seed.
    """
    from scipy.special import gammaincinv

    mean = float(np.mean(squares))
    value = mean**0.5
    if squares.size < 2:
        return float("nan"), value, float("nan")
    spread = float(np.var(squares, ddof=1))
    if spread == 0.0:
        return value, value, value
    freedom = squares.size * 2.0 * mean**2 / spread
    # Quantiles of the chi-square as scipy.stats has them to the bit, without its checks: each point needs two.
    high, low = (2.0 * float(gammaincinv(freedom / 2.0, 0.5 + side * COVERAGE / 2)) for side in (-1.0, 1.0))
    return value * (freedom / low) ** 0.5, value, value * (freedom / high) ** 0.5


def relative_half_width(squares: FloatArray) -> float:
    """Return half the width of the interval of the RMSE over the RMSE [-]; infinite for a single seed.

    Parameters
    ----------
    squares : ndarray, shape (n_seed,)
        As for `rms_interval`.
    """
    low, value, high = rms_interval(squares)
    return (high - low) / (2.0 * value) if np.isfinite(low) and value > 0.0 else (0.0 if value == 0.0 else np.inf)


@dataclass(frozen=True)
class Comparison:
    """A filter against the best one.

    Parameters
    ----------
    name : str
        Of the filter.
    over_best, lower, upper : float
        Its error over that of the best filter, geometric mean over the cases, with its 95 % interval [-].
    p_value : float
        Chance of such a difference if there is none, after Holm's correction; 1 for the best one.
    n_seed : int
        Seeds under which all of them ran.
    """

    name: str
    over_best: float
    lower: float
    upper: float
    p_value: float
    n_seed: int


def rank(errors: Mapping[str, FloatArray]) -> list[Comparison]:
    """Return the filters from the best on, compared under the same seeds by Student's t of the logarithms.

    Parameters
    ----------
    errors : mapping of str to ndarray, shape (n_case, n_seed)
        RMSE of each filter in every case under every seed [deg/s]; those that are NaN for one filter are left out for
        all.
    """
    from scipy.stats import t as student

    names = list(errors)
    if not names:
        return []
    logs = np.log(np.stack([errors[name] for name in names]))
    # Of each seed, the mean over the cases: cases of one seed are not independent.
    whole = np.isfinite(logs).all(axis=(0, 1))
    means = logs[:, :, whole].mean(axis=1)
    if not means.shape[1]:
        return []
    order = np.argsort(means.mean(axis=1), kind="stable")
    best, n = means[order[0]], means.shape[1]
    found = []
    for i in order:
        difference = means[i] - best
        centre = float(difference.mean())
        if i == order[0] or n < 2:
            found.append(Comparison(names[i], float(np.exp(centre)), np.nan, np.nan, 1.0, n))
            continue
        scale = float(difference.std(ddof=1)) / n**0.5
        half = float(student.ppf(0.5 + COVERAGE / 2, n - 1)) * scale
        p = float(2.0 * student.sf(centre / scale, n - 1)) if scale > 0.0 else float(centre == 0.0)
        over, lower, upper = (float(np.exp(x)) for x in (centre, centre - half, centre + half))
        found.append(Comparison(names[i], over, lower, upper, p, n))
    return _corrected(found)


def _corrected(found: list[Comparison]) -> list[Comparison]:
    """Return the comparisons with Holm's correction of all but the best one."""
    corrected = [1.0, *holm([one.p_value for one in found[1:]])]
    return [
        Comparison(one.name, one.over_best, one.lower, one.upper, p, one.n_seed)
        for one, p in zip(found, corrected, strict=True)
    ]


def holm(p_values: Sequence[float]) -> list[float]:
    """Return chances with Holm's correction for their number, in the same order.

    Parameters
    ----------
    p_values : sequence of float
        Of each comparison alone.
    """
    order = sorted(range(len(p_values)), key=lambda i: p_values[i])
    corrected, largest = [1.0] * len(p_values), 0.0
    for place, i in enumerate(order):
        largest = max(largest, min(1.0, (len(order) - place) * p_values[i]))
        corrected[i] = largest
    return corrected
