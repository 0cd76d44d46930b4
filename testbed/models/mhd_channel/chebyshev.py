"""Wall-clustered spectral grid on [0, 1]: Chebyshev-Gauss-Lobatto points, second derivative, Clenshaw-Curtis mean.

Points and weights are those of n intervals, n even. Flow that is even about the centre needs half of them only:
see `even_operators`.
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


def second_derivative(intervals: int) -> FloatArray:
    """Return the matrix that differentiates the interpolating polynomial twice.

    Parameters
    ----------
    intervals : int
        Number n of intervals, even [-].

    Returns
    -------
    ndarray, shape (intervals + 1, intervals + 1)
        Second derivative at the points from the values at the points [-].

    References
    ----------
    Weideman and Reddy, ACM Trans. Math. Softw. 26 (2000) 465, equations (13)-(14).
    """
    inverse = _inverse_differences(intervals)
    weight = np.where(np.arange(intervals + 1) % 2, -1.0, 1.0)
    weight[[0, -1]] *= 2.0
    ratio = weight[:, None] / weight[None, :]
    derivative: FloatArray = np.eye(intervals + 1)
    for order in (1, 2):
        derivative = order * inverse * (ratio * np.diag(derivative)[:, None] - derivative)
        # Rows sum to zero in exact arithmetic; enforcing it cancels most of the rounding, which grows as n^4.
        np.fill_diagonal(derivative, 0.0)
        np.fill_diagonal(derivative, -derivative.sum(axis=1))
    return derivative


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
    full = second_derivative(intervals)[1 : half + 1]
    second = full[:, 1 : half + 1].copy()
    second[:, : half - 1] += full[:, intervals - 1 : half : -1]
    mean = clenshaw_curtis(intervals)[1 : half + 1].copy()
    mean[: half - 1] *= 2.0
    return second, mean
