"""The compiled merging of readings with stamps: one step for each instant at which there is a reading.

It shares the number of nodes with `testbed.fusion.kernels.covariance`; who changes it touches this file too, since
numba's disk cache watches no other.
"""

# mypy: disable-error-code="no-untyped-def, misc"

from __future__ import annotations

import numpy as np
from numba import njit

from testbed.fusion.kernels.covariance import NODES
from testbed.fusion.schedule import LARGEST_RATE

# A stamp beyond all that are taken: nothing is due any more.
NEVER = np.iinfo(np.int64).max
# What is known of a sensor: nothing yet, its last reading, or that it has been silent for too long since.
NOTHING, HEARD, OVERDUE = range(3)
# So many of its periods after the last reading one is missing.
PATIENCE = 1.5
# The longest step that is taken at once, in regular ones; what is longer begins with whole regular steps.
LONGEST = 1.5
# Steps this close to a node are taken for it, in nodes.
NEAR = 0.01


@njit(cache=True, error_model="numpy")
def merge_stamps(time, value, bounds, period, fastest, memory, out):  # noqa: PLR0912  # pragma: no cover
    """Fill `out` with the steps of a block, advance `memory`, and return how many there are.

    Parameters
    ----------
    time, value : ndarray, shape (n_reading,)
        Stamps [ns], rising for each sensor, and readings [rad/s], one sensor after the other.
    bounds : ndarray of int, shape (n_sensor + 1,)
        Where each begins.
    period : ndarray, shape (n_sensor,)
        Nominal time between readings [ns].
    fastest : int
        The sensor whose readings are shown.
    memory : tuple
        (begun, last step [ns]), shape (2,); of each sensor the last stamp, what is known, and readings that came too
        late, each of shape (n_sensor,).
    out : tuple
        (Z, length, shown), with room for two steps per reading: Z (n_sensor, n_step) the readings, NaN where none is,
        infinite where one is missing; the length of each step in regular ones; whether the fastest has a reading there.
    """
    begun, now, T = memory[0][0] > 0, memory[0][1], period[fastest]
    _, last, known, late = memory
    Z, length, shown = out
    n_sensor, head, k = period.size, bounds[:-1].copy(), 0
    patience, due = PATIENCE * period, np.full(n_sensor, NEVER)
    for i in range(n_sensor):
        while begun and head[i] < bounds[i + 1] and time[head[i]] < now:
            late[i] += 1
            head[i] += 1
        if head[i] < bounds[i + 1]:
            due[i] = time[head[i]]
    while True:
        t = due[0]
        for i in range(1, n_sensor):
            t = min(t, due[i])
        if t == NEVER:
            break
        taken = (t - now) / T if begun else 1.0
        if taken > LONGEST:
            # The first regular step of it has a place of its own, where the gap is seen.
            length[k], shown[k] = 1.0, False
            taken -= 1.0
            for i in range(n_sensor):
                Z[i, k] = np.nan
                if known[i] == HEARD and t - last[i] > patience[i]:
                    Z[i, k], known[i] = np.inf, OVERDUE
            k += 1
        length[k], shown[k] = taken, due[fastest] == t
        for i in range(n_sensor):
            if due[i] == t:
                z = value[head[i]]
                Z[i, k] = z if abs(z) <= LARGEST_RATE else np.inf
                head[i] += 1
                due[i] = time[head[i]] if head[i] < bounds[i + 1] else NEVER
                last[i], known[i] = t, HEARD
            elif known[i] == HEARD and t - last[i] > patience[i]:
                Z[i, k], known[i] = np.inf, OVERDUE
            else:
                Z[i, k] = np.nan
        begun, now = True, t
        k += 1
    memory[0][0], memory[0][1] = begun, now
    return k


@njit(cache=True, error_model="numpy")
def place_steps(length, node, share, whole):  # pragma: no cover
    """Fill (node, share, whole) of `testbed.fusion.transitions.Steps`, each of shape (n_step,), for steps of these
    lengths, in regular ones.
    """
    for k in range(length.size):
        first = max(np.ceil(length[k] - LONGEST), 0.0)
        place = (length[k] - first) * NODES
        j = int(place)
        s = place - j
        if s < NEAR:
            s = 0.0
        elif s > 1.0 - NEAR:
            j, s = j + 1, 0.0
        node[k], share[k], whole[k] = j, s, int(first)


@njit(cache=True, error_model="numpy")
def show_steps(out, shown, first, pending, kept, begin):  # pragma: no cover
    """Set kept[:, begin:] = the columns of `out` that are shown; from row `first` on, where one is undefined, what the
    columns before it gave that are not. `pending` (n_row,) is what the last ones leave for the next block; `out` is
    left undefined.
    """
    for r in range(out.shape[0]):
        held, at = pending[r], np.uint64(begin)
        for k in range(np.uint64(shown.size)):
            value = out[r, k]
            out[r, k] = np.nan
            held = held if np.isnan(value) else value
            if shown[k]:
                kept[r, at] = held
                held = np.nan
                at += np.uint64(1)
            elif r < first:
                held = np.nan
        pending[r] = held
