"""The compiled steps of a bank of Kalman filters side by side: the innermost loop runs over the filters, so that it
becomes vector code.

The filters differ in Q only. Each step does to all of them what its namesake in `testbed.fusion.kernels.covariance`
does to one; so do the rules for readings, forms and numba's cache that stand there.
"""

# mypy: disable-error-code="no-untyped-def, misc"

from __future__ import annotations

import functools
from typing import Any

import numpy as np
from numba import njit

from testbed.fusion.kernels.covariance import (
    INNOVATION,
    INNOVATION_VARIANCE,
    JOSEPH,
    LOST_VARIANCE,
    NODES,
    RATE,
    SQUARE_ROOT,
    STD,
)

# Rows of the output, the first two as in `kernels`; then BANK_ROWS per sensor, the first two as there.
LEVEL, BANK_HEADER_ROWS = 2, 3
REFUSED, BANK_ROWS = 2, 3


@njit(cache=True, forceinline=True, error_model="numpy")
def predict_bank(x, P, F, nonzero, Q, work, moved, n, M):  # noqa: PLR0912  # pragma: no cover
    """Set x = F x and P = F P F' + Q for M filters side by side that differ in Q only, every element computed for
    itself; zeros of F are left out.
    """
    for i in range(n):
        for m in range(M):
            moved[i, m] = 0.0
            for j in range(n):
                work[i, j, m] = 0.0
        for s in range(nonzero[i, n]):
            k = nonzero[i, s]
            factor = F[i, k]
            for m in range(M):
                moved[i, m] += factor * x[k, m]
            for j in range(n):
                for m in range(M):
                    work[i, j, m] += factor * P[k, j, m]
    for i in range(n):
        for m in range(M):
            x[i, m] = moved[i, m]
        for j in range(n):
            for m in range(M):
                moved[i, m] = Q[i, j, m]
            for s in range(nonzero[j, n]):
                k = nonzero[j, s]
                factor = F[j, k]
                for m in range(M):
                    moved[i, m] += factor * work[i, k, m]
            for m in range(M):
                P[i, j, m] = moved[i, m]


@njit(cache=True, forceinline=True, error_model="numpy")
def recall_bank(x, P, spread, share, g, n, M, form):  # noqa: PLR0912  # pragma: no cover
    """Do what `recall` does to the rate of each of M filters, beyond LOST_VARIANCE and toward 0.

    With D g = P h' / spread, h the row of the rate, the root of what is left is D - (1 - sqrt(LOST_VARIANCE / spread))
    (D g) h D.
    """
    beyond = False
    for m in range(M):
        spread[m] = P[0, 0, m]
        if form == SQUARE_ROOT:
            spread[m] *= spread[m]
            for k in range(1, n):
                spread[m] += P[0, k, m] * P[0, k, m]
        beyond = beyond or spread[m] > LOST_VARIANCE
    if not beyond:
        return
    for m in range(M):
        share[m] = max(1.0 - LOST_VARIANCE / spread[m], 0.0)
    for j in range(n):
        for m in range(M):
            g[j, m] = P[j, 0, m]
        if form == SQUARE_ROOT:
            for m in range(M):
                g[j, m] *= P[0, 0, m]
            for k in range(1, n):
                for m in range(M):
                    g[j, m] += P[j, k, m] * P[0, k, m]
        for m in range(M):
            g[j, m] /= spread[m]
    if form == SQUARE_ROOT:
        for m in range(M):
            spread[m] = 1.0 - np.sqrt(1.0 - share[m])
        # The row of the rate is what the others still need.
        for j in range(n - 1, -1, -1):
            for k in range(n):
                for m in range(M):
                    P[j, k, m] -= spread[m] * g[j, m] * P[0, k, m]
    else:
        for m in range(M):
            spread[m] *= share[m]
        for j in range(n):
            for k in range(j + 1 if form == JOSEPH else n):
                for m in range(M):
                    P[j, k, m] -= spread[m] * g[j, m] * g[k, m]
    # Likewise.
    for j in range(n - 1, -1, -1):
        for m in range(M):
            x[j, m] -= share[m] * g[j, m] * x[0, m]


