"""Local mean decomposition: product functions, each an envelope times a signal of constant amplitude, fastest first."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.stats import kurtosis

from testbed.compensation.emd import checked_signal

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from testbed.signals import FloatArray

_MOST_SIFTS, _MOST_FUNCTIONS = 12, 24
# Extrema, ends included, below which there is nothing left to take the mean of.
_LEAST_EXTREMA = 5
# Envelopes are not divided by where they all but vanish.
_FLOOR = 1e-3


def local_mean_decomposition(signal: FloatArray) -> FloatArray:
    r"""Decompose a record into product functions, fastest first: :math:`x = \sum_k p_k + r`.

    With the extrema n_i, the local mean is (n_i + n_{i+1}) / 2 and the local amplitude |n_i - n_{i+1}| / 2 from one to
    the next, both smoothed by a moving average m and a,

    .. math:: h_j = s_{j-1} - m_j, \quad s_j = h_j / a_j, \quad p = s_J \prod_j a_j, \quad s_0 = x - \sum p,

    until the envelope a_j is one [1]_. Optimised as in [2]_: the moving average spans the mean distance of extrema plus
    three standard deviations, and the sift ends where rms plus excess kurtosis of a_j - 1 no longer falls.

    Parameters
    ----------
    signal : ndarray, shape (n_time,)
        Equally spaced samples, any unit.

    Returns
    -------
    ndarray, shape (n_function + 1, n_time)
        Product functions, then the residual; the unit of `signal`. Their sum is the signal.

    Raises
    ------
    ValueError
        If the signal is empty, not one-dimensional or not finite.

    References
    ----------
    .. [1] Smith, J. R. Soc. Interface 2 (2005) 443-454.
    .. [2] Liu, Jin, Zuo, Feng, Mech. Syst. Signal Process. 95 (2017) 468-487.
    """
    residual = checked_signal(signal)
    functions: list[FloatArray] = []
    while len(functions) < _MOST_FUNCTIONS and extrema(residual).size >= _LEAST_EXTREMA:
        functions.append(product_function(residual))
        residual = residual - functions[-1]
    return np.stack([*functions, residual])


def product_function(signal: FloatArray) -> FloatArray:
    """Return the fastest product function of a signal that has extrema.

    Parameters
    ----------
    signal : ndarray, shape (n_time,)
        Any unit.

    Returns
    -------
    ndarray, shape (n_time,)
        Unit of `signal`.
    """
    mean, envelope = mean_and_amplitude(signal)
    found, best = signal - mean, np.inf
    carrier = found / envelope
    for _ in range(_MOST_SIFTS - 1):
        if extrema(carrier).size < _LEAST_EXTREMA:
            break
        mean, amplitude = mean_and_amplitude(carrier)
        cost = _roughness(amplitude - 1.0)
        if cost >= best:
            break
        carrier, envelope, best = (carrier - mean) / amplitude, envelope * amplitude, cost
        found = envelope * carrier
    return found


def _roughness(flatness: FloatArray) -> float:
    return float(np.sqrt(np.mean(flatness**2)) + abs(kurtosis(flatness)))


def mean_and_amplitude(signal: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return local mean and local amplitude, both smoothed, shape (n_time,), unit of the signal.

    Parameters
    ----------
    signal : ndarray, shape (n_time,)
        With extrema.
    """
    at = extrema(signal)
    steps = np.diff(at)
    width = max(3, 2 * (round(float(steps.mean() + 3.0 * steps.std())) // 2) + 1)
    # The last step also covers the last sample.
    counts = steps.copy()
    counts[-1] += 1
    mean = np.repeat(0.5 * (signal[at[:-1]] + signal[at[1:]]), counts)
    amplitude = np.repeat(0.5 * np.abs(np.diff(signal[at])), counts)
    # Twice: the mean of a staircase has corners, that of its mean has none.
    smooth = [
        uniform_filter1d(uniform_filter1d(row, width, mode="mirror"), width, mode="mirror") for row in (mean, amplitude)
    ]
    return smooth[0], np.maximum(smooth[1], _FLOOR * smooth[1].max())


def extrema(signal: FloatArray) -> NDArray[np.intp]:
    """Return the indices of the local extrema between the two ends, ends included; of a plateau its first sample.

    Parameters
    ----------
    signal : ndarray, shape (n_time,)
        Any unit.
    """
    moves = np.flatnonzero(np.diff(signal))
    rising = signal[moves + 1] > signal[moves]
    turns = rising[1:] != rising[:-1]
    return np.concatenate([[0], moves[:-1][turns] + 1, [signal.size - 1]])
