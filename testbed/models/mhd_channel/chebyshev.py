"""Wall-clustered spectral grid on [0, 1]: Chebyshev-Gauss-Lobatto points, derivatives, Clenshaw-Curtis mean.

Points and weights are those of n intervals, n even. Flow that is even about the centre needs half of them only:
see `even_operators` and `even_transport`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from testbed.signals import FloatArray


def chebyshev_points(intervals: int) -> FloatArray:
    r"""Return the points, :math:`x_j = \sin^2(\pi j / 2n)`: spacing ~ 1/n^2 at the walls, 1/n in the middle.

    Parameters
    ----------
    intervals : int
        Number n of intervals [-].

    Returns
    -------
    ndarray, shape (intervals + 1,)
        Ascending, 0 and 1 included [-].
    """
    # Mirrored rather than computed twice, so that the grid is symmetric to the last bit.
    points: FloatArray = np.sin(np.pi * np.arange(intervals + 1) / (2 * intervals)) ** 2
    half = (intervals + 1) // 2
    points[-half:] = 1.0 - points[:half][::-1]
    return points


def derivatives(intervals: int) -> tuple[FloatArray, FloatArray]:
    """Return the matrices that differentiate the interpolating polynomial once and twice.

    Parameters
    ----------
    intervals : int
        Number n of intervals, even [-].

    Returns
    -------
    first, second : ndarray, shape (intervals + 1, intervals + 1)
        Derivatives at the points from the values at the points [-].

    References
    ----------
    Weideman and Reddy, ACM Trans. Math. Softw. 26 (2000) 465, equations (13)-(14).
    """
    inverse = _inverse_differences(intervals)
    weight = np.where(np.arange(intervals + 1) % 2, -1.0, 1.0)
    weight[[0, -1]] *= 2.0
    ratio = weight[:, None] / weight[None, :]
    derivative: FloatArray = np.eye(intervals + 1)
    found = []
    for order in (1, 2):
        derivative = order * inverse * (ratio * np.diag(derivative)[:, None] - derivative)
        # Rows sum to zero in exact arithmetic; enforcing it cancels most of the rounding, which grows as n^4.
        np.fill_diagonal(derivative, 0.0)
        np.fill_diagonal(derivative, -derivative.sum(axis=1))
        found.append(derivative)
    return found[0], found[1]


def _inverse_differences(intervals: int) -> FloatArray:
    """Return 1/(x_i - x_j), zero on the diagonal; from sines, as subtracting points would lose digits at the walls."""
    angle = np.pi * np.arange(intervals + 1) / (2 * intervals)
    difference = np.sin(angle[:, None] + angle[None, :]) * np.sin(angle[:, None] - angle[None, :])
    half = intervals // 2
    difference[half + 1 :] = -difference[:half][::-1, ::-1]
    np.fill_diagonal(difference, np.inf)
    inverse: FloatArray = 1.0 / difference
    return inverse


def clenshaw_curtis(intervals: int) -> FloatArray:
    """Return the weights of the mean over [0, 1], exact for polynomials up to degree `intervals`.

    Parameters
    ----------
    intervals : int
        Number n of intervals, even [-].

    Returns
    -------
    ndarray, shape (intervals + 1,)
        Positive, sum 1; the two wall weights are 1/(2 (n^2 - 1)) [-].

    References
    ----------
    Clenshaw and Curtis, Numer. Math. 2 (1960) 197.
    """
    order = np.arange(intervals // 2 + 1)
    angle = np.pi * np.arange(intervals + 1) / intervals
    coefficient = 2.0 / (1.0 - 4.0 * order**2)
    coefficient[[0, -1]] *= 0.5
    weight: FloatArray = np.cos(2.0 * np.outer(angle, order)) @ coefficient / intervals
    weight[[0, -1]] *= 0.5
    return weight


def even_operators(intervals: int) -> tuple[FloatArray, FloatArray]:
    """Return second derivative and mean of functions even about the centre that vanish at both walls.

    Uniform forcing excites nothing else, so half of the unknowns are enough: the values at the points 1 ... n/2.

    Parameters
    ----------
    intervals : int
        Number n of intervals, even [-].

    Returns
    -------
    second : ndarray, shape (intervals/2, intervals/2)
        Second derivative at these points [-].
    mean : ndarray, shape (intervals/2,)
        Weights of the mean over [0, 1] [-].
    """
    half = intervals // 2
    second = _folded(derivatives(intervals)[1])
    mean = clenshaw_curtis(intervals)[1 : half + 1].copy()
    mean[: half - 1] *= 2.0
    return second, mean


def even_transport(intervals: int) -> tuple[FloatArray, FloatArray]:
    """Return slope and integral, at the points of `even_operators`, of such a function; both are odd.

    Parameters
    ----------
    intervals : int
        Number n of intervals, even [-].

    Returns
    -------
    slope : ndarray, shape (intervals/2, intervals/2)
        First derivative at these points [-].
    integral : ndarray, shape (intervals/2, intervals/2)
        Integral of the interpolating polynomial from 0 to these points [-].
    """
    first = derivatives(intervals)[0]
    # The integral is what has the function as its derivative and vanishes at 0, where the first row says so.
    pinned = first.copy()
    pinned[0] = 0.0
    pinned[0, 0] = 1.0
    integral = np.asarray(np.linalg.inv(pinned), np.float64)
    integral[:, 0] = 0.0
    return _folded(first), _folded(integral)


def _folded(full: FloatArray) -> FloatArray:
    """Return the rows 1 ... n/2 of an operator on all points for functions that are even and zero at the walls."""
    intervals = len(full) - 1
    half = intervals // 2
    folded = full[1 : half + 1, 1 : half + 1].copy()
    folded[:, : half - 1] += full[1 : half + 1, intervals - 1 : half : -1]
    return folded
