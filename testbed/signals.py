"""Sampled signals: exact time bases, named random streams, linear filters that keep their state between blocks, and
white noise through a linear system.
"""

from __future__ import annotations

import math
import zlib
from typing import Any, Literal

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.linalg import expm

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

# Base clock of a run, unless all its sensors are content with less.
BASE_RATE_HZ = 20_000.0
# Samples worked on at a time: a second of the base clock.
BLOCK = 20_000
# Median of the magnitude of a normal variable over its standard deviation.
NORMAL_MEDIAN = 0.6744897501960817


def sample_times(start: int, n_time: int, sample_rate_hz: float) -> FloatArray:
    """Return k / fs for k = start ... start + n_time - 1 [s]; never an accumulated sum, so it does not drift."""
    times: FloatArray = np.arange(start, start + n_time) / sample_rate_hz
    return times


def random_stream(seed: int, *names: str) -> np.random.Generator:
    """Return the generator that belongs to `names` under `seed`.

    Each name (sensor, noise term) has a stream of its own, so that adding or switching off one leaves the others
    bit-identical.
    """
    key = tuple(zlib.crc32(name.encode()) for name in names)
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=key))


@njit(cache=True)
def _advance(x, Phi, Gamma, step, C, D, previous, u, y):  # type: ignore[no-untyped-def] # pragma: no cover
    """x+ = Phi x + Gamma u + step (u+ - u); y = C x + D u."""
    n = x.size
    x_next = np.empty(n)
    for k in range(u.size):
        increment = u[k] - previous
        total = D * u[k]
        for i in range(n):
            value = Gamma[i] * previous + step[i] * increment
            for j in range(n):
                value += Phi[i, j] * x[j]
            x_next[i] = value
            total += C[i] * value
        for i in range(n):
            x[i] = x_next[i]
        previous = u[k]
        y[k] = total
    return previous


@njit(cache=True)
def _recur(b, a, u, z, y):  # type: ignore[no-untyped-def] # pragma: no cover
    """Set y = z_1 + b_0 u; z_i+ = z_(i+1) + b_i u - a_i y, none behind the last."""
    last = z.size - 1
    for k in range(u.size):
        out = z[0] + b[0] * u[k]
        for i in range(last):
            z[i] = z[i + 1] + b[i + 1] * u[k] - a[i + 1] * out
        z[last] = b[last + 1] * u[k] - a[last + 1] * out
        y[k] = out


class Recursion:
    r"""A difference equation, whose state is kept between calls (transposed direct form II).

    .. math:: y_k = \sum_{i=0}^n b_i u_{k-i} - \sum_{i=1}^n a_i y_{k-i}

    Parameters
    ----------
    b : ndarray, shape (n + 1,)
        Coefficients of the input, newest first, real or complex [-].
    a : ndarray, shape (m,)
        Those of the output; the first is 1, what is missing 0 [-].
    """

    def __init__(self, b: FloatArray | ComplexArray, a: FloatArray | ComplexArray) -> None:
        # NumPy's promotion: complex if one of them is.
        kind = np.result_type(b, a, float)
        # A delay at least, which the kernel counts on.
        n = max(len(a), len(b), 2)
        self._b, self._a, self.state = np.zeros(n, kind), np.zeros(n, kind), np.zeros(n - 1, kind)
        self._b[: len(b)], self._a[: len(a)] = b, a

    def process(self, u: FloatArray) -> Any:
        """Return the output, shape (n_time,), unit of `u`; at rest before the first, unless `state` was set."""
        y = np.empty(u.size, self._b.dtype)
        _recur(self._b, self._a, np.ascontiguousarray(u), self.state, y)
        return y


