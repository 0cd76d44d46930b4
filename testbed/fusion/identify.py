"""Transfer functions fitted to a frequency response, for a belief about a sensor."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import least_squares

if TYPE_CHECKING:
    from testbed.signals import ComplexArray, FloatArray


def fit_transfer(
    freq_hz: FloatArray, response: ComplexArray, n_pole: int, *, blind_to_constant: bool = False
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    r"""Fit b(s)/a(s) with `n_pole` stable poles and one degree less in b to a frequency response.

    .. math:: \min \sum_k |b(s_k) / (a(s_k) G_k) - 1|^2

    Poles come in pairs (natural frequency, damping; real above 1) and, if `n_pole` is odd, one single; they are searched by nonlinear least
    squares from places evenly spread over the logarithm of the band, and b is the linear least-squares solution for each trial.

    Parameters
    ----------
    freq_hz : ndarray, shape (n_freq,)
        Frequencies, above zero [Hz].
    response : ndarray of complex, shape (n_freq,)
        Response there, not zero [-].
    n_pole : int
        Number of poles.
    blind_to_constant : bool, optional
        The response at f = 0 is zero, so b has no constant term.

    Returns
    -------
    numerator, denominator : tuple of float
        Coefficients in s [rad/s], highest power first.
    """
    s = 2j * np.pi * np.asarray(freq_hz, float)
    reference = float(np.sqrt(np.abs(s[0]) * np.abs(s[-1])))
    powers = np.arange(n_pole - 1, -1 + blind_to_constant, -1)
    basis = (s[:, None] / reference) ** powers / np.asarray(response)[:, None]

    def solve(trial: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        a = _denominator(trial, n_pole)
        columns = basis / np.polyval(a, s / reference)[:, None]
        b, *_ = np.linalg.lstsq(np.vstack([columns.real, columns.imag]), np.repeat([1.0, 0.0], s.size), rcond=None)
        error = columns @ b - 1.0
        return a, b, np.concatenate([error.real, error.imag])

    places = np.geomspace(abs(s[0]), abs(s[-1]), n_pole + 2)[1:-1] / reference
    start = [np.log(np.sqrt(places[i] * places[i + 1])) for i in range(0, n_pole - 1, 2)]
    start += [0.5 * np.log((places[i] + places[i + 1]) ** 2 / (4 * places[i] * places[i + 1])) for i in range(0, n_pole - 1, 2)]
    start += [np.log(places[-1])] * (n_pole % 2)
    best = least_squares(lambda trial: solve(trial)[2], start, xtol=1e-15, ftol=1e-15, gtol=1e-15, max_nfev=2000).x
    a, b, _ = solve(best)
    denominator = a * reference ** np.arange(n_pole + 1)
    numerator = np.zeros(n_pole)
    numerator[: b.size] = b * reference ** (n_pole - powers)
    return tuple(map(float, numerator)), tuple(map(float, denominator))


def _denominator(trial: FloatArray, n_pole: int) -> FloatArray:
    """Return the monic polynomial of the pairs (logarithms of natural frequencies, then of dampings) and the single pole."""
    pairs = n_pole // 2
    a = np.ones(1)
    for natural, damping in zip(np.exp(trial[:pairs]), np.exp(trial[pairs : 2 * pairs]), strict=True):
        a = np.convolve(a, [1.0, 2.0 * damping * natural, natural**2])
    return np.convolve(a, [1.0, np.exp(trial[-1])]) if n_pole % 2 else a