@njit(cache=True, forceinline=True, error_model="numpy")
def predict_half(x, P, F, nonzero, Q, shared, work, moved, n, core, M):  # noqa: PLR0912  # pragma: no cover
    """Do what `predict_bank` does to the lower half of P.

    From `core` on F is diagonal and the noise the same for all, `shared` (n, n): those states need no sums.
    """
    for i in range(core):
        for m in range(M):
            moved[i, m] = 0.0
            for j in range(n):
                work[i, j, m] = 0.0
        for s in range(nonzero[i, n]):
            k = nonzero[i, s]
            factor = F[i, k]
            for m in range(M):
                moved[i, m] += factor * x[k, m]
            for j in range(k):
                for m in range(M):
                    work[i, j, m] += factor * P[k, j, m]
            for j in range(k, n):
                for m in range(M):
                    work[i, j, m] += factor * P[j, k, m]
    for i in range(core):
        for m in range(M):
            x[i, m] = moved[i, m]
        for j in range(i + 1):
            for m in range(M):
                moved[i, m] = Q[i, j, m]
            for s in range(nonzero[j, n]):
                k = nonzero[j, s]
                factor = F[j, k]
                for m in range(M):
                    moved[i, m] += factor * work[i, k, m]
            for m in range(M):
                P[i, j, m] = moved[i, m]
    for i in range(core, n):
        factor = F[i, i]
        for m in range(M):
            x[i, m] *= factor
        for j in range(core):
            for m in range(M):
                P[i, j, m] = shared[i, j] + factor * work[j, i, m]
        for j in range(core, i + 1):
            both = factor * F[j, j]
            for m in range(M):
                P[i, j, m] = shared[i, j] + both * P[i, j, m]


@njit(cache=True, forceinline=True, error_model="numpy")
def project_half(P, h, seen, g, n, M):  # pragma: no cover
    """Set g = P h' of each of M filters from the lower half of P; `seen` lists where h is not zero."""
    for j in range(n):
        for m in range(M):
            g[j, m] = 0.0
    for s in range(seen[n]):
        k = seen[s]
        factor = h[k]
        for j in range(k):
            for m in range(M):
                g[j, m] += factor * P[k, j, m]
        for j in range(k, n):
            for m in range(M):
                g[j, m] += factor * P[j, k, m]


@njit(cache=True, forceinline=True, error_model="numpy")
def innovate_half(x, P, h, seen, z, e, spread, g, n, M):  # pragma: no cover
    """Do what `innovate_bank` does to the lower half of P."""
    project_half(P, h, seen, g, n, M)
    for m in range(M):
        e[m] = z
        spread[m] = 0.0
    for s in range(seen[n]):
        k = seen[s]
        for m in range(M):
            e[m] -= h[k] * x[k, m]
            spread[m] += h[k] * g[k, m]


@njit(cache=True, forceinline=True, error_model="numpy")
def update_half(x, P, h, seen, R, e, spread, g, K, n, core, M):  # pragma: no cover
    """Do what `update` does to the lower half of P, behind (e, spread, g) of `innovate_half`."""
    for m in range(M):
        spread[m] = 1.0 / (spread[m] + R)
    for j in range(n):
        for m in range(M):
            K[j, m] = g[j, m] * spread[m]
            x[j, m] += K[j, m] * e[m]
        for k in range(j + 1):
            for m in range(M):
                P[j, k, m] -= K[j, m] * g[k, m]
    project_half(P, h, seen, g, n, M)
    for j in range(n):
        for m in range(M):
            g[j, m] -= R * K[j, m]
        # Among slow noise a reading changes so little that its rounding needs no second look.
        for k in range(min(j + 1, core)):
            for m in range(M):
                P[j, k, m] -= g[j, m] * K[k, m]


