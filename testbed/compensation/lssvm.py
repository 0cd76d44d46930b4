"""Least-squares support vector machine for regression with a Gaussian kernel: paper 3, equations (11)-(21).

It is kernel ridge regression plus a bias that is not penalised. Cost n^3 / 3 for n rows: train it on block means.
"""

# mypy: disable-error-code="no-untyped-def, misc"

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numba import njit
from scipy.linalg import cho_solve, cholesky
from scipy.linalg.lapack import dtrtri
from scipy.spatial.distance import cdist

if TYPE_CHECKING:
    from collections.abc import Sequence

    from testbed.signals import FloatArray


@njit(cache=True)
def _expand(X, support, weights, bias, width2):  # pragma: no cover
    """Return sum_i a_i exp(-|x - x_i|^2 / 2 s^2) + b of each row, in an order independent of the other rows."""
    n_row, n_feature = X.shape
    y = np.empty(n_row)
    for k in range(n_row):
        total = bias
        for i in range(support.shape[0]):
            square = 0.0
            for j in range(n_feature):
                square += (X[k, j] - support[i, j]) ** 2
            total += weights[i] * math.exp(-square / (2.0 * width2))
        y[k] = total
    return y


class _System:
    """The bordered system [[0, 1'], [1, A]] [b; a] = [0; y], A = Omega + I / gamma, by Cholesky and Schur complement.

    With A eta = 1 and A nu = y the bias is b = 1'nu / 1'eta and a = nu - b eta.
    """

    def __init__(self, X: FloatArray, y: FloatArray, gamma: float, width2: float) -> None:
        if X.ndim != 2 or y.shape != X.shape[:1] or not y.size:
            msg = f"X, y: expected shapes (n_row, n_feature) and (n_row,), got {X.shape} and {y.shape}"
            raise ValueError(msg)
        if not (0.0 < gamma < math.inf and 0.0 < width2 < math.inf):
            msg = f"gamma, width2: expected positive numbers, got {gamma} and {width2}"
            raise ValueError(msg)
        if not (np.isfinite(X).all() and np.isfinite(y).all()):
            msg = "X, y: expected finite values, got NaN or infinity"
            raise ValueError(msg)
        A = np.exp(cdist(X, X, "sqeuclidean") / (-2.0 * width2))
        A.flat[:: y.size + 1] += 1.0 / gamma
        self.L = cholesky(A, lower=True, overwrite_a=True, check_finite=False)
        both = cho_solve((self.L, True), np.stack([np.ones(y.size), y], axis=1), check_finite=False)
        self.eta = both[:, 0]
        self.bias = float(both[:, 1].sum() / self.eta.sum())
        self.weights: FloatArray = both[:, 1] - self.bias * self.eta


@dataclass(frozen=True)
class Lssvm:
    r"""A fitted machine.

    .. math:: f(x) = \sum_i a_i e^{-|x - x_i|^2 / (2 \sigma^2)} + b

    Parameters
    ----------
    support : ndarray, shape (n_row, n_feature)
        Training rows x_i [-].
    weights : ndarray, shape (n_row,)
        a_i, whose sum is zero [unit of y].
    bias : float
        b [unit of y].
    width2 : float
        sigma^2 [-].
    """

    support: FloatArray
    weights: FloatArray
    bias: float
    width2: float

    @classmethod
    def fit(cls, X: FloatArray, y: FloatArray, gamma: float, width2: float) -> Lssvm:
        r"""Solve :math:`\min |w|^2/2 + (\gamma/2) \sum e_i^2`, equation (20).

        .. math:: \begin{bmatrix} 0 & 1' \\ 1 & \Omega + I/\gamma \end{bmatrix}
            \begin{bmatrix} b \\ a \end{bmatrix} = \begin{bmatrix} 0 \\ y \end{bmatrix}

        Parameters
        ----------
        X : ndarray, shape (n_row, n_feature)
            Standardised features [-].
        y : ndarray, shape (n_row,)
            Target, any unit.
        gamma : float
            Weight of the errors, above zero [-].
        width2 : float
            sigma^2 of the kernel, above zero [-].

        Returns
        -------
        Lssvm
            Frozen machine.

        Raises
        ------
        ValueError
            If shapes do not match, a value is not finite or a parameter not positive.

        References
        ----------
        Suykens and Vandewalle, "Least squares support vector machine classifiers", Neural Process. Lett. 9 (1999);
        Wang, Cui, Cao, Micromachines 14 (2023) 1712, equations (11)-(21).
        """
        system = _System(X, y, gamma, width2)
        return cls(np.ascontiguousarray(X, dtype=np.float64), system.weights, system.bias, float(width2))

    def predict(self, X: FloatArray) -> FloatArray:
        """Return f at each row.

        Parameters
        ----------
        X : ndarray, shape (n_time, n_feature)
            Standardised features [-].

        Returns
        -------
        ndarray, shape (n_time,)
            Prediction, unit of the target.
        """
        rows = np.ascontiguousarray(X, dtype=np.float64)
        values: FloatArray = _expand(rows, self.support, self.weights, self.bias, self.width2)
        return values


def kernel_residuals(X: FloatArray, y: FloatArray, gamma: float, width2: float, blocks: Sequence[slice]) -> FloatArray:
    r"""Return each row's error under the machine trained without the block that holds it.

    .. math:: r_B = M_{BB}^{-1} a_B, \quad M = A^{-1} - \eta \eta' / 1'\eta

    Parameters
    ----------
    X, y, gamma, width2 : ndarray, shape (n_row, n_feature); ndarray, shape (n_row,); float
        As for `Lssvm.fit`.
    blocks : sequence of slice
        Contiguous rows, which together cover all.

    Returns
    -------
    ndarray, shape (n_row,)
        Errors, unit of `y`.

    References
    ----------
    An, Liu, Venkatesh, "Fast cross-validation algorithms for least squares support vector machine and kernel ridge
    regression", Pattern Recognition 40 (2007).
    """
    system = _System(X, y, gamma, width2)
    inverse, total = _root_inverse(system), system.eta.sum()
    residuals = np.full(y.size, np.nan)
    for rows in blocks:
        eta = system.eta[rows]
        # Columns of a lower triangle: zero above the block's first row.
        part = inverse[rows.start :, rows]
        residuals[rows] = np.linalg.solve(part.T @ part - np.outer(eta, eta) / total, system.weights[rows])
    return residuals


def _root_inverse(system: _System) -> FloatArray:
    """Return L^-1, lower; (L^-1)' L^-1 = A^-1."""
    inverse, _ = dtrtri(system.L, lower=1)
    lower: FloatArray = np.tril(inverse)
    return lower
