"""Least squares in the temperature features: with powers of T, dT/dt and T dT/dt the polynomial baseline, with gradients more."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from testbed.signals import FloatArray


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


def block_residuals(U: FloatArray, y: FloatArray, ridge: FloatArray, blocks: Sequence[slice]) -> FloatArray:
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