@njit(cache=True, forceinline=True, error_model="numpy")
def innovate_bank(x, P, h, seen, z, e, spread, g, n, M):  # pragma: no cover
    """Set e = z - h x, g = P h' and spread = h P h' of each of M filters; `seen` lists where h is not zero."""
    for m in range(M):
        e[m] = z
        spread[m] = 0.0
    for j in range(n):
        for m in range(M):
            g[j, m] = 0.0
        for s in range(seen[n]):
            k = seen[s]
            for m in range(M):
                g[j, m] += P[j, k, m] * h[k]
    for s in range(seen[n]):
        k = seen[s]
        for m in range(M):
            e[m] -= h[k] * x[k, m]
            spread[m] += h[k] * g[k, m]


@njit(cache=True, forceinline=True, error_model="numpy")
def update_plain_bank(x, P, h, seen, R, e, spread, g, K, n, M):  # pragma: no cover
    """Apply the reading behind (e, spread, g) of `innovate_bank` to M filters, in the short form of `update_plain`."""
    for j in range(n):
        for m in range(M):
            K[j, m] = g[j, m] / (spread[m] + R)
            x[j, m] += K[j, m] * e[m]
    for k in range(n):
        for m in range(M):
            g[k, m] = 0.0
        for s in range(seen[n]):
            j = seen[s]
            for m in range(M):
                g[k, m] += h[j] * P[j, k, m]
    for j in range(n):
        for k in range(n):
            for m in range(M):
                P[j, k, m] -= K[j, m] * g[k, m]


@njit(cache=True, forceinline=True, error_model="numpy")
def triangularise_bank(A, n, width, scale, total, M):  # noqa: PLR0912  # pragma: no cover
    """Do what `triangularise` does to M matrices side by side, A (n, n + width - 1, M)."""
    for i in range(n):
        for m in range(M):
            scale[m] = 0.0
        for k in range(i + 1, i + width):
            for m in range(M):
                scale[m] += A[i, k, m] * A[i, k, m]
        for m in range(M):
            length = np.sqrt(scale[m] + A[i, i, m] * A[i, i, m])
            head = A[i, i, m] + length if A[i, i, m] > 0.0 else A[i, i, m] - length
            scale[m] = 0.5 * (head * head + scale[m])
            # A row of zeros reflects nothing.
            scale[m] = scale[m] if scale[m] > 0.0 else 1.0
            A[i, i, m] = head
        for j in range(i + 1, n):
            for m in range(M):
                total[m] = 0.0
            for k in range(i, i + width):
                for m in range(M):
                    total[m] += A[j, k, m] * A[i, k, m]
            for m in range(M):
                total[m] /= scale[m]
            for k in range(i, i + width):
                for m in range(M):
                    A[j, k, m] -= total[m] * A[i, k, m]
        for m in range(M):
            # The scale is the head times the new diagonal, but for the sign.
            A[i, i, m] = -scale[m] / A[i, i, m] if A[i, i, m] != 0.0 else 0.0
        for k in range(i + 1, i + width):
            for m in range(M):
                A[i, k, m] = 0.0


@njit(cache=True, forceinline=True, error_model="numpy")
def predict_root_bank(x, D, F, nonzero, S, array, moved, scale, total, n, M):  # pragma: no cover
    """Do what `predict_bank` does to roots, by the QR of [F D, S]'; S is lower triangular."""
    for i in range(n):
        for m in range(M):
            moved[i, m] = 0.0
        for j in range(n):
            for m in range(M):
                array[i, j, m] = 0.0
                array[i, n + j, m] = S[i, j, m]
        for s in range(nonzero[i, n]):
            k = nonzero[i, s]
            factor = F[i, k]
            for m in range(M):
                moved[i, m] += factor * x[k, m]
            for j in range(n):
                for m in range(M):
                    array[i, j, m] += factor * D[k, j, m]
    triangularise_bank(array, n, n + 1, scale, total, M)
    for i in range(n):
        for m in range(M):
            x[i, m] = moved[i, m]
        for j in range(n):
            for m in range(M):
                D[i, j, m] = array[i, j, m]


