"""Covariances that filters of a bank share under LANES seeds side by side, and go on with when they start again from a
better one: what the kernels of `testbed.fusion.lanes.bank_source` call.

A covariance stands once for all filters that have it. `C` (n_pack, n_row * LANES) are the covariances: first what an
heir takes over, then its own noise. `of` (M, LANES) tells which one a filter has under each seed, `users`
(n_pack * LANES,) how many filters have it, `live` (n_pack,) how many of a pack are had, `child` (n_pack * LANES, M, 2)
the last one born from it for each filter, and when; `counted` = [step, lowest that may be free].
"""

# mypy: disable-error-code="no-untyped-def, misc"

from __future__ import annotations

import numpy as np
from numba import njit

from testbed.fusion.lanes.source import LANES


@njit(cache=True, error_model="numpy")
def born(C, kept, noise, parent, m, child, users, live, counted):  # pragma: no cover
    """Return a new covariance for filter m: the first `kept` rows of its parent, and `noise[m]`."""
    c = counted[1]
    while users[c] > 0:
        c += 1
    counted[1] = c + 1
    live[c // LANES] += 1
    old, new = C[parent // LANES, parent % LANES :: LANES], C[c // LANES, c % LANES :: LANES]
    for row in range(kept):
        new[row] = old[row]
    for row in range(noise.shape[1]):
        new[kept + row] = noise[m, row]
    child[parent, m, 0], child[parent, m, 1] = c, counted[0]
    return c


@njit(cache=True, error_model="numpy")
def release(c, n, users, live, counted):  # pragma: no cover
    """Note that `n` filters have a covariance no longer."""
    users[c] -= n
    if users[c] == 0:
        live[c // LANES] -= 1
        counted[1] = min(counted[1], c)


@njit(cache=True, error_model="numpy")
def change(slower, best, m, of, C, kept, noise, child, users, live, counted):  # pragma: no cover
    """Give filter m the covariance that is `born` from that of the best one where it is slower, the same one for all
    that start again now from there; return whether it has the same one in all lanes then.
    """
    own = of[m]
    parent, before, c, n = -1, own[0], 0, 0
    for s in range(LANES):
        if slower[s] > 0.0:
            if of[best[s], s] != parent:
                parent = of[best[s], s]
                known = child[parent, m, 1] == counted[0]
                c = child[parent, m, 0] if known else born(C, kept, noise, parent, m, child, users, live, counted)
            # Most lanes come from one covariance, so that it is let go at once.
            if own[s] != before:
                release(before, n, users, live, counted)
                before, n = own[s], 0
            own[s] = c
            users[c] += 1
            n += 1
    release(before, n, users, live, counted)
    alike = 0
    for s in range(LANES):
        alike += 1 if own[s] == own[0] else 0
    return alike == LANES


@njit(cache=True, error_model="numpy")
def close_ranks(C, n_row, of, users, live, counted):  # pragma: no cover
    """Move covariances from the last packs into free places of the first ones, so that no pack is there for a few."""
    moved = np.zeros(users.size, np.int64)
    moved[:] = -1
    free, last = 0, users.size - 1
    while True:
        while free < last and users[free] > 0:
            free += 1
        while free < last and users[last] == 0:
            last -= 1
        if free >= last:
            break
        old, new = C[last // LANES, last % LANES :: LANES], C[free // LANES, free % LANES :: LANES]
        for row in range(n_row):
            new[row] = old[row]
        moved[last], users[free], users[last] = free, users[last], 0
        live[free // LANES] += 1
        live[last // LANES] -= 1
    counted[1] = 0
    numbers = of.reshape(-1)
    for k in range(numbers.size):
        if moved[numbers[k]] >= 0:
            numbers[k] = moved[numbers[k]]
