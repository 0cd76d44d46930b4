"""Fading-memory Kalman filter of a level: paper 3's "adaptive" filter, equation (22).

For a random walk seen in white noise, everything in units of the measurement variance R, so that q = Q/R:

    p = s P + q,   K = p / (1 + p),   x += K (z - x),   P = (1 - K) p
"""

# mypy: disable-error-code="no-untyped-def, misc"

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numba import njit

from testbed.compensation.record import checked

if TYPE_CHECKING:
    from testbed.signals import FloatArray

# Autocorrelations of the innovation that must vanish, and the calibration factors tried.
_LAGS = 20
_FACTORS = np.geomspace(0.05, 2.0, 60)


@njit(cache=True)
def _filter(z, s, q, level, P, estimate, innovation):  # pragma: no cover
    for k in range(z.size):
        prior = s * P + q
        gain = prior / (1.0 + prior)
        innovation[k] = z[k] - level
        level += gain * innovation[k]
        P = (1.0 - gain) * prior
        estimate[k] = level


def _check(s: float, q: float) -> None:
    if not (0.0 < s < math.inf and 0.0 < q < math.inf):
        msg = f"s, q: expected positive numbers, got {s} and {q}"
        raise ValueError(msg)


def steady_gain(s: float, q: float) -> float:
    r"""Return the gain that the filter settles to.

    .. math:: p = \tfrac12 [(s + q - 1) + \sqrt{(s + q - 1)^2 + 4 q}], \quad K = p / (1 + p)

    Parameters
    ----------
    s : float
        Calibration factor on the old covariance [-].
    q : float
        Q / R [-].

    Returns
    -------
    float
        K [-].

    Raises
    ------
    ValueError
        If one is not positive.
    """
    _check(s, q)
    half = 0.5 * (s + q - 1.0)
    root = math.sqrt(half * half + q)
    # For s + q < 1 the difference would cancel.
    p = half + root if half >= 0.0 else q / (root - half)
    return p / (1.0 + p)


def equivalent_ratio(s: float, q: float) -> float:
    """Return the Q/R that without fading (s = 1) settles to the same gain, K^2 / (1 - K) [-].

    Parameters
    ----------
    s : float
        Calibration factor [-].
    q : float
        Q / R [-].
    """
    gain = steady_gain(s, q)
    return gain * gain / (1.0 - gain)


def fading_memory(z: FloatArray, s: float, q: float) -> tuple[FloatArray, FloatArray]:
    """Filter a record; it starts at the first sample with that sample's variance.

    Parameters
    ----------
    z : ndarray, shape (n_time,)
        Samples, any unit.
    s : float
        Calibration factor of equation (22) [-].
    q : float
        Q / R [-].

    Returns
    -------
    estimate, innovation : ndarray, shape (n_time,)
        Level after each sample and what the sample said that was new, unit of `z`.

    Raises
    ------
    ValueError
        If a sample is not finite or a parameter not positive.

    References
    ----------
    Wang, Cui, Cao, Micromachines 14 (2023) 1712, equation (22).
    """
    _check(s, q)
    samples = checked("z", z)
    estimate, innovation = np.empty(samples.size), np.empty(samples.size)
    if samples.size:
        _filter(samples, s, q, samples[0], 1.0, estimate, innovation)
    return estimate, innovation


def noise_ratio(z: FloatArray, *, least: float = 1e-8) -> float:
    """Return Q/R of a random walk in white noise from the differences d of its samples.

    var d = Q + 2 R and the covariance of neighbouring differences is -R.

    Parameters
    ----------
    z : ndarray, shape (n_time,)
        Samples, any unit.
    least : float
        Smallest ratio, and the inverse of the largest [-].
    """
    d = np.diff(checked("z", z))
    variance, neighbour = float(np.mean(d * d)), float(np.mean(d[1:] * d[:-1]))
    R = max(-neighbour, 0.0)
    return float(np.clip((variance - 2.0 * R) / R, least, 1.0 / least)) if R > 0.0 else 1.0 / least


def choose_factor(z: FloatArray, q: float) -> float:
    """Return the calibration factor s whose innovation is whitest: least sum of squares of 20 autocorrelations.

    The least output, by which paper 3 comes to 0.583, would always choose the slowest filter.

    Parameters
    ----------
    z : ndarray, shape (n_time,)
        Samples, any unit, not constant.
    q : float
        Q / R [-].

    Returns
    -------
    float
        s, one of 60 from 0.05 to 2 [-].
    """
    return float(min(_FACTORS, key=lambda s: _colour(fading_memory(z, float(s), q)[1])))


def _colour(innovation: FloatArray) -> float:
    e = innovation - innovation.mean()
    power = float(e @ e)
    return sum((float(e[lag:] @ e[:-lag]) / power) ** 2 for lag in range(1, _LAGS + 1))
