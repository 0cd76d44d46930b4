"""Analogue stages in time: low-passes, delay, rails. State is kept, so any division into blocks gives the same bits."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np
from numba import njit

from testbed.signals import Recursion

if TYPE_CHECKING:
    from testbed.signals import ComplexArray, FloatArray


class AnalogueStage(Protocol):
    """One block in time."""

    def process(self, u: FloatArray) -> FloatArray:
        """Return the block's output at the instants of its input `u`, same unit."""


def hold_coefficients(h: complex) -> ComplexArray:
    r"""Return the c_j of a first-order low-pass that is exact for an input cubic through the last four samples.

    .. math:: y_k = p y_{k-1} + \sum_{j=0}^{3} c_j u_{k-j}, \quad p = e^{-h}

    Parameters
    ----------
    h : complex
        Minus the pole times the sample period [-].

    Returns
    -------
    ndarray of complex, shape (4,)
        c_j, real for a real pole [-].
    """
    order = np.arange(4)
    factorial = np.array([1.0, 1.0, 2.0, 6.0])
    # Taylor coefficients in sT of (1 - p exp(-sT)) / (1 + sT / h) and of exp(-j sT).
    numerator = -np.exp(-h) * (-1.0) ** order / factorial
    numerator[0] += 1.0
    wanted = np.convolve(numerator, (-1.0 / h) ** order)[:4]
    delays = (-1.0) ** order[:, None] * order[None, :] ** order[:, None] / factorial[:, None]
    c: ComplexArray = np.linalg.solve(delays, wanted)
    return c


class OnePole:
    r"""A first-order low-pass, exact for an input that is a cubic through the last four samples.

    The coefficients match the response to third order in s: within 1e-3 at 1/20 of the sample rate, where a
    straight line between samples would lose 0.8 %.

    Parameters
    ----------
    pole_hz : float
        Corner [Hz].
    sample_rate_hz : float
        Rate of the samples [Hz].
    """

    def __init__(self, pole_hz: float, sample_rate_hz: float) -> None:
        h = 2.0 * np.pi * pole_hz / sample_rate_hz
        self._recursion = Recursion(hold_coefficients(h), np.array([1.0, -np.exp(-h)]))

    def process(self, u: FloatArray) -> FloatArray:
        """Return the filtered samples, shape (n_time,), unit of `u`; at rest before the first."""
        y: FloatArray = self._recursion.process(u)
        return y


class LowPassStage:
    """A low-pass as the real part of complex first-order sections in parallel, each with the hold of `OnePole`.

    Parameters
    ----------
    h : ndarray of complex, shape (n_section,)
        Minus pole times sample period [-].
    weight : ndarray of complex, shape (n_section,)
        Share of each section at DC [-].
    """

    def __init__(self, h: ComplexArray, weight: ComplexArray) -> None:
        self._sections = [
            Recursion(w * hold_coefficients(each), np.array([1.0, -np.exp(-each)]))
            for each, w in zip(h, weight, strict=True)
        ]

    def process(self, u: FloatArray) -> FloatArray:
        """Return the filtered samples, shape (n_time,), unit of `u`; at rest before the first."""
        y = np.zeros(u.size)
        for section in self._sections:
            y += section.process(u).real
        return y


class DelayStage:
    """A delay of any number of samples: a cubic through the four samples around the instant (Lagrange).

    Whole delays are exact; in between the response is within 4.2e-2 (2 pi f T)^4, 4e-4 at 1/20 of the sample rate.

    Parameters
    ----------
    n_samples : float
        Delay over sample period [-].
    """

    def __init__(self, n_samples: float) -> None:
        nearest = round(n_samples)
        # A product such as 100 us times 20 kHz is a whole number but for its rounding.
        exact = float(nearest) if abs(n_samples - nearest) < 1e-9 * max(nearest, 1) else n_samples
        skip = max(int(exact) - 1, 0)
        tap, fraction = np.arange(4), exact - skip
        self._weight = [float(np.prod((fraction - tap[tap != j]) / (j - tap[tap != j]))) for j in tap]
        self._past = np.zeros(skip + 3)

    def process(self, u: FloatArray) -> FloatArray:
        """Return the delayed samples, shape (n_time,), unit of `u`; zero before the first has come through."""
        line = np.concatenate([self._past, u])
        y = np.zeros(u.size)
        for j, weight in enumerate(self._weight):
            y += weight * line[3 - j : 3 - j + u.size]
        self._past = line[u.size :]
        return y


class SaturationStage:
    r"""Rails that charge with the overload: :math:`\tau \dot q = e - q`, e = x - clip(x), output clip(x + q).

    After an overload of E that lasted long the output stays at the rail until E exp(-t/tau) no longer lifts the signal
    to it, then creeps back with tau. The overload is taken as constant over each sample period.

    Parameters
    ----------
    limit : float
        Of the output, symmetric, unit of the samples.
    recovery_time : float
        tau [s].
    sample_rate_hz : float
        Rate of the samples [Hz].
    """

    def __init__(self, limit: float, recovery_time: float, sample_rate_hz: float) -> None:
        self._limit, self._charge = limit, 0.0
        step = 1.0 / (recovery_time * sample_rate_hz) if recovery_time > 0.0 else np.inf
        # Without a time constant there is no charge at all, or it would outlive its overload by one sample.
        self._keep, self._fill = float(np.exp(-step)), float(-np.expm1(-step)) if recovery_time > 0.0 else 0.0

    def process(self, x: FloatArray) -> FloatArray:
        """Return the clipped samples, shape (n_time,), unit of `x`."""
        y = np.empty_like(x)
        self._charge = saturate(np.ascontiguousarray(x), self._limit, self._keep, self._fill, self._charge, y)
        return y


@njit(cache=True)
def saturate(x, limit, keep, fill, charge, y):  # type: ignore[no-untyped-def] # pragma: no cover
    """Set y = clip(x + q), q+ = keep q + fill (x - clip(x)); return the last q."""
    for k in range(x.size):
        held = min(max(x[k], -limit), limit)
        y[k] = min(max(x[k] + charge, -limit), limit)
        charge = keep * charge + fill * (x[k] - held)
    return charge
