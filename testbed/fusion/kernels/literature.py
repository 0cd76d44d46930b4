"""The compiled steps of the filters from the literature: `vb_akf_kernel` and `imm_kernel`.

Numba's disk cache watches the file of a kernel alone, so that what both call stands here too, as in
`testbed.fusion.kernels.covariance`, with which it shares numbers but no code. Readings come as one row per sensor at
the fastest rate: NaN where none is due, infinite where one is missing. Both mean: predict only. Until the first reading
nothing is predicted either. `clocked` = (node, share, whole, F, Q) says how steps of any length are reached, as there.
"""

# mypy: disable-error-code="no-untyped-def, misc"

from __future__ import annotations

import numpy as np
from numba import njit

from testbed.fusion.kernels.covariance import HEADER_ROWS, LOST_VARIANCE, NODES, RATE, STD

# Rows of a sensor behind those that stand once: innovation, its variance; for the first filter R too.
VB_ROWS, IMM_ROWS = 3, 2


@njit(cache=True, error_model="numpy")
def predict_dense(x, P, F, Q, work, moved):  # pragma: no cover
    """Set x = F x and P = F P F' + Q, exactly symmetric, the variance of the rate held below LOST_VARIANCE."""
    n = x.size
    for i in range(n):
        total = 0.0
        for j in range(n):
            total += F[i, j] * x[j]
            work[i, j] = 0.0
        moved[i] = total
        for k in range(n):
            factor = F[i, k]
            if factor != 0.0:
                for j in range(n):
                    work[i, j] += factor * P[k, j]
    for i in range(n):
        x[i] = moved[i]
        for j in range(i + 1):
            total = Q[i, j]
            for k in range(n):
                total += work[i, k] * F[j, k]
            P[i, j] = total
            P[j, i] = total
    if P[0, 0] > LOST_VARIANCE:
        spread = P[0, 0]
        share, off = (spread - LOST_VARIANCE) / spread, x[0]
        for j in range(n):
            moved[j] = P[j, 0] / spread
        for j in range(n):
            x[j] -= share * moved[j] * off
            for k in range(j + 1):
                P[j, k] -= share * spread * moved[j] * moved[k]
                P[k, j] = P[j, k]


@njit(cache=True, error_model="numpy")
def between_dense(M, table, j, s):  # pragma: no cover
    """Set M = (1 - s) table[j] + s table[j + 1]."""
    for a in range(M.shape[0]):
        for b in range(M.shape[1]):
            M[a, b] = table[j, a, b]
            if s != 0.0:
                M[a, b] += s * (table[j + 1, a, b] - table[j, a, b])


@njit(cache=True, error_model="numpy")
def seen_dense(x, P, h, z, g):  # pragma: no cover
    """Return (z - h x, h P h'), and leave P h' in g."""
    n = x.size
    e, spread = z, 0.0
    for i in range(n):
        total = 0.0
        for j in range(n):
            total += P[i, j] * h[j]
        g[i] = total
    for i in range(n):
        e -= h[i] * x[i]
        spread += h[i] * g[i]
    return e, spread


@njit(cache=True, error_model="numpy")
def update_dense(x, P, h, z, R, g, K):  # pragma: no cover
    """Apply one reading in Joseph form, its factors one after the other; return innovation and its variance."""
    n = x.size
    e, S = seen_dense(x, P, h, z, g)
    S += R
    for j in range(n):
        K[j] = g[j] / S
        x[j] += K[j] * e
    for j in range(n):
        for k in range(n):
            P[j, k] -= K[j] * g[k]
    seen_dense(x, P, h, z, g)
    for j in range(n):
        factor = g[j] - R * K[j]
        for k in range(j + 1):
            total = P[j, k] - factor * K[k]
            P[j, k] = total
            P[k, j] = total
    return e, S


@njit(cache=True, error_model="numpy")
def any_reading(Z, k):  # pragma: no cover
    """Return whether a sensor has a reading at step k."""
    found = False
    for i in range(Z.shape[0]):
        found |= np.isfinite(Z[i, k])
    return found


@njit(cache=True, error_model="numpy")
def vb_akf_kernel(x, P, F_in, Q_in, H, alpha, beta, forget, iterations, started, Z, clocked, out):  # pragma: no cover
    """Run the variational-Bayes adaptive filter over a block; return whether there was a reading so far.

    x, P, and alpha, beta (n_sensor,) of the inverse gamma distribution of each R are replaced by those of the last
    step. `out` receives rate, std, and per sensor innovation, its variance and R.
    """
    n, n_sensor = x.size, Z.shape[0]
    work, moved, g, K = np.empty((n, n)), np.empty(n), np.empty(n), np.empty(n)
    x_prior, P_prior = np.empty(n), np.empty((n, n))
    before = np.empty(n_sensor)
    node, share, whole, F_between, Q_between = clocked
    F, Q, at, part = F_in.copy(), Q_in.copy(), -1, 0.0
    for k in range(Z.shape[1]):
        turns = whole[k] + 1 if node.size > 0 else 1
        for turn in range(turns if started else 0):
            if node.size > 0:
                j, s = (NODES, 0.0) if turn < turns - 1 else (node[k], share[k])
                if at != j or part != s:
                    between_dense(F, F_between, j, s)
                    between_dense(Q, Q_between, j, s)
                    at, part = j, s
            predict_dense(x, P, F, Q, work, moved)
        if any_reading(Z, k):
            started = True
            x_prior[:], P_prior[:] = x, P
            for i in range(n_sensor):
                if np.isfinite(Z[i, k]):
                    row = HEADER_ROWS + VB_ROWS * i
                    e, spread = seen_dense(x, P, H[i], Z[i, k], g)
                    out[row, k], out[row + 1, k] = e, spread + beta[i] / alpha[i]
                    before[i] = forget * beta[i]
                    alpha[i], beta[i] = forget * alpha[i] + 0.5, before[i]
            for _ in range(iterations):
                x[:], P[:] = x_prior, P_prior
                for i in range(n_sensor):
                    if np.isfinite(Z[i, k]):
                        out[HEADER_ROWS + VB_ROWS * i + 2, k] = beta[i] / alpha[i]
                        update_dense(x, P, H[i], Z[i, k], beta[i] / alpha[i], g, K)
                for i in range(n_sensor):
                    if np.isfinite(Z[i, k]):
                        rest, spread = seen_dense(x, P, H[i], Z[i, k], g)
                        beta[i] = before[i] + 0.5 * (rest * rest + spread)
        out[RATE, k], out[STD, k] = x[0], np.sqrt(P[0, 0])
    return started


