"""Entropy of a record by scale: of the order of neighbouring samples (permutation) and of their repetition (sample
entropy).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numba import njit

if TYPE_CHECKING:
    from collections.abc import Sequence

    from testbed.signals import FloatArray


def coarse_grain(signal: FloatArray, scale: int) -> FloatArray:
    r"""Average blocks of `scale` samples: :math:`y_j = \frac1s \sum_{i=(j-1)s+1}^{js} x_i` (equation 7 of [1]_).

    Parameters
    ----------
    signal : ndarray, shape (n_time,)
        Samples, any unit.
    scale : int
        Samples per block s [-]; an incomplete last block is left out.

    Returns
    -------
    ndarray, shape (n_time // scale,)
        Means, unit of `signal`.

    Raises
    ------
    ValueError
        If there is not one whole block or `scale` is below one.

    References
    ----------
    .. [1] Wang, Cui, Cao, Micromachines 14, 2023, 1712.
    """
    if not 1 <= scale <= signal.size:
        msg = f"scale: expected 1 to {signal.size} samples, got {scale}"
        raise ValueError(msg)
    n_block = signal.size // scale
    means: FloatArray = signal[: n_block * scale].reshape(n_block, scale).mean(axis=1)
    return means


def permutation_entropy(signal: FloatArray, *, order: int = 4, delay: int = 1) -> float:
    r"""Return the entropy of ordinal patterns over its largest value: :math:`-\sum_\pi p_\pi \ln p_\pi / \ln m!`
    (equations 8-10 of [1]_).

    Of equal samples the earlier one counts as smaller.

    Parameters
    ----------
    signal : ndarray, shape (n_time,)
        Samples, any unit.
    order : int
        Samples per pattern m [-].
    delay : int
        Samples from one to the next within a pattern [-].

    Returns
    -------
    float
        0 for a monotone record, ln 2 / ln m! at the least for one of long ups and downs of equal length, 1 for white
        noise [-].

    Raises
    ------
    ValueError
        If `order` is below two, `delay` below one, the record shorter than a pattern or not finite.

    References
    ----------
    .. [1] Wang, Cui, Cao, Micromachines 14, 2023, 1712; after Bandt and Pompe, Phys. Rev. Lett. 88, 2002, 174102.
    """
    _check_pattern(signal, order, delay)
    n_pattern = signal.size - (order - 1) * delay
    columns = [signal[i * delay : i * delay + n_pattern] for i in range(order)]
    # Number of the permutation in the factorial base: how many later samples are smaller than each one.
    code = np.zeros(n_pattern, dtype=np.int64)
    for i, column in enumerate(columns):
        smaller = sum((later < column for later in columns[i + 1 :]), np.zeros(n_pattern, dtype=np.int64))
        code += smaller * math.factorial(order - 1 - i)
    share = np.unique(code, return_counts=True)[1] / n_pattern
    return float(-(share @ np.log(share)) / math.log(math.factorial(order))) + 0.0


def multiscale_permutation_entropy(
    signal: FloatArray, scales: Sequence[int], *, order: int = 4, delay: int = 1
) -> FloatArray:
    """Return the permutation entropy of the coarse-grained record at each scale (equations 7-10 of [1]_).

    Parameters
    ----------
    signal : ndarray, shape (n_time,)
        Samples, any unit.
    scales : sequence of int
        Samples per block, n_scale of them [-].
    order : int
        Samples per pattern [-].
    delay : int
        Blocks from one to the next within a pattern [-].

    Returns
    -------
    ndarray, shape (n_scale,)
        Entropies between 0 and 1 [-].

    References
    ----------
    .. [1] Wang, Cui, Cao, Micromachines 14, 2023, 1712.
    """
    return np.array([permutation_entropy(coarse_grain(signal, s), order=order, delay=delay) for s in scales])


@njit(cache=True, nogil=True)
def _count_repeats(x, by_size, order, tolerance):  # type: ignore[no-untyped-def] # pragma: no cover
    """Count pairs of patterns that agree for `order` samples, and for one more; `by_size` sorts the patterns by first
    sample.
    """
    alike, still_alike = 0, 0
    for a in range(by_size.size):
        i = by_size[a]
        for b in range(a + 1, by_size.size):
            j = by_size[b]
            # Sorted: nobody further on can agree in the first sample.
            if x[j] - x[i] >= tolerance:
                break
            k = 1
            while k <= order and abs(x[j + k] - x[i + k]) < tolerance:
                k += 1
            alike += k >= order
            still_alike += k > order
    return alike, still_alike


def sample_entropy(signal: FloatArray, tolerance: float, *, order: int = 2) -> float:
    r"""Return :math:`-\ln(A/B)`: B pairs of patterns agree for m samples, A of them for one more (Richman and Moorman
    2000).

    Two patterns agree if no pair of samples differs by `tolerance` or more. Patterns start at the first n_time - m
    samples in both counts; none is compared with itself.

    Parameters
    ----------
    signal : ndarray, shape (n_time,)
        Samples, any unit.
    tolerance : float
        Difference below which two samples agree, unit of `signal`.
    order : int
        Samples per pattern m [-].

    Returns
    -------
    float
        Entropy [-]: 0 if whatever agrees goes on agreeing, infinite if nothing does, NaN if nothing agrees to begin
        with.

    Raises
    ------
    ValueError
        If `order` is below one, `tolerance` is not positive, the record has fewer than order + 2 samples or is not
        finite.
    """
    if not tolerance > 0.0:
        msg = f"tolerance: expected a difference above 0, got {tolerance}"
        raise ValueError(msg)
    _check_pattern(signal, order + 1, 1, least_order=2)
    x = np.ascontiguousarray(signal, dtype=np.float64)
    alike, still_alike = _count_repeats(x, np.argsort(x[: x.size - order], kind="stable"), order, tolerance)
    if alike == 0:
        return math.nan
    return math.log(alike / still_alike) if still_alike else math.inf


def multiscale_sample_entropy(
    signal: FloatArray, scales: Sequence[int], *, order: int = 2, tolerance: float = 0.2
) -> FloatArray:
    """Return the sample entropy of the coarse-grained record at each scale, the tolerance fixed by the record itself.

    What averages out within a block then falls below the tolerance and counts as regular (Costa, Goldberger, Peng
    2002).

    Parameters
    ----------
    signal : ndarray, shape (n_time,)
        Samples, any unit.
    scales : sequence of int
        Samples per block, n_scale of them [-].
    order : int
        Samples per pattern [-].
    tolerance : float
        Tolerance over the standard deviation of `signal` before coarse graining [-].

    Returns
    -------
    ndarray, shape (n_scale,)
        Entropies [-].

    Raises
    ------
    ValueError
        As `coarse_grain` and `sample_entropy`; a constant record has no tolerance.
    """
    absolute = tolerance * float(np.std(signal))
    return np.array([sample_entropy(coarse_grain(signal, scale), absolute, order=order) for scale in scales])


def _check_pattern(signal: FloatArray, order: int, delay: int, least_order: int = 2) -> None:
    """Refuse patterns that have no order or do not fit into the record twice, and records with gaps."""
    if order < least_order or delay < 1:
        msg = f"order, delay: expected at least {least_order} and 1, got {order} and {delay}"
        raise ValueError(msg)
    if signal.ndim != 1 or signal.size <= (order - 1) * delay:
        msg = f"signal: expected more than {(order - 1) * delay} samples in one axis, got shape {signal.shape}"
        raise ValueError(msg)
    if not np.all(np.isfinite(signal)):
        msg = "signal: expected finite samples (fill gaps first), got some that are not"
        raise ValueError(msg)
