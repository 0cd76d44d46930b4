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
    """A fitted weighted sum of standardised features; a polynomial in the temperature through its features.

    Parameters
    ----------
    weights : ndarray, shape (n_feature,)
        One per feature [unit of y].
    bias : float
        Value where all features are at their mean [unit of y].
    """

    weights: FloatArray
    bias: float

    @classmethod
    def fit(cls, Z: FloatArray, y: FloatArray, penalty: float = 0.0) -> Polynomial:
        r"""Minimise :math:`|y - Z w - b|^2 + n \lambda |w|^2`.

        Parameters
        ----------
        Z : ndarray, shape (n_row, n_feature)
            Standardised features [-].
        y : ndarray, shape (n_row,)
            Target, any unit.
        penalty : float
            lambda, at least zero [-].

        Returns
        -------
        Polynomial
            Frozen; of least norm where features do not determine it.
        """
        mean = Z.mean(axis=0)
        root = np.sqrt(y.size * penalty) * np.eye(Z.shape[1])
        stacked, target = np.concatenate([Z - mean, root]), np.concatenate([y - y.mean(), np.zeros(len(root))])
        weights = np.linalg.lstsq(stacked, target, rcond=None)[0]
        return cls(weights, float(y.mean() - mean @ weights))

    def predict(self, Z: FloatArray) -> FloatArray:
        """Return the prediction at each row, shape (n_time,), of standardised features, shape (n_time, n_feature)."""
        # Column by column: the sum of a row does not depend on the number of rows, as that of a matrix product may.
        total = np.full(len(Z), self.bias)
        for column, weight in zip(Z.T, self.weights, strict=True):
            total += weight * column
        return total


def block_residuals(Z: FloatArray, y: FloatArray, penalty: float, blocks: Sequence[slice]) -> FloatArray:
    r"""Return each row's error under the polynomial fitted without the block that holds it.

    .. math:: r_B = (I - H_{BB})^{-1} (y - H y)_B, \quad H = U (U'U + \Lambda)^{-1} U', \quad U = [1, Z]

    Parameters
    ----------
    Z : ndarray, shape (n_row, n_feature)
        Standardised features [-].
    y : ndarray, shape (n_row,)
        Target, any unit.
    penalty : float
        lambda of `Polynomial.fit`, whose n lambda stays that of all rows; above zero [-].
    blocks : sequence of slice
        Contiguous rows, which together cover all.

    Returns
    -------
    ndarray, shape (n_row,)
        Errors, unit of `y`.
    """
    U = np.column_stack([np.ones(y.size), Z])
    normal = U.T @ U
    normal[1:, 1:] += y.size * penalty * np.eye(Z.shape[1])
    half = np.linalg.solve(np.linalg.cholesky(normal), U.T)
    residuals = y - half.T @ (half @ y)
    left_out = np.empty(y.size)
    for rows in blocks:
        H = half[:, rows].T @ half[:, rows]
        left_out[rows] = np.linalg.solve(np.eye(len(H)) - H, residuals[rows])
    return left_out
