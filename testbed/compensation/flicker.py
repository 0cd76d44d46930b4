"""Rows of a gyro's record are no independent samples: their noise is 1/f. Whitening makes least squares efficient under
it.
"""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import cholesky, solve_triangular, toeplitz

if TYPE_CHECKING:
    from collections.abc import Sequence

    from testbed.signals import FloatArray

# The flicker is flat below one cycle in this many records; a constant per cycle takes what is slower.
_RECORDS = 64


@functools.lru_cache(maxsize=8)
def noise_root(n_row: int, corner: float) -> FloatArray:
    r"""Return L, the root of the covariance C = L L' of row means under 1/f and white noise, unit variance.

    .. math:: S(f) \propto \frac{\mathrm{sinc}^2 f}{f} + \frac{1}{f_c}

    Parameters
    ----------
    n_row : int
        Number of rows.
    corner : float
        f_c, where both parts are equal, in cycles per row [-].

    Returns
    -------
    ndarray, shape (n_row, n_row)
        Lower triangle.
    """
    freq = np.fft.rfftfreq(_RECORDS * n_row)
    freq[0] = freq[1]
    covariance = np.fft.irfft(np.sinc(freq) ** 2 / freq + 1.0 / corner)[:n_row]
    root: FloatArray = cholesky(toeplitz(covariance / covariance[0]), lower=True)
    return root


def whiten(Z: FloatArray, y: FloatArray, cycles: Sequence[slice], corner: float) -> tuple[FloatArray, FloatArray]:
    r"""Return regressors and target whose noise is white: :math:`L^{-1} [1_c, Z]` and :math:`L^{-1} y`, cycle by cycle.

    Row k of a cycle is what is new in it beyond the rows before.

    Parameters
    ----------
    Z : ndarray, shape (n_row, n_feature)
        Standardised features [-].
    y : ndarray, shape (n_row,)
        Target, any unit.
    cycles : sequence of slice
        Rows of each cycle.
    corner : float
        As for `noise_root` [-].

    Returns
    -------
    U : ndarray, shape (n_row, n_cycle + n_feature)
        A constant for each cycle, then the features.
    v : ndarray, shape (n_row,)
        Target, unit of `y`.
    """
    U, v = np.empty((y.size, len(cycles) + Z.shape[1])), np.empty(y.size)
    for k, rows in enumerate(cycles):
        n_row = rows.stop - rows.start
        own = np.zeros((n_row, len(cycles)))
        own[:, k] = 1.0
        joint = np.column_stack([own, Z[rows], y[rows]])
        white = solve_triangular(noise_root(n_row, corner), joint, lower=True)
        U[rows], v[rows] = white[:, :-1], white[:, -1]
    return U, v
