"""Errors that many measurements have in common, such as those of a clock, made independent."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from testbed.signals import FloatArray


def whitened(rows: FloatArray, shared: FloatArray) -> FloatArray:
    r"""Return rows whose errors have the covariance I + u u' as rows whose errors have the covariance I.

    .. math:: (I + u u')^{-1/2} = I - \frac{1 - (1 + u'u)^{-1/2}}{u'u} u u'

    Parameters
    ----------
    rows : ndarray, shape (n_row,) or (n_row, n_column)
        Each over the standard deviation of its own error [-].
    shared : ndarray, shape (n_row,)
        u: what one standard deviation of the common error adds to each [-].
    """
    size = float(shared @ shared)
    if size == 0.0:
        return rows
    factor = (1.0 - 1.0 / np.sqrt(1.0 + size)) / size
    found: FloatArray = rows - factor * np.multiply.outer(shared, shared @ rows)
    return found


def parts(values: np.ndarray) -> FloatArray:
    """Return complex rows as real ones, the real parts before the imaginary ones.

    Parameters
    ----------
    values : ndarray of complex, shape (n_row,) or (n_row, n_column)
        The rows.
    """
    return np.concatenate([values.real, values.imag])
