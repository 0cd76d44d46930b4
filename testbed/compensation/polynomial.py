"""Least squares in the temperature features, and how much to believe before any: penalties by likelihood."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import minimize

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from testbed.signals import FloatArray

# The search for prior variances stays within e^-12 .. e^12 of the noise's: beyond, a weight is zero or free.
_SPAN = 12.0


@dataclass(frozen=True)
class Polynomial:
    """A weighted sum of standardised features; a polynomial in the temperature through its features.

    Parameters
    ----------
    weights : ndarray, shape (n_feature,)
        One per feature [unit of y].
    bias : float
        Value where all features are at their mean [unit of y].
    """

    weights: FloatArray
    bias: float

    def predict(self, Z: FloatArray) -> FloatArray:
        """Return the prediction at each row, shape (n_time,), of standardised features, shape (n_time, n_feature)."""
        # Column by column: the sum of a row does not depend on the number of rows, as that of a matrix product may.
        total = np.full(len(Z), self.bias)
        for column, weight in zip(Z.T, self.weights, strict=True):
            total += weight * column
        return total


def penalised(U: FloatArray, y: FloatArray, ridge: FloatArray) -> FloatArray:
    r"""Minimise :math:`|y - U w|^2 + \sum_j \rho_j w_j^2`.

    Parameters
    ----------
    U : ndarray, shape (n_row, n_column)
        Regressors, such as [1, Z].
    y : ndarray, shape (n_row,)
        Target, any unit.
    ridge : ndarray, shape (n_column,)
        rho, at least zero.

    Returns
    -------
    ndarray, shape (n_column,)
        w, of least norm where it is not determined.
    """
    stacked = np.concatenate([U, np.diag(np.sqrt(ridge))])
    weights: FloatArray = np.linalg.lstsq(stacked, np.concatenate([y, np.zeros(ridge.size)]), rcond=None)[0]
    return weights


def ridge_residuals(U: FloatArray, y: FloatArray, ridge: FloatArray, blocks: Sequence[slice]) -> FloatArray:
    r"""Return each row's error under the `penalised` fit without the block that holds it.

    .. math:: r_B = (I - H_{BB})^{-1} (y - H y)_B, \quad H = U (U'U + \mathrm{diag}\,\rho)^{-1} U'

    Parameters
    ----------
    U : ndarray, shape (n_row, n_column)
        Regressors.
    y : ndarray, shape (n_row,)
        Target, any unit.
    ridge : ndarray, shape (n_column,)
        rho, large enough that U'U + diag rho is not singular.
    blocks : sequence of slice
        Contiguous rows, which together cover all.

    Returns
    -------
    ndarray, shape (n_row,)
        Errors, unit of `y`.
    """
    half = np.linalg.solve(np.linalg.cholesky(U.T @ U + np.diag(ridge)), U.T)
    residuals = y - half.T @ (half @ y)
    left_out = np.empty(y.size)
    for rows in blocks:
        H = half[:, rows].T @ half[:, rows]
        left_out[rows] = np.linalg.solve(np.eye(len(H)) - H, residuals[rows])
    return left_out


def likeliest_ridge(U: FloatArray, y: FloatArray, group: NDArray[np.intp]) -> FloatArray:
    r"""Return the penalties under which the target is most likely: a Gaussian process, linear in its features.

    Weights of group g have the prior N(0, p_g s^2), those of group -1 a flat one; the noise is white with variance s^2.
    With the flat columns projected out of U and y, m rows left and both s^2 and the weights integrated or maximised
    out,

    .. math:: -2 \ln L = m \ln(y'y - b' M^{-1} b) + \ln |P M|, \quad M = U'U + P^{-1},\; b = U'y

    is least; the penalties are 1 / p_g, and 0 for the flat ones.

    Parameters
    ----------
    U : ndarray, shape (n_row, n_column)
        Regressors [-].
    y : ndarray, shape (n_row,)
        Target, any unit.
    group : ndarray of int, shape (n_column,)
        Group of each column; -1 is flat.

    Returns
    -------
    ndarray, shape (n_column,)
        rho of `penalised`.

    References
    ----------
    Rasmussen and Williams, "Gaussian Processes for Machine Learning" (2006), equation (2.43).
    """
    flat = group < 0
    Q = np.linalg.qr(U[:, flat])[0]
    free, target = U[:, ~flat] - Q @ (Q.T @ U[:, ~flat]), y - Q @ (Q.T @ y)
    A, b, total = free.T @ free, free.T @ target, target @ target
    dof = y.size - int(flat.sum())

    def unlikelihood(log_variance: FloatArray) -> float:
        root = np.exp(0.5 * log_variance)[group[~flat]]
        L = np.linalg.cholesky(np.outer(root, root) * A + np.eye(root.size))
        half = np.linalg.solve(L, root * b)
        # A target that is zero throughout is likely under any variance.
        left = max(total - half @ half, np.finfo(float).tiny)
        return float(0.5 * dof * np.log(left) + np.log(np.diag(L)).sum())

    n_group = int(group.max()) + 1
    found = minimize(unlikelihood, np.zeros(n_group), method="L-BFGS-B", bounds=[(-_SPAN, _SPAN)] * n_group)
    ridge = np.zeros(group.size)
    ridge[~flat] = np.exp(-found.x)[group[~flat]]
    return ridge
