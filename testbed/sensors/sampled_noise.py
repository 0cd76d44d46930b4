r"""Noise behind a low-pass, drawn exactly at the instants of the readings, whatever their rate.

.. math:: \dot v = -a v + g w, \quad \dot x = A x + b \left(\textstyle\sum_i v_i + n w\right), \quad y = c x

with white noise w of two-sided density one, sections v that shape it, and the low-pass (A, b, c). The density of the
readings is the sum over the aliases, :math:`\sum_k |H|^2 S` at f + k fs, with nothing lost between samples.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numba import njit

from testbed.signals import BASE_RATE_HZ, companion, van_loan

if TYPE_CHECKING:
    from testbed.signals import FloatArray

# Random directions that carry less of the readings' density than this, at every frequency, are left out.
_NEGLIGIBLE = 5e-3
# A start that is this many of the slowest time constants old is stationary.
_AGE = 50.0


@dataclass(frozen=True)
class Shape:
    """What makes a term of white noise: white + sum of gain / (s + pole).

    Parameters
    ----------
    white : float
        n, two-sided root density [rad/sqrt(s)].
    poles, gains : tuple of float
        a_i [rad/s], a random walk having 0, and g_i [rad/s^1.5].
    slope : bool
        The noise is that of an angle, so that the low-pass sees its derivative.
    """

    white: float = 0.0
    poles: tuple[float, ...] = ()
    gains: tuple[float, ...] = ()
    slope: bool = False


@dataclass(frozen=True)
class Rational:
    """What the noise passes: numerator and denominator in s [rad/s], highest power first.

    Parameters
    ----------
    numerator, denominator : tuple of float
        Their coefficients.
    """

    numerator: tuple[float, ...]
    denominator: tuple[float, ...]

    def through(self, other: Rational) -> Rational:
        """Return this one and another, one behind the other."""
        return Rational(
            tuple(np.polymul(self.numerator, other.numerator)), tuple(np.polymul(self.denominator, other.denominator))
        )

    def bounded(self, *, slope: bool) -> tuple[FloatArray, FloatArray]:
        """Return the coefficients such that white noise comes through with a finite power.

        A direct path would let all of its band pass: poles at 40 krad/s, whose noise bandwidth is that of the base
        clock, 10 kHz, end it.
        """
        numerator, denominator = (np.trim_zeros(np.array(c), "f") for c in (self.numerator, self.denominator))
        if slope:
            numerator = np.append(numerator, 0.0)
        while numerator.size >= denominator.size:
            denominator = np.polymul(denominator, [0.5 / BASE_RATE_HZ, 1.0])
        return numerator, denominator


@dataclass(frozen=True)
class Sampled:
    """A term and its low-pass from reading to reading: v+ = decay v + Lv w, x+ = F x + M v + Lx w, y = c x.

    `start_v` and `start_x` make a stationary start of normal numbers.
    """

    decay: FloatArray
    F: FloatArray
    M: FloatArray
    Lv: FloatArray
    Lx: FloatArray
    c: FloatArray
    start_v: FloatArray
    start_x: FloatArray


@functools.lru_cache(maxsize=128)
def sampled(shape: Shape, passed: Rational, sample_rate_hz: float) -> Sampled:
    """Return the exact discretisation (Van Loan) of a term behind a low-pass.

    Parameters
    ----------
    shape : Shape
        The term.
    passed : Rational
        The low-pass.
    sample_rate_hz : float
        Rate of the readings [Hz].

    Returns
    -------
    Sampled
        Of as few normal numbers per reading as keep the density to 0.1 %.
    """
    A, b, c = _joint(shape, passed)
    density = np.outer(b, b)
    F, Q = van_loan(A, density, 1.0 / sample_rate_hz)
    root = _few(_root(Q), F, c)
    start = np.zeros_like(A)
    slowest = -np.linalg.eigvals(A).real.max()
    if slowest > 0.0:
        start = _root(van_loan(A, density, _AGE / slowest)[1])
    m = len(shape.poles)
    decay = np.exp(-np.array(shape.poles) / sample_rate_hz)
    parts = (F[m:, m:], F[m:, :m], root[:m], root[m:], c[m:], start[:m], start[m:])
    return Sampled(decay, *(np.ascontiguousarray(part) for part in parts))


def _joint(shape: Shape, passed: Rational) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return dynamics, input of the white noise and output of sections and low-pass together."""
    inner, enter, leave, _ = companion(*passed.bounded(slope=shape.slope))
    m, n = len(shape.poles), enter.size
    A = np.zeros((m + n, m + n))
    A[:m, :m] = -np.diag(shape.poles)
    A[m:, :m] = enter[:, None]
    A[m:, m:] = inner
    return A, np.concatenate([shape.gains, shape.white * enter]), np.concatenate([np.zeros(m), leave])


