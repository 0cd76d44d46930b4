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
    squares, and b is the linear least-squares solution for each trial. The search starts from the fixed point of the linear problem that
    weights by the previous a (Sanathanan and Koerner, IEEE Trans. Automatic Control 1963), its poles mirrored to the left.

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

    start = _pairs(_first_poles(s / reference, np.asarray(response), basis, n_pole))

    def misfit(trial: FloatArray) -> FloatArray:
        return solve(trial)[2]

    best = least_squares(misfit, start, xtol=1e-15, ftol=1e-15, gtol=1e-15, max_nfev=2000).x
    a, b, _ = solve(best)
    denominator = a * reference ** np.arange(n_pole + 1)
    numerator = np.zeros(n_pole)
    numerator[: b.size] = b * reference ** (n_pole - powers)
    return tuple(map(float, numerator)), tuple(map(float, denominator))


def _first_poles(s: ComplexArray, response: ComplexArray, basis: ComplexArray, n_pole: int) -> ComplexArray:
    """Return stable poles from (b - G a) / (G a_before) = 0 in the linear least-squares sense, repeated."""
    a = np.poly(-np.geomspace(abs(s[0]), abs(s[-1]), n_pole + 2)[1:-1])
    for _ in range(30):
        weight = 1.0 / np.polyval(a, s)
        lower = -(s[:, None] ** np.arange(n_pole - 1, -1, -1))
        columns = np.hstack([basis, lower]) * weight[:, None]
        wanted = s**n_pole * weight
        real = np.vstack([columns.real, columns.imag])
        size = np.linalg.norm(real, axis=0)
        solution = np.linalg.lstsq(real / size, np.concatenate([wanted.real, wanted.imag]), rcond=None)[0] / size
        poles = np.roots(np.concatenate([[1.0], solution[basis.shape[1] :]])).astype(complex)
        poles = -np.abs(poles.real) + 1j * poles.imag
        a = np.poly(poles).real
    return poles


def _pairs(poles: ComplexArray) -> FloatArray:
    """Return the trial of `_denominator` for poles: complex pairs, neighbouring real poles in pairs, the last real one alone."""
    upper = poles[poles.imag > 0.0]
    single = np.sort(-poles[poles.imag == 0.0].real)
    even = single[: 2 * (single.size // 2)].reshape(-1, 2)
    natural = np.concatenate([np.abs(upper), np.sqrt(even.prod(axis=1))])
    damping = np.concatenate([-upper.real, even.mean(axis=1)]) / natural
    trial: FloatArray = np.log(np.concatenate([natural, damping, single[even.size :]]))
    return trial


def _denominator(trial: FloatArray, n_pole: int) -> FloatArray:
    """Return the monic polynomial of the pairs (logarithms of natural frequencies, then of dampings) and the single pole."""
    pairs = n_pole // 2
    a = np.ones(1)
    for natural, damping in zip(np.exp(trial[:pairs]), np.exp(trial[pairs : 2 * pairs]), strict=True):
        a = np.convolve(a, [1.0, 2.0 * damping * natural, natural**2])
    return np.convolve(a, [1.0, np.exp(trial[-1])]) if n_pole % 2 else a