@njit(cache=True, error_model="numpy")
def interact(X, P, stay, mu, X_old, P_old):  # pragma: no cover
    """Replace state and covariance of each model by the mixture with which its step begins, mu by its probability.

    A model stays with probability `stay` and goes to each other one with the same of what is left.
    """
    n_model, n = X.shape
    if n_model == 1:
        return
    go = (1.0 - stay) / (n_model - 1)
    X_old[:], P_old[:] = X, P
    old = mu.copy()
    for j in range(n_model):
        total = 0.0
        for i in range(n_model):
            total += (stay if i == j else go) * old[i]
        mu[j] = total
        X[j] = 0.0
        for i in range(n_model):
            share = (stay if i == j else go) * old[i] / total
            for a in range(n):
                X[j, a] += share * X_old[i, a]
        P[j] = 0.0
        for i in range(n_model):
            share = (stay if i == j else go) * old[i] / total
            for a in range(n):
                off = X_old[i, a] - X[j, a]
                for b in range(a + 1):
                    P[j, a, b] += share * (P_old[i, a, b] + off * (X_old[i, b] - X[j, b]))
        for a in range(n):
            for b in range(a):
                P[j, b, a] = P[j, a, b]


@njit(cache=True, error_model="numpy")
def imm_kernel(X, P, F_in, Q_in, H, R, stay, mu, started, Z, clocked, out):  # noqa: PLR0912  # pragma: no cover
    """Run the interacting multiple model over a block; return whether there was a reading so far.

    X (n_model, n), P (n_model, n, n) and mu (n_model,) are replaced by those of the last step; the models differ in
    Q (n_model, n, n), as in the tables between stamps. `out` receives rate, std, the probability of each model, and per
    sensor innovation and its variance.
    """
    (n_model, n), n_sensor = X.shape, Z.shape[0]
    work, moved, g, K = np.empty((n, n)), np.empty(n), np.empty(n), np.empty(n)
    X_old, P_old, likelihood = np.empty((n_model, n)), np.empty((n_model, n, n)), np.empty(n_model)
    node, share, whole, F_between, Q_between = clocked
    F, Q, at, part, stays = F_in.copy(), Q_in.copy(), -1, 0.0, stay
    for k in range(Z.shape[1]):
        turns = whole[k] + 1 if node.size > 0 else 1
        for turn in range(turns if started else 0):
            if node.size > 0:
                j, s = (NODES, 0.0) if turn < turns - 1 else (node[k], share[k])
                if at != j or part != s:
                    between_dense(F, F_between, j, s)
                    for m in range(n_model):
                        between_dense(Q[m], Q_between[m], j, s)
                    span = (j + s) / NODES
                    stays = stay if span == 1.0 else stay**span
                    at, part = j, s
            interact(X, P, stays, mu, X_old, P_old)
            for j in range(n_model):
                predict_dense(X[j], P[j], F, Q[j], work, moved)
        if any_reading(Z, k):
            started = True
            for i in range(n_sensor):
                if np.isfinite(Z[i, k]):
                    mean, square = 0.0, 0.0
                    for j in range(n_model):
                        e, spread = seen_dense(X[j], P[j], H[i], Z[i, k], g)
                        mean += mu[j] * e
                        square += mu[j] * (spread + R[i] + e * e)
                    row = HEADER_ROWS + n_model + IMM_ROWS * i
                    out[row, k], out[row + 1, k] = mean, square - mean * mean
            for j in range(n_model):
                likelihood[j] = 0.0
                for i in range(n_sensor):
                    if np.isfinite(Z[i, k]):
                        e, S = update_dense(X[j], P[j], H[i], Z[i, k], R[i], g, K)
                        likelihood[j] -= 0.5 * (np.log(S) + e * e / S)
            highest, total = likelihood.max(), 0.0
            for j in range(n_model):
                mu[j] *= np.exp(likelihood[j] - highest)
                total += mu[j]
            for j in range(n_model):
                mu[j] /= total
        mean, square = 0.0, 0.0
        for j in range(n_model):
            mean += mu[j] * X[j, 0]
        for j in range(n_model):
            square += mu[j] * (P[j, 0, 0] + (X[j, 0] - mean) ** 2)
            out[HEADER_ROWS + j, k] = mu[j]
        out[RATE, k], out[STD, k] = mean, np.sqrt(square)
    return started
