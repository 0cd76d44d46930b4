"""Moving readings and estimates of lanes: what the generated sources call, compiled once for all of them.

Places are unsigned: a signed one would be looked at, whether it counts from the end.
"""

# mypy: disable-error-code="no-untyped-def, misc"

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, forceinline=True, error_model="numpy")
def first_of(due):  # pragma: no cover
    """Return the first step with a reading, or how many steps there are if there is none."""
    for k in range(due.size):
        if due[k]:
            return k
    return due.size


@njit(cache=True, forceinline=True, error_model="numpy")
def spread(Z, i, begin, n, first, stride, z):  # pragma: no cover
    """Set z (n_step, n_lane) to the readings of sensor i in n steps from `begin` on: from step `first` on, every
    `stride` steps.
    """
    for s in range(z.shape[1]):
        own = Z[s]
        for m in range((n - first + stride - 1) // stride):
            k = np.uint64(first + m * stride)
            z[k, s] = own[i, np.uint64(begin) + k]


@njit(cache=True, forceinline=True, error_model="numpy")
def collect(part, first, stride, found):  # pragma: no cover
    """Set found (n_lane, n_step) to what `part` (n_step, n_lane) has at those steps."""
    for s in range(found.shape[0]):
        for m in range((found.shape[1] - first + stride - 1) // stride):
            k = np.uint64(first + m * stride)
            found[s, k] = part[k, s]
