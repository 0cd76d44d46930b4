"""Empirical mode decomposition by a fixed number of sifts, in time proportional to the record.

One sift takes the mean of two envelopes away, cubic splines through the maxima and through the minima. Conventions are
those of EMD-signal with `FIXE` (extrema at samples, two mirrored extrema per side, not-a-knot ends), so that its modes
are ours to rounding; on a flat top the extremum is the middle sample, rounded down.

The kernels live in one file because numba's disk cache watches no other file than the kernel's own. They release the
interpreter lock.
"""

# mypy: disable-error-code="no-untyped-def, misc"

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numba import njit

if TYPE_CHECKING:
    from collections.abc import Iterator

    from testbed.signals import FloatArray

# Extrema mirrored beyond each end.
MIRRORED = 2
# A residual whose range is this part of the signal's is rounding, not signal.
ROUNDING = 1e-12


@njit(cache=True, nogil=True, error_model="numpy")
def find_extrema(x, maxima, minima):  # pragma: no cover
    """Fill in the indices of the inner extrema and return how many there are; free of branches that noise would
    mispredict.
    """
    n_max, n_min = 0, 0
    before, since = 0.0, 0
    for i in range(x.size - 1):
        step = x[i + 1] - x[i]
        if step != 0.0:
            maxima[n_max] = minima[n_min] = (since + i) // 2
            n_max += (before > 0.0) & (step < 0.0)
            n_min += (before < 0.0) & (step > 0.0)
            before, since = step, i + 1
    return n_max, n_min


@njit(cache=True, nogil=True, error_model="numpy")
def reflect(x, edge, maxima, minima):  # pragma: no cover
    """Return (centre, maxima skipped, minima skipped, edge is a maximum, edge is a minimum) of the mirror at one end.

    Extrema come nearest the edge first. The mirror stands on the first extremum if the signal comes back beyond the
    second before the edge and the images reach the edge; otherwise on the edge, which counts as an extremum if it lies
    beyond the second one.
    """
    top_first = abs(maxima[0] - edge) < abs(minima[0] - edge)
    first, second = (maxima, minima) if top_first else (minima, maxima)
    if (x[edge] <= x[second[0]]) if top_first else (x[edge] >= x[second[0]]):
        return edge, 0, 0, int(not top_first), int(top_first)
    nearest, far = first[0], min(MIRRORED, first.size - 1)
    reach = min(abs(first[far] - nearest), abs(second[min(MIRRORED, second.size) - 1] - nearest))
    if reach >= abs(nearest - edge):
        return nearest, int(top_first), int(not top_first), 0, 0
    return edge, 0, 0, 0, 0


@njit(cache=True, nogil=True, error_model="numpy")
def place_knots(x, extrema, left, right, knots, values):  # pragma: no cover
    """Fill in the extrema of one kind with their images at both ends (centre, skipped, edge counts) and return how
    many.
    """
    n, last, k = extrema.size, x.size - 1, 0
    centre, skipped, edge = left
    for j in range(min(n, skipped + MIRRORED - edge) - 1, skipped - 1, -1):
        knots[k], values[k] = 2 * centre - extrema[j], x[extrema[j]]
        k += 1
    if edge:
        knots[k], values[k] = 0, x[0]
        k += 1
    for j in range(n):
        knots[k], values[k] = extrema[j], x[extrema[j]]
        k += 1
    centre, skipped, edge = right
    if edge:
        knots[k], values[k] = last, x[last]
        k += 1
    for j in range(n - 1 - skipped, max(-1, n - 1 - skipped - MIRRORED + edge), -1):
        knots[k], values[k] = 2 * centre - extrema[j], x[extrema[j]]
        k += 1
    return k


@njit(cache=True, nogil=True, error_model="numpy")
def spline_slopes(knots, values, slopes, upper):  # pragma: no cover
    """Solve the tridiagonal system of a cubic spline for its slopes at the knots: not-a-knot ends, natural ones for
    three knots.
    """
    n = knots.size
    h, after = float(knots[1] - knots[0]), float(knots[2] - knots[1])
    d, d_after = (values[1] - values[0]) / h, (values[2] - values[1]) / after
    if n == 3:
        upper[0], slopes[0] = 0.5, 1.5 * d
    else:
        both = h + after
        upper[0] = both / after
        slopes[0] = ((h + 2.0 * both) * d + h * h * d_after / after) / both
    for j in range(1, n - 1):
        after = float(knots[j + 1] - knots[j])
        d_after = (values[j + 1] - values[j]) / after
        pivot = 1.0 / (2.0 * (h + after) - after * upper[j - 1])
        upper[j] = h * pivot
        slopes[j] = (3.0 * (after * d + h * d_after) - after * slopes[j - 1]) * pivot
        # Before the last row, h and d keep the interval before the last one.
        if j < n - 2:
            h, d = after, d_after
    if n == 3:
        slopes[2] = (3.0 * d_after - slopes[1]) / (2.0 - upper[1])
    else:
        both = h + after
        right = (after * after * d + (2.0 * both + after) * h * d_after) / both
        slopes[n - 1] = (right - both * slopes[n - 2]) / (h - both * upper[n - 2])
    for j in range(n - 2, -1, -1):
        slopes[j] -= upper[j] * slopes[j + 1]