def _root(Q: FloatArray) -> FloatArray:
    """Return L with L L' = Q, by the eigenvalues of the correlations, so that small variances keep their digits."""
    std = np.sqrt(np.diag(Q))
    size = np.where(std > 0.0, std, 1.0)
    value, vector = np.linalg.eigh(Q / np.outer(size, size))
    root: FloatArray = size[:, None] * vector * np.sqrt(np.maximum(value, 0.0))
    return root


def _few(root: FloatArray, F: FloatArray, c: FloatArray) -> FloatArray:
    """Return a root of the noise turned such that its first columns make the most of the density of the readings, and
    only as many as that needs; the largest entry of each is positive, whatever the library's choice.
    """
    cycles = np.concatenate([np.geomspace(1e-6, 0.5, 120), np.linspace(0.01, 0.5, 50)])
    turned = np.exp(2j * np.pi * cycles)[:, None, None] * np.eye(c.size) - F.T
    response = np.linalg.solve(turned, c[:, None])[:, :, 0] @ root
    response /= np.linalg.norm(response, axis=1, keepdims=True)
    turn = np.linalg.svd(np.concatenate([response.real, response.imag]))[2].T
    missing = 1.0 - np.cumsum(np.abs(response @ turn) ** 2, axis=1)
    kept = (root @ turn)[:, : int(np.argmax(missing.max(axis=0) < _NEGLIGIBLE)) + 1]
    largest = np.take_along_axis(kept, np.abs(kept).argmax(axis=0)[None], axis=0)
    signed: FloatArray = kept * np.sign(largest)
    return signed


@njit(cache=True, fastmath={"reassoc", "nsz"})
def run_sampled(v, x, decay, F, M, Lv, Lx, c, w, y):  # type: ignore[no-untyped-def] # pragma: no cover
    """Set y = c x, x+ = F x + M v + Lx w; v+ = decay v + Lv w."""
    m, n, r = v.size, x.size, w.shape[1]
    x_next = np.empty(n)
    for k in range(y.size):
        total = 0.0
        for i in range(n):
            total += c[i] * x[i]
        y[k] = total
        for i in range(n):
            value = 0.0
            for j in range(n):
                value += F[i, j] * x[j]
            for j in range(m):
                value += M[i, j] * v[j]
            for j in range(r):
                value += Lx[i, j] * w[k, j]
            x_next[i] = value
        for i in range(n):
            x[i] = x_next[i]
        for i in range(m):
            value = decay[i] * v[i]
            for j in range(r):
                value += Lv[i, j] * w[k, j]
            v[i] = value


class SampledNoise:
    """A term behind a low-pass in time, stationary from its first reading; a random walk begins at zero.

    Parameters
    ----------
    system : Sampled
        From `sampled`.
    stream : numpy.random.Generator
        The term's own stream.
    """

    def __init__(self, system: Sampled, stream: np.random.Generator) -> None:
        self._system, self._stream = system, stream
        begin = stream.standard_normal(system.start_v.shape[1])
        self._v, self._x = system.start_v @ begin, system.start_x @ begin

    def process(self, n_time: int) -> FloatArray:
        """Return the noise of the next `n_time` readings [rad/s]."""
        one, y = self._system, np.empty(n_time)
        w = self._stream.standard_normal((n_time, one.Lx.shape[1]))
        run_sampled(self._v, self._x, one.decay, one.F, one.M, one.Lv, one.Lx, one.c, w, y)
        return y