@njit(cache=True, forceinline=True, error_model="numpy")
def innovate_root_bank(x, D, h, seen, z, e, spread, g, n, M):  # pragma: no cover
    """Set e = z - h x, g = D' h' and spread = |g|^2 of each of M filters; `seen` lists where h is not zero."""
    for m in range(M):
        e[m] = z
        spread[m] = 0.0
    for s in range(seen[n]):
        k = seen[s]
        for m in range(M):
            e[m] -= h[k] * x[k, m]
    for j in range(n):
        for m in range(M):
            g[j, m] = 0.0
        for s in range(seen[n]):
            k = seen[s]
            for m in range(M):
                g[j, m] += h[k] * D[k, j, m]
        for m in range(M):
            spread[m] += g[j, m] * g[j, m]


@njit(cache=True, forceinline=True, error_model="numpy")
def update_root_bank(x, D, R, e, spread, g, total, n, M):  # noqa: PLR0912  # pragma: no cover
    """Apply the reading behind (e, spread, g) of `innovate_root_bank` to M filters, as `update_root` does."""
    root = np.sqrt(R)
    for j in range(n):
        for m in range(M):
            total[m] = 0.0
        for k in range(n):
            for m in range(M):
                total[m] += D[j, k, m] * g[k, m]
        for m in range(M):
            total[m] /= spread[m] + R
            x[j, m] += total[m] * e[m]
        for k in range(n):
            for m in range(M):
                D[j, k, m] -= total[m] * g[k, m]
        for m in range(M):
            total[m] *= root * (root + np.sqrt(spread[m] + R))
        for k in range(n):
            for m in range(M):
                total[m] -= D[j, k, m] * g[k, m]
        for m in range(M):
            length = np.sqrt(spread[m] + R)
            total[m] /= length * (length + root)
        for k in range(n):
            for m in range(M):
                D[j, k, m] += total[m] * g[k, m]


@njit(cache=True, forceinline=True, error_model="numpy")
def admit(watch, surprise, gate, patience):  # pragma: no cover
    """Return whether a reading is to be used; `watch` = [refused in a row, refused so far].

    `surprise` is its innovation over the standard deviation, in the mixture: the fastest filter admits anything.
    """
    watch[0] = watch[0] + 1.0 if surprise > gate else 0.0
    # A signal that truly jumped stays outside the gate; a spike does not.
    if 0.0 < watch[0] <= patience:
        watch[1] += 1.0
        return False
    return True


@njit(cache=True, forceinline=True, error_model="numpy")
def log_likelihood(e, C, gate):  # pragma: no cover
    """Return -(ln C + e^2/C)/2, where e^2/C beyond gate^2 grows by its logarithm only: one reading never decides for
    long.
    """
    ratio = abs(e) / np.sqrt(C)
    nis = ratio * ratio
    if ratio > gate:
        nis = gate * gate * (1.0 + 2.0 * np.log(ratio / gate))
    return -0.5 * (nis + np.log(C))


@njit(cache=True, forceinline=True, error_model="numpy")
def weigh(score, weight, M):  # pragma: no cover
    """Set `weight` = exp(score) / sum, the largest score taken off first; return nothing."""
    top = score[0]
    for m in range(1, M):
        top = max(top, score[m])
    total = 0.0
    for m in range(M):
        score[m] -= top
        weight[m] = np.exp(score[m])
        total += weight[m]
    for m in range(M):
        weight[m] /= total


@njit(cache=True, forceinline=True, error_model="numpy")
def start_again(x, P, score, restart, slower, n, M, form):  # pragma: no cover
    """Give the filters slower than the best one, and by exp(-restart) less likely, its state and covariance; `score`
    ends at 0. `slower` (M,) tells which, 1 or 0, and is overwritten.
    """
    best, behind = 0, 0.0
    for m in range(1, M):
        if score[m] > score[best]:
            best = m
    for m in range(M):
        slower[m] = 1.0 if m < best and score[m] < -restart else 0.0
        behind += slower[m]
    if behind > 0.0:
        for j in range(n):
            value = x[j, best]
            for m in range(M):
                x[j, m] = value if slower[m] > 0.0 else x[j, m]
            for k in range(j + 1 if form == JOSEPH else n):
                value = P[j, k, best]
                for m in range(M):
                    P[j, k, m] = value if slower[m] > 0.0 else P[j, k, m]