@njit(cache=True, nogil=True, error_model="numpy")
def envelope(knots, values, slopes, upper, out):  # pragma: no cover
    """Evaluate the spline through the knots at every sample."""
    spline_slopes(knots, values, slopes, upper)
    last = out.size - 1
    for j in range(knots.size - 1):
        start, begin, end = knots[j], max(knots[j], 0), min(knots[j + 1], last)
        h = 1.0 / (knots[j + 1] - start)
        y, s = values[j], slopes[j]
        d = (values[j + 1] - y) * h
        c = (3.0 * d - 2.0 * s - slopes[j + 1]) * h
        e = (s + slopes[j + 1] - 2.0 * d) * h * h
        for i in range(begin, end + 1):
            t = float(i - start)
            out[i] = y + t * (s + t * (c + t * e))


@njit(cache=True, nogil=True, error_model="numpy")
def first_mode(x, sifts):  # pragma: no cover
    """Return the fastest mode of x after `sifts` sifts; zeros if there are, or come to be, fewer than three extrema."""
    n = x.size
    mode = x.copy()
    maxima, minima, knots = np.empty(n, np.int64), np.empty(n, np.int64), np.empty(n + 4, np.int64)
    values, slopes, work = np.empty(n + 4), np.empty(n + 4), np.empty(n + 4)
    top, bottom = np.empty(n), np.empty(n)
    for _ in range(sifts):
        n_max, n_min = find_extrema(mode, maxima, minima)
        if n_max + n_min < 3:
            mode[:] = 0.0
            break
        peaks, dips = maxima[:n_max], minima[:n_min]
        left, left_max, left_min, left_top, left_bottom = reflect(mode, 0, peaks, dips)
        right, right_max, right_min, right_top, right_bottom = reflect(mode, n - 1, peaks[::-1], dips[::-1])
        k = place_knots(mode, peaks, (left, left_max, left_top), (right, right_max, right_top), knots, values)
        envelope(knots[:k], values, slopes, work, top)
        k = place_knots(mode, dips, (left, left_min, left_bottom), (right, right_min, right_bottom), knots, values)
        envelope(knots[:k], values, slopes, work, bottom)
        for i in range(n):
            mode[i] -= 0.5 * (top[i] + bottom[i])
    return mode


def emd(signal: FloatArray, *, sifts: int = 10) -> FloatArray:
    r"""Decompose a record into modes, fastest first: :math:`x = \sum_k m_k + r`.

    Each mode is what `sifts` sifts leave of the residual before it. It ends when the residual has fewer than three
    extrema (or loses them while it is sifted), when its range is 1e-12 of the signal's, or after 2 log2(n_time) modes.

    Parameters
    ----------
    signal : ndarray, shape (n_time,)
        Equally spaced samples, any unit.
    sifts : int
        Sifts per mode [-].

    Returns
    -------
    ndarray, shape (n_mode + 1, n_time)
        Modes, then the residual; the unit of `signal`. A constant, monotone or very short record is all residual.

    Raises
    ------
    ValueError
        If the signal is empty, not one-dimensional or not finite, or `sifts` is below one.

    References
    ----------
    .. [1] Huang et al., "The empirical mode decomposition and the Hilbert spectrum", Proc. R. Soc. A 454, 1998,
       903-995.
    .. [2] Wang, Cui, Cao, Micromachines 14, 2023, 1712.
    """
    residual = checked_signal(signal)
    check_count("sifts", sifts)
    modes = []
    for mode in while_modes_are_left(residual, sifts):
        modes.append(mode)
        residual -= mode
    return np.stack([*modes, residual])


def while_modes_are_left(residual: FloatArray, sifts: int) -> Iterator[FloatArray]:
    """Yield the fastest mode of the residual, which the caller makes smaller in place, until there is none.

    Parameters
    ----------
    residual : ndarray, shape (n_time,)
        What is left of the signal, any unit.
    sifts : int
        Sifts per mode [-].

    Yields
    ------
    ndarray, shape (n_time,)
        The fastest mode, unit of `residual`.
    """
    smallest = ROUNDING * np.ptp(residual)
    # Dyadic at best; noise left over in a slow residual may take more, but not for ever.
    for _ in range(2 * residual.size.bit_length()):
        mode = first_mode(residual, sifts)
        if np.ptp(residual) <= smallest or not mode.any():
            return
        yield mode


def checked_signal(signal: FloatArray) -> FloatArray:
    """Return a copy of a finite, non-empty record.

    Parameters
    ----------
    signal : ndarray, shape (n_time,)
        Samples, any unit.

    Returns
    -------
    ndarray, shape (n_time,)
        The same in double precision.

    Raises
    ------
    ValueError
        If it is empty, not one-dimensional or not finite.
    """
    x = np.array(signal, dtype=np.float64)
    if x.ndim != 1 or x.size == 0:
        msg = f"signal: expected one axis with at least one sample, got shape {x.shape}"
        raise ValueError(msg)
    if not np.all(np.isfinite(x)):
        msg = f"signal: expected finite samples (fill gaps first), got {np.count_nonzero(~np.isfinite(x))} that are not"
        raise ValueError(msg)
    return x


def check_count(name: str, value: int) -> None:
    """Refuse a count below one, by name.

    Parameters
    ----------
    name : str
        Name of the argument.
    value : int
        The count [-].

    Raises
    ------
    ValueError
        If it is below one.
    """
    if value < 1:
        msg = f"{name}: expected at least 1, got {value}"
        raise ValueError(msg)