class LinearFilter:
    r"""A transfer function in time, exact for an input that is linear between samples (first-order hold), or held.

    .. math:: \dot x = A x + B u, \quad y = C x + D u, \quad u(t_k + \tau) = u_k + (u_{k+1} - u_k) \tau / T

    State is kept between calls, so any division into blocks gives the same bits. It starts from rest (x = 0, u = 0
    before the first sample; a first sample other than zero is a step), unless it is told to `settle`.

    Parameters
    ----------
    numerator, denominator : array_like
        Coefficients in s [rad/s], highest power first; the numerator's degree is at most the denominator's.
    sample_rate_hz : float
        Rate of the samples [Hz].
    hold : {"first", "zero"}, optional
        Between samples the input is linear, or stays as it was.

    Raises
    ------
    ValueError
        If the transfer function is improper.
    """

    def __init__(
        self,
        numerator: FloatArray | list[float],
        denominator: FloatArray | list[float],
        sample_rate_hz: float,
        *,
        hold: Literal["first", "zero"] = "first",
    ) -> None:
        A, B, C, D = companion(
            np.atleast_1d(np.asarray(numerator, float)), np.atleast_1d(np.asarray(denominator, float))
        )
        n, T = B.size, 1.0 / sample_rate_hz
        block = np.zeros((n + 2, n + 2))
        block[:n, :n], block[:n, n], block[n, n + 1] = A * T, B * T, 1.0
        power = expm(block)
        self._Phi, self._Gamma, self._step = power[:n, :n].copy(), power[:n, n].copy(), power[:n, n + 1].copy()
        if hold == "zero":
            self._step[:] = 0.0
        self._C, self._D = C, D
        self._x, self._previous, self._started = np.zeros(n), 0.0, False

    def settle(self, level: float) -> None:
        """Start, before the first sample, as if the input had been constant for ever.

        Parameters
        ----------
        level : float
            The constant, any unit.
        """
        if self._x.size:
            self._x[:] = np.linalg.solve(np.eye(self._x.size) - self._Phi, self._Gamma) * level

    def process(self, u: FloatArray) -> FloatArray:
        """Filter the next samples.

        Parameters
        ----------
        u : ndarray, shape (n_time,)
            Input, any unit.

        Returns
        -------
        ndarray, shape (n_time,)
            Output at the same instants, unit of `u`.
        """
        y = np.empty(u.size)
        if u.size and not self._started:
            # From rest a jump at t = 0 leaves the state as it is: only the feed-through passes it at once.
            self._previous, self._started = float(u[0]), True
            y[0] = self._C @ self._x + self._D * u[0]
            self._previous = _advance(
                self._x, self._Phi, self._Gamma, self._step, self._C, self._D, self._previous, u[1:], y[1:]
            )
        elif u.size:
            self._previous = _advance(
                self._x, self._Phi, self._Gamma, self._step, self._C, self._D, self._previous, u, y
            )
        return y


def companion(numerator: FloatArray, denominator: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, float]:
    """Return (A, B, C, D) of a transfer function in a companion form balanced by a diagonal scaling of powers of the
    corner.

    Parameters
    ----------
    numerator, denominator : ndarray, shapes (n_num,), (n_state + 1,)
        Coefficients in s, highest power first.

    Returns
    -------
    A, B, C : ndarray, shapes (n_state, n_state), (n_state,), (n_state,)
        State matrices [1/s], [1/s], [-].
    D : float
        Feed-through.

    Raises
    ------
    ValueError
        If the degree of the numerator exceeds the denominator's or the leading coefficient is zero.
    """
    a = np.trim_zeros(denominator, "f")
    b = np.trim_zeros(numerator, "f")
    n = a.size - 1
    if a.size == 0 or b.size > a.size:
        msg = f"numerator: expected a degree of at most {n}, got {b.size - 1}"
        raise ValueError(msg)
    b = np.concatenate([np.zeros(a.size - b.size), b]) / a[0]
    a = a / a[0]
    D = float(b[0])
    remainder = b[1:] - D * a[1:]
    # s = w s': with the geometric mean of the poles as unit of frequency the coefficients are of order one.
    corner = float(abs(a[-1]) ** (1.0 / n)) if n and a[-1] != 0.0 else 1.0
    scale = corner ** np.arange(1, n + 1)
    A = np.zeros((n, n))
    B = np.zeros(n)
    if n:
        A[0] = -a[1:] / scale
        A[1:, :-1] = np.eye(n - 1)
        A *= corner
        B[0] = corner
    return A, B, remainder / scale, D


def transfer(
    numerator: FloatArray | list[float], denominator: FloatArray | list[float], freq_hz: FloatArray
) -> ComplexArray:
    """Return b(s)/a(s) at s = 2 pi j f, complex, shape (n_freq,)."""
    s = 2j * np.pi * np.asarray(freq_hz, float)
    value: ComplexArray = np.polyval(np.asarray(numerator, float), s) / np.polyval(np.asarray(denominator, float), s)
    return value


def van_loan(A: FloatArray, Qc: FloatArray, T: float) -> tuple[FloatArray, FloatArray]:
    r"""Discretise x' = A x + white noise of density Qc over a step T.

    .. math:: F = e^{A T}, \quad Q = \int_0^T e^{A s} Q_c e^{A' s} ds

    by one matrix exponential (Van Loan 1978) over T / 2^k, doubled k times: exp(-A T) of a fast pole would overflow or
    cancel otherwise.

    Parameters
    ----------
    A, Qc : ndarray, shape (n_state, n_state)
        Dynamics [1/s] and density of the white noise [state^2/s].
    T : float
        Step [s].

    Returns
    -------
    F, Q : ndarray, shape (n_state, n_state)
        Transition [-] and covariance [state^2], symmetric.
    """
    n = A.shape[0]
    doublings = max(0, math.ceil(math.log2(max(float(np.linalg.norm(A, 1)) * T, 1e-300))))
    step = T / 2**doublings
    power = expm(np.block([[-A, Qc], [np.zeros((n, n)), A.T]]) * step)
    F: FloatArray = power[n:, n:].T.copy()
    Q: FloatArray = F @ power[:n, n:]
    for _ in range(doublings):
        Q = Q + F @ Q @ F.T
        F = F @ F
    return F, 0.5 * (Q + Q.T)