@njit(cache=True, forceinline=True, error_model="numpy")
def between_bank(Q, table, j, s, n, M):  # pragma: no cover
    """Set Q = (1 - s) table[j] + s table[j + 1] for M filters side by side, their first n rows and columns."""
    for a in range(n):
        for b in range(n):
            for m in range(M):
                Q[a, b, m] = table[j, a, b, m]
            if s != 0.0:
                for m in range(M):
                    Q[a, b, m] += s * (table[j + 1, a, b, m] - table[j, a, b, m])


@njit(cache=True, forceinline=True, error_model="numpy")
def between_one(M, table, j, s, n):  # pragma: no cover
    """Do what `between` of the other file does."""
    for a in range(n):
        for b in range(n):
            M[a, b] = table[j, a, b]
            if s != 0.0:
                M[a, b] += s * (table[j + 1, a, b] - table[j, a, b])


@functools.lru_cache
def bank_kernel(n: int, n_sensor: int, M: int, form: int = JOSEPH, n_slow: int = 0) -> Any:  # noqa: PLR0915
    """Return run(x, P, F, nonzero, Q, shared, H, seen, R, Z, clocked, score, watch, setting, levels, out), a bank of M
    Kalman filters over a block.

    They differ in Q (n, n, M) only and lie side by side: x (n, M), P (n, n, M); in SQUARE_ROOT form P and Q are roots.
    In JOSEPH form only the lower half of P is kept, and for the last `n_slow` states Q is `shared` (n, n).
    `nonzero` (n, n + 1) and `seen` (n_sensor, n + 1) list the columns of F and H that are not zero, their number last.
    `score` (M,) is the forgetting sum of log likelihoods, `watch` (n_sensor, 2) as in `admit`, `setting` = [started,
    forget, gate, patience, restart], `levels` (M,) what the weights average into the row LEVEL. `clocked` is as there,
    with a table of `shared` behind that of Q (n_node, n, n, M), of which JOSEPH form takes the states before those of
    slow noise only.
    """
    states, readings, filters, fast = n, n_sensor, M, n - n_slow

    @njit(cache=True, error_model="numpy")
    def run(x_in, P_in, F_in, nonzero, Q_in, shared, H_in, seen, R, Z, clocked, score, watch, setting, levels, out):  # noqa: PLR0912, PLR0915  # pragma: no cover
        n, n_sensor, M, core = np.int64(states), np.int64(readings), np.int64(filters), np.int64(fast)
        x, moved, g, K = np.empty((n, M)), np.empty((n, M)), np.empty((n, M)), np.empty((n, M))
        P, Q, work = np.empty((n, n, M)), np.empty((n, n, M)), np.empty((n, 2 * n if form == SQUARE_ROOT else n, M))
        F, H = np.empty((n, n)), np.empty((n_sensor, n))
        e, spread, weight, scale, total = np.empty(M), np.empty(M), np.empty(M), np.empty(M), np.empty(M)
        used = np.empty(n_sensor, dtype=np.bool_)
        x[:], P[:], Q[:], F[:], H[:] = x_in, P_in, Q_in, F_in, H_in
        common = np.empty((n, n))
        common[:] = shared
        node, share, whole, F_between, Q_between, shared_between = clocked
        at, part, span = -1, 0.0, 1.0
        forget, gate, patience = setting[1], setting[2], setting[3]
        weigh(score, weight, M)
        for k in range(Z.shape[1]):
            parts = whole[k] + 1 if node.size > 0 else 1
            for turn in range(parts if setting[0] > 0.0 else 0):
                if node.size > 0:
                    j, s = (NODES, 0.0) if turn < parts - 1 else (node[k], share[k])
                    if at != j or part != s:
                        between_one(F, F_between, j, s, n)
                        between_bank(Q, Q_between, j, s, core if form == JOSEPH else n, M)
                        between_one(common, shared_between, j, s, n)
                        at, part = j, s
                    span = (j + s) / NODES
                if form == SQUARE_ROOT:
                    predict_root_bank(x, P, F, nonzero, Q, work, moved, scale, total, n, M)
                elif form == JOSEPH:
                    predict_half(x, P, F, nonzero, Q, common, work, moved, n, core, M)
                else:
                    predict_bank(x, P, F, nonzero, Q, work, moved, n, M)
                recall_bank(x, P, spread, total, g, n, M, form)
            informed, fresh = False, -1
            for i in range(n_sensor):
                row = BANK_HEADER_ROWS + BANK_ROWS * i
                out[row + INNOVATION, k] = np.nan
                out[row + INNOVATION_VARIANCE, k] = np.nan
                used[i] = False
                if np.isfinite(Z[i, k]):
                    if form == SQUARE_ROOT:
                        innovate_root_bank(x, P, H[i], seen[i], Z[i, k], e, spread, g, n, M)
                    elif form == JOSEPH:
                        innovate_half(x, P, H[i], seen[i], Z[i, k], e, spread, g, n, M)
                    else:
                        innovate_bank(x, P, H[i], seen[i], Z[i, k], e, spread, g, n, M)
                    fresh = i
                    mean = 0.0
                    for m in range(M):
                        mean += weight[m] * e[m]
                    variance = R[i]
                    for m in range(M):
                        variance += weight[m] * (spread[m] + (e[m] - mean) ** 2)
                    out[row + INNOVATION, k] = mean
                    out[row + INNOVATION_VARIANCE, k] = variance
                    used[i] = admit(watch[i], abs(mean) / np.sqrt(variance), gate, patience)
                    informed = informed or used[i]
                out[row + REFUSED, k] = watch[i, 1]
            if informed:
                setting[0] = 1.0
                fade = forget if span == 1.0 else forget**span
                for m in range(M):
                    score[m] *= fade
                for i in range(n_sensor):
                    if used[i]:
                        # What the gate looked at last is still so, unless a reading was used since.
                        if fresh != i:
                            if form == SQUARE_ROOT:
                                innovate_root_bank(x, P, H[i], seen[i], Z[i, k], e, spread, g, n, M)
                            elif form == JOSEPH:
                                innovate_half(x, P, H[i], seen[i], Z[i, k], e, spread, g, n, M)
                            else:
                                innovate_bank(x, P, H[i], seen[i], Z[i, k], e, spread, g, n, M)
                        fresh = -1
                        for m in range(M):
                            score[m] += log_likelihood(e[m], spread[m] + R[i], gate)
                        if form == SQUARE_ROOT:
                            update_root_bank(x, P, R[i], e, spread, g, total, n, M)
                        elif form == JOSEPH:
                            update_half(x, P, H[i], seen[i], R[i], e, spread, g, K, n, core, M)
                        else:
                            update_plain_bank(x, P, H[i], seen[i], R[i], e, spread, g, K, n, M)
                weigh(score, weight, M)
                start_again(x, P, score, setting[4], total, n, M, form)
            rate, variance, level = 0.0, 0.0, 0.0
            for m in range(M):
                rate += weight[m] * x[0, m]
                level += weight[m] * levels[m]
            for m in range(M):
                own = P[0, 0, m]
                if form == SQUARE_ROOT:
                    own *= own
                    for j in range(1, n):
                        own += P[0, j, m] * P[0, j, m]
                variance += weight[m] * (own + (x[0, m] - rate) ** 2)
            out[RATE, k] = rate
            out[STD, k] = np.sqrt(variance)
            out[LEVEL, k] = level
        x_in[:], P_in[:] = x, P

    return run
