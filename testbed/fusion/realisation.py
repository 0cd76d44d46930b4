"""State matrices of a transfer function, modal: every state is a part of the reading, so that all are of its size."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from testbed.signals import ComplexArray, FloatArray

# Poles closer than this, relative to their size, are one: their mean, as often as there are poles.
CLOSEST_POLES = 1e-3
# Points of the contour integral around poles that are one; its error falls as a geometric series.
_CONTOUR = 256


@dataclass(frozen=True)
class Realisation:
    """State matrices of one sensor: x' = A x + B u, y = C x + D u; A block diagonal, C of ones and zeros.

    Parameters
    ----------
    A, B, C : ndarray, shapes (n_state, n_state), (n_state,), (n_state,)
        Dynamics [1/s], input [1/s] and output [-].
    D : float
        Feed-through [-].
    """

    A: FloatArray
    B: FloatArray
    C: FloatArray
    D: float

    def response(self, freq_hz: FloatArray) -> ComplexArray:
        """Return C (s I - A)^-1 B + D [-] at s = 2 pi j f, complex, shape (n_freq,), for frequencies [Hz] of that
        shape.
        """
        s = 2j * np.pi * np.asarray(freq_hz, float)[:, None, None]
        state = np.linalg.solve(
            s * np.eye(self.B.size) - self.A, np.broadcast_to(self.B[:, None], (s.size, self.B.size, 1))
        )
        value: ComplexArray = (state[..., 0] @ self.C) + self.D
        return value


def realise(numerator: FloatArray, denominator: FloatArray) -> Realisation:
    r"""Return the modal realisation of a transfer function.

    .. math:: G(s) = D + \sum_i \sum_{j=1}^{m_i} c_{ij} / (s - p_i)^j

    A real pole is the state x' = p x + c u; a pair is a rotation; m equal poles are a chain, x_j' = p x_j + |p| x_{j+1}
    + b_j u, whose first state is the part of the reading. The output is the sum of the states (first ones of pairs and
    chains). Poles within 0.1 % of each other count as equal, at their mean, which changes the response by the square of
    that at most.

    Parameters
    ----------
    numerator, denominator : ndarray, shapes (n_num,), (n_den,)
        Coefficients in s, highest power first; without a pole it is a factor, and there is no state.

    Returns
    -------
    Realisation
        A [1/s], B [1/s], C [-], D [-], shapes (n, n), (n,), (n,).

    Raises
    ------
    ValueError
        If the transfer function is improper or unstable.
    """
    a, b = _monic(np.asarray(denominator, float), np.asarray(numerator, float))
    poles = np.roots(a).astype(complex)
    if np.any(poles.real > 0.0):
        msg = f"denominator: expected a stable sensor, got the poles {np.round(poles, 6).tolist()} rad/s"
        raise ValueError(msg)
    D = float(b[0])
    blocks = [_Block(p, parts) for p, parts in _partial_fractions(a, b - D * a, poles)]
    return _modal(sorted(blocks, key=lambda one: abs(one.pole)), poles.size, D)


def _monic(a: FloatArray, b: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return denominator and numerator of equal length, divided by the leading coefficient of the denominator."""
    a, b = np.trim_zeros(a, "f"), np.trim_zeros(b, "f")
    if not a.size:
        msg = "denominator: expected a coefficient that is not 0, got none"
        raise ValueError(msg)
    if b.size > a.size:
        msg = f"numerator: expected a degree of at most {a.size - 1} (the denominator's), got {b.size - 1}"
        raise ValueError(msg)
    return a / a[0], np.concatenate([np.zeros(a.size - b.size), b]) / a[0]


@dataclass(frozen=True)
class _Block:
    """A pole of the upper half plane [rad/s] and the coefficients c_1 ... c_m of its partial fractions."""

    pole: complex
    parts: ComplexArray


def _partial_fractions(a: FloatArray, rest: FloatArray, poles: ComplexArray) -> list[tuple[complex, ComplexArray]]:
    """Return the poles with an imaginary part from 0 on, equal ones once, each with its coefficients."""
    found = []
    for members in _groups(poles):
        if members.size == 1 and members[0].imag >= 0.0:
            pole = members[0]
            parts = (np.polyval(rest, members) / np.polyval(np.polyder(a), members)).astype(complex)
        elif members.size > 1 and members.imag.sum() > -CLOSEST_POLES * np.abs(members).sum():
            pole, parts = _equal_poles(a, rest, poles, members)
        else:
            continue
        found.append((complex(pole), parts))
    return found


def _groups(poles: ComplexArray) -> list[ComplexArray]:
    """Return the poles in groups of those that count as equal."""
    distance = np.abs(poles[:, None] - poles[None, :])
    near = distance <= CLOSEST_POLES * np.abs(poles)
    near |= near.T
    free, groups = set(range(poles.size)), []
    while free:
        group, waiting = set(), {min(free)}
        while waiting:
            group |= waiting
            waiting = {int(j) for i in waiting for j in np.flatnonzero(near[i])} - group
        free -= group
        groups.append(poles[sorted(group)])
    return groups


def _equal_poles(
    a: FloatArray, rest: FloatArray, poles: ComplexArray, members: ComplexArray
) -> tuple[complex, ComplexArray]:
    r"""Return the mean of poles that count as equal and its coefficients.

    .. math:: c_j = \frac{1}{2 \pi i} \oint (G - D) (s - p)^{j-1} ds

    by the trapezoid rule on a circle that holds these poles and no other.
    """
    mean = complex(members.mean())
    # Where the group is on the real axis, rounding alone has moved it off.
    if abs(mean.imag) <= CLOSEST_POLES * abs(mean):
        mean = complex(mean.real, 0.0)
    inside = np.abs(members - mean).max()
    outside = np.abs(poles - mean)[~np.isin(poles, members)].min(initial=max(abs(mean), 1.0))
    # Far from the poles, where rounding of the polynomials counts least.
    radius = max(math.sqrt(inside * outside), 0.5 * outside)
    turn = np.exp(2j * np.pi * (np.arange(_CONTOUR) + 0.5) / _CONTOUR)
    s = mean + radius * turn
    value = np.polyval(rest, s) / np.polyval(a, s)
    parts = np.array([np.mean(value * (radius * turn) ** j) for j in range(1, members.size + 1)])
    return mean, parts if mean.imag > 0.0 else parts.real.astype(complex)


def _modal(blocks: list[_Block], n: int, D: float) -> Realisation:
    """Return the block-diagonal realisation of the poles and their partial fractions, in the order given."""
    A, B, C = np.zeros((n, n)), np.zeros(n), np.zeros(n)
    i = 0
    for block in blocks:
        size = 2 if block.pole.imag > 0.0 else 1
        link = abs(block.pole) or 1.0
        C[i] = 1.0
        for j, part in enumerate(block.parts / link ** np.arange(block.parts.size)):
            mine = slice(i, i + size)
            if size == 1:
                A[i, i], B[i] = block.pole.real, part.real
            else:
                A[mine, mine] = [[block.pole.real, block.pole.imag], [-block.pole.imag, block.pole.real]]
                B[mine] = 2.0 * part.real, -2.0 * part.imag
            if j + 1 < block.parts.size:
                A[mine, i + size : i + 2 * size] = link * np.eye(size)
            i += size
    return Realisation(A, B, C, D)
