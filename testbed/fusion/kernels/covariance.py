"""The compiled steps of the filters with one covariance, for sizes known to the compiler.

`kalman_kernel`, `settling_kernel` and `adaptive_kernel` build one machine-code loop per (number of states, number of
sensors): loops of constant length unroll. What they call is given these sizes as variables, so that numba compiles it
once and not for every size; inlined into the loop they are constants again. What is given arrays there has one way
through it: with two, numba counts references to them, atomically, at each call.
The last `n_slow` states are those of slow noise: each moves by itself and enters the others, which in Joseph form is
made use of. The kernels close over integers only, which numba's disk cache keys by value, so that a second process
loads and does not compile. That cache watches no other file than the kernel's own: what calls each other stays in one
file, which is why this one is long.
`testbed.fusion.kernels.bank` and `testbed.fusion.two_paths.kernel` share numbers with it but no code; who changes such
a number touches those files too.

The arrays handed in decide the precision: in single precision no sum of the state and covariance recursion is formed in
double. `form` decides what stands for the covariance: P itself (CONVENTIONAL, JOSEPH), or, in SQUARE_ROOT, roots D and
S in place of P and Q, P = D D' and Q = S S'.

Readings come as one row per sensor at the fastest rate: NaN where none is due, infinite where one is due but missing
(it also breaks the chain of differences). Both mean: predict only. Until the first reading nothing is predicted either.

Steps may be of any length: `clocked` = (node, share, whole, F, Q) says how step k is reached, by whole[k] regular steps
and one that ends the share s behind a node of the tables F and Q (n_node, n, n), which have NODES of them to a regular
step (`testbed.fusion.transitions`). Where `node` is empty every step is a regular one, and nobody looks at the tables.
"""

# mypy: disable-error-code="no-untyped-def, misc"

from __future__ import annotations

import functools
from typing import Any

import numpy as np
from numba import njit

# Forms of the covariance.
CONVENTIONAL, JOSEPH, SQUARE_ROOT = 0, 1, 2

# Nodes of the tables of transitions to one regular step.
NODES = 128
# Rows of the output of `kalman_kernel`; then INNOVATION_ROWS per sensor.
RATE, STD, HEADER_ROWS = 0, 1, 2
INNOVATION, INNOVATION_VARIANCE, INNOVATION_ROWS = 0, 1, 2
# A reading that many standard deviations of its innovation off is a spike and left out, but not more than PATIENCE in a
# row: what lasts longer is the signal. So wide that the lag behind a fast signal stays inside, and a spike inside does
# no harm that lasts.
GATE, PATIENCE = 1000.0, 10
# Variance of a rate that is lost, as in a gap of all sensors [rad^2/s^2]: no signal is believed to go beyond it.
LOST_VARIANCE = 1.0
# Entries of `progress` of `settling_kernel`, its modes, and the relative change of a gain between two checks that ends
# the recursion.
STARTED, STEP, MODE, SINCE, KEPT, EVERY, PRESENT, COUNTS = range(8)
RECURSION, KEEPING, SETTLED = range(3)
SETTLED_CHANGE = 1e-3
# Rows of the output of `adaptive_kernel`; then ADAPTIVE_ROWS per sensor, the first two as above.
Q_RATE, GUARD_HITS, ADAPTIVE_HEADER_ROWS = 2, 3, 4
R_USED, INCREMENTS, BAND, INFLATION, ADAPTIVE_ROWS = 2, 3, 4, 5, 6

# One record per sensor: what the adaptation was set to, and what it remembers.
SENSOR = np.dtype(
    [
        ("adapt_R", np.bool_),  # (17)
        ("adapt_offset", np.bool_),  # (16)
        ("follow", np.bool_),  # R is N_k / dT
        ("difference", np.bool_),  # judge by differences of the innovation
        ("forget", np.float64),  # beta
        ("power", np.float64),  # beta^k
        ("offset_power", np.float64),
        ("R", np.float64),
        ("offset", np.float64),  # r
        ("lowest", np.float64),  # bounds of R
        ("highest", np.float64),
        ("floor", np.float64),
        ("clamp", np.float64),  # factor around the band's R, infinite for none
        ("hits", np.int64),  # times that a bound of R held
        ("outside", np.int64),  # readings in a row outside the gate
        ("previous_innovation", np.float64),
        ("previous_reading", np.float64),
        ("increments", np.int64),  # k - 1
        ("increment_variance", np.float64),  # N_k / dT
        ("least_weight", np.float64),  # of a new increment; 0 is the infinite memory of (30)
        ("wait", np.int64),  # increments before a band is judged
        ("banded", np.bool_),
        ("band", np.int64),  # -1 before the first judgement
        ("thresholds", np.float64, (2,)),
        ("levels", np.float64, (3,)),
        ("alpha", np.float64),
        ("window_sum", np.float64),
        ("window_count", np.int64),
    ]
)


@njit(cache=True, forceinline=True, error_model="numpy")
def between(M, table, j, s, n, rows):  # pragma: no cover
    """Set M = (1 - s) table[j] + s table[j + 1], which for covariances is one too: `rows` of it, and the diagonal.

    In Joseph form the states behind `core` need no more than their diagonal, and what enters the rows before it.
    """
    part, after = M.dtype.type(s), j + 1 if s > 0.0 else j
    for a in range(rows):
        for b in range(n):
            M[a, b] = table[j, a, b] + part * (table[after, a, b] - table[j, a, b])
    for a in range(rows, n):
        M[a, a] = table[j, a, a] + part * (table[after, a, a] - table[j, a, a])


@njit(cache=True, forceinline=True, error_model="numpy")
def alike(node, share, whole, begin):  # pragma: no cover
    """Return the first step after `begin` that is not of its length: in between F and Q stay what they are, and the
    compiler knows it.
    """
    stop = begin + 1
    while stop < node.size and whole[stop] == 0 and node[stop] == node[begin] and share[stop] == share[begin]:
        stop += 1
    return stop


@njit(cache=True, forceinline=True, error_model="numpy")
def spans(A, first, stop, reach):  # pragma: no cover
    """Set reach[i] = the columns from `first` to before `stop` between which row i of A is not zero."""
    for i in range(A.shape[0]):
        low, high = stop, first
        for j in range(first, stop):
            if A[i, j] != 0.0:
                low, high = min(low, j), j + 1
        reach[i, 0], reach[i, 1] = (low, high) if low < high else (first, first)


@njit(cache=True, forceinline=True, error_model="numpy")
def move(x, F, reach, moved, n, core):  # pragma: no cover
    """Set x = F x; from `core` on F is diagonal, and reach[i] says which of those states enter row i."""
    for i in range(core):
        total = x.dtype.type(0.0)
        for j in range(core):
            total += F[i, j] * x[j]
        # Taken by the compiler, here and below: loops that are always empty took a sixth of a step of five states.
        if core < n:
            for j in range(reach[i, 0], reach[i, 1]):
                total += F[i, j] * x[j]
        moved[i] = total
    for i in range(core):
        x[i] = moved[i]
    for i in range(core, n):
        x[i] *= F[i, i]


@njit(cache=True, forceinline=True, error_model="numpy")
def predict(x, P, F, Q, reach, work, moved, n, core):  # pragma: no cover
    """Set x = F x and P = F P F' + Q, exactly symmetric."""
    move(x, F, reach, moved, n, core)
    grow(P, F, Q, reach, work, n, core)


@njit(cache=True, forceinline=True, error_model="numpy")
def grow(P, F, Q, reach, work, n, core):  # noqa: PLR0912  # pragma: no cover
    """Set P = F P F' + Q, exactly symmetric; from `core` on F is diagonal, as in `move`."""
    for i in range(core):
        for j in range(n):
            work[i, j] = F[i, 0] * P[0, j]
        for k in range(1, core):
            factor = F[i, k]
            for j in range(n):
                work[i, j] += factor * P[k, j]
        if core < n:
            for k in range(reach[i, 0], reach[i, 1]):
                factor = F[i, k]
                for j in range(n):
                    work[i, j] += factor * P[k, j]
    for i in range(core):
        for j in range(i + 1):
            total = Q[i, j]
            for k in range(core):
                total += work[i, k] * F[j, k]
            if core < n:
                for k in range(reach[j, 0], reach[j, 1]):
                    total += work[i, k] * F[j, k]
            P[i, j] = total
            P[j, i] = total
        for j in range(core, n):
            total = Q[i, j] + work[i, j] * F[j, j]
            P[i, j] = total
            P[j, i] = total
    for i in range(core, n):
        for j in range(core, i + 1):
            total = Q[i, j] + F[i, i] * P[i, j] * F[j, j]
            P[i, j] = total
            P[j, i] = total


@njit(cache=True, forceinline=True, error_model="numpy")
def recall(x, P, i, most, toward, g, n):  # pragma: no cover
    """Take off the variance of state i beyond `most`, by a reading of it `toward` that is just so uncertain: a
    covariance that grew without end would lose its sign at the next reading.
    """
    spread = P[i, i]
    if not spread > most:
        return
    share, off = (spread - most) / spread, x[i] - toward
    for j in range(n):
        g[j] = P[j, i] / spread
    for j in range(n):
        x[j] -= share * g[j] * off
        for k in range(j + 1):
            P[j, k] -= share * spread * g[j] * g[k]
            P[k, j] = P[j, k]


@njit(cache=True, forceinline=True, error_model="numpy")
def project(P, H, seen, i, g, n, core):  # pragma: no cover
    """Set g = P H_i', P symmetric; seen[i] are the columns of H_i before `core` and behind it that are not zero."""
    for j in range(n):
        g[j] = P.dtype.type(0.0)
    for part in range(2 if core < n else 1):
        for k in range(seen[i, 2 * part], seen[i, 2 * part + 1]):
            factor = H[i, k]
            for j in range(n):
                g[j] += factor * P[k, j]


@njit(cache=True, forceinline=True, error_model="numpy")
def innovation(x, P, H, seen, i, z, g, n, core):  # pragma: no cover
    """Return (z - H_i x, H_i P H_i'); `seen` as in `project`, whose g is left behind."""
    project(P, H, seen, i, g, n, core)
    e, spread = z, x.dtype.type(0.0)
    for part in range(2 if core < n else 1):
        for k in range(seen[i, 2 * part], seen[i, 2 * part + 1]):
            e -= H[i, k] * x[k]
            spread += H[i, k] * g[k]
    return e, spread


@njit(cache=True, forceinline=True, error_model="numpy")
def outside_gate(count, e, C):  # pragma: no cover
    """Return how many readings in a row, `count` before this one, are outside the gate; up to PATIENCE of them are left
    out.
    """
    return count + 1 if e * e > GATE * GATE * C else 0


@njit(cache=True, forceinline=True, error_model="numpy")
def update(x, P, H, seen, i, z, R, g, K, n, core):  # pragma: no cover
    """Apply one scalar reading in Joseph form, P = (I - K h)P(I - K h)' + K R K', its factors applied one after the
    other.
    """
    e, C = innovation(x, P, H, seen, i, z, g, n, core)
    C += R
    for j in range(n):
        K[j] = g[j] / C
        x[j] += K[j] * e
    for j in range(n):
        factor = K[j]
        for k in range(n):
            P[j, k] -= factor * g[k]
    # The column P h' - R K, by rows; what the first factor left unsymmetric is rounding.
    project(P, H, seen, i, g, n, core)
    for j in range(n):
        g[j] -= R * K[j]
    for j in range(n):
        factor = g[j]
        for k in range(j + 1):
            total = P[j, k] - factor * K[k]
            P[j, k] = total
            P[k, j] = total


@njit(cache=True, forceinline=True, error_model="numpy")
def move_whole(x, F, moved, n):  # pragma: no cover
    """Set x = F x for any F."""
    for i in range(n):
        total = x.dtype.type(0.0)
        for j in range(n):
            total += F[i, j] * x[j]
        moved[i] = total
    for i in range(n):
        x[i] = moved[i]


@njit(cache=True, forceinline=True, error_model="numpy")
def predict_plain(x, P, F, Q, work, moved, n):  # pragma: no cover
    """Set x = F x and P = F P F' + Q, every element computed for itself."""
    move_whole(x, F, moved, n)
    for i in range(n):
        for j in range(n):
            total = x.dtype.type(0.0)
            for k in range(n):
                total += F[i, k] * P[k, j]
            work[i, j] = total
    for i in range(n):
        for j in range(n):
            total = Q[i, j]
            for k in range(n):
                total += work[i, k] * F[j, k]
            P[i, j] = total


@njit(cache=True, forceinline=True, error_model="numpy")
def update_plain(x, P, H, seen, i, z, R, g, K, n, core):  # pragma: no cover
    """Apply one scalar reading in the short form P = P - K h P, whose rounding can cost P its symmetry and its positive
    eigenvalues.
    """
    e, C = z, R
    for j in range(n):
        total = x.dtype.type(0.0)
        for k in range(n):
            total += P[j, k] * H[i, k]
        K[j] = total
    for j in range(n):
        e -= H[i, j] * x[j]
        C += H[i, j] * K[j]
    for j in range(n):
        K[j] /= C
    for k in range(n):
        total = x.dtype.type(0.0)
        for j in range(n):
            total += H[i, j] * P[j, k]
        g[k] = total
    for j in range(n):
        x[j] += K[j] * e
        for k in range(n):
            P[j, k] -= K[j] * g[k]


@njit(cache=True, forceinline=True, error_model="numpy")
def triangularise(A, n, width):  # pragma: no cover
    """Bring A (n, n + width - 1) to lower triangular form by Householder reflections from the right, which leaves A A'
    as it is.

    Row i must be zero from column i + width on.
    """
    zero = A.dtype.type(0.0)
    for i in range(n):
        square = zero
        for k in range(i + 1, i + width):
            square += A[i, k] * A[i, k]
        if square == zero:
            continue
        length = np.sqrt(square + A[i, i] * A[i, i])
        # The sign without cancellation.
        head = A[i, i] + length if A[i, i] > zero else A[i, i] - length
        scale = (head * head + square) / A.dtype.type(2.0)
        diagonal = A[i, i] - head
        A[i, i] = head
        for j in range(i + 1, n):
            total = zero
            for k in range(i, i + width):
                total += A[j, k] * A[i, k]
            total /= scale
            for k in range(i, i + width):
                A[j, k] -= total * A[i, k]
        A[i, i] = diagonal
        for k in range(i + 1, i + width):
            A[i, k] = zero


@njit(cache=True, forceinline=True, error_model="numpy")
def predict_root(x, D, F, S, array, moved, n):  # pragma: no cover
    """Set x = F x and D D' = F D (F D)' + S S' by the QR of [F D, S]'; S is lower triangular."""
    move_whole(x, F, moved, n)
    for i in range(n):
        for j in range(n):
            array[i, j] = F[i, 0] * D[0, j]
            array[i, n + j] = S[i, j]
        for k in range(1, n):
            for j in range(n):
                array[i, j] += F[i, k] * D[k, j]
    triangularise(array, n, n + 1)
    for i in range(n):
        for j in range(n):
            D[i, j] = array[i, j]


@njit(cache=True, forceinline=True, error_model="numpy")
def innovation_root(x, D, H, i, z, n):  # pragma: no cover
    """Return (z - H_i x, |D' H_i'|^2)."""
    e, spread = z, x.dtype.type(0.0)
    for j in range(n):
        e -= H[i, j] * x[j]
    for k in range(n):
        total = x.dtype.type(0.0)
        for j in range(n):
            total += H[i, j] * D[j, k]
        spread += total * total
    return e, spread


@njit(cache=True, forceinline=True, error_model="numpy")
def project_root(D, H, R, due, G, C, n, n_sensor):  # pragma: no cover
    """Set G = H D, zero for a sensor that is not due, and C lower triangular with C C' = G G' + R."""
    zero = D.dtype.type(0.0)
    for i in range(n_sensor):
        for k in range(n):
            total = zero
            if due[i]:
                for j in range(n):
                    total += H[i, j] * D[j, k]
            G[i, k] = total
    for i in range(n_sensor):
        for m in range(i + 1):
            total = R[i] if m == i else zero
            for k in range(n):
                total += G[i, k] * G[m, k]
            for k in range(m):
                total -= C[i, k] * C[m, k]
            C[i, m] = np.sqrt(total) if m == i else total / C[m, m]


@njit(cache=True, forceinline=True, error_model="numpy")
def gain_root(x, D, H, e, R, due, G, C, K, n, n_sensor):  # pragma: no cover
    """Set K = D G' (C C')^-1 and x = x + K e, all readings at once; a sensor that is not due has e and K zero."""
    zero = x.dtype.type(0.0)
    project_root(D, H, R, due, G, C, n, n_sensor)
    for j in range(n):
        for i in range(n_sensor):
            total = zero
            for k in range(n):
                total += D[j, k] * G[i, k]
            for k in range(i):
                total -= K[j, k] * C[i, k]
            K[j, i] = total / C[i, i]
        for i in range(n_sensor - 1, -1, -1):
            total = K[j, i]
            for k in range(i + 1, n_sensor):
                total -= K[j, k] * C[k, i]
            K[j, i] = total / C[i, i]
        for i in range(n_sensor):
            x[j] += K[j, i] * e[i]


@njit(cache=True, forceinline=True, error_model="numpy")
def update_root(D, G, K, R, due, n, n_sensor):  # noqa: PLR0912  # pragma: no cover
    """Apply the Joseph form D D' = (I - K H)D D'(I - K H)' + K R K', G = H D, by reflections of [(I - K H)D, K R^(1/2)]
    from the right.

    Its null vectors are known, the rows of [-G, R^(1/2)]: one reflection for each reading turns them into the last
    columns, which then are zero. D does not stay triangular; G is used up.
    """
    for i in range(n_sensor):
        if due[i]:
            for j in range(n):
                for k in range(n):
                    D[j, k] -= K[j, i] * G[i, k]
    for i in range(n_sensor):
        if due[i]:
            square, root = R[i], np.sqrt(R[i])
            for k in range(n):
                square += G[i, k] * G[i, k]
            tip = root + np.sqrt(square)
            scale = tip * (tip - root)
            for j in range(n):
                total = K[j, i] * root * tip
                for k in range(n):
                    total -= D[j, k] * G[i, k]
                total /= scale
                for k in range(n):
                    D[j, k] += total * G[i, k]
            for m in range(i + 1, n_sensor):
                total = D.dtype.type(0.0)
                for k in range(n):
                    total += G[m, k] * G[i, k]
                total /= scale
                for k in range(n):
                    G[m, k] -= total * G[i, k]


@njit(cache=True, forceinline=True, error_model="numpy")
def row_square(D, j, n):  # pragma: no cover
    """Return (D D')_jj."""
    total = D.dtype.type(0.0)
    for k in range(n):
        total += D[j, k] * D[j, k]
    return total


@njit(cache=True, forceinline=True, error_model="numpy")
def recall_root(x, D, G, K, R, due, n):  # pragma: no cover
    """Do what `recall` does, to the root D, beyond LOST_VARIANCE and toward 0; G, K, R and due are room for one
    reading.
    """
    spread, most, rate = row_square(D, 0, n), D.dtype.type(LOST_VARIANCE), x[0]
    if not spread > most:
        return
    R[0], due[0] = spread * most / (spread - most), True
    for k in range(n):
        G[0, k] = D[0, k]
    for j in range(n):
        total = x.dtype.type(0.0)
        for k in range(n):
            total += D[j, k] * G[0, k]
        K[j, 0] = total / (spread + R[0])
        x[j] -= K[j, 0] * rate
    update_root(D, G, K, R, due, n, 1)


@njit(cache=True, error_model="numpy")
def coast(x, P, F, Q, reach, work, moved, g, array, G, gain, lost, due, n, core, form, count):  # pragma: no cover
    """Predict `count` steps, as the filters do without a reading: not inlined, so that they need not be a loop."""
    most, zero = x.dtype.type(LOST_VARIANCE), x.dtype.type(0.0)
    for _ in range(count):
        if form == SQUARE_ROOT:
            predict_root(x, P, F, Q, array, moved, n)
            recall_root(x, P, G, gain, lost, due, n)
        elif form == JOSEPH:
            predict(x, P, F, Q, reach, work, moved, n, core)
            recall(x, P, 0, most, zero, g, n)
        else:
            predict_plain(x, P, F, Q, work, moved, n)


@functools.lru_cache
def kalman_kernel(n: int, n_sensor: int, form: int = JOSEPH, n_slow: int = 0) -> Any:  # noqa: PLR0915
    """Return run(x, P, F, Q, H, R, Z, clocked, outside, started, out) -> started, the plain Kalman filter over a block.

    x (n,) and P (n, n) are replaced by the posterior of the last step; in SQUARE_ROOT form P and Q are roots. Z is
    (n_sensor, n_time); `outside` (n_sensor,) counts as in `outside_gate`; `out` (HEADER_ROWS + INNOVATION_ROWS *
    n_sensor, n_time) receives rate, std, and innovation and its variance of each reading.
    """
    states, readings, fast = n, n_sensor, n - n_slow

    @njit(cache=True, error_model="numpy")
    def run(x_in, P_in, F_in, Q_in, H_in, R, Z, clocked, outside, started, out):  # noqa: PLR0912, PLR0915  # pragma: no cover
        n, n_sensor, core = np.int64(states), np.int64(readings), np.int64(fast)
        # The branches on `form` are taken by the compiler.
        # Local copies have a constant shape, so their index arithmetic folds.
        kind = x_in.dtype
        x, moved, g, K = np.empty(n, kind), np.empty(n, kind), np.empty(n, kind), np.empty(n, kind)
        P, F, Q, work = np.empty((n, n), kind), np.empty((n, n), kind), np.empty((n, n), kind), np.empty((n, n), kind)
        H = np.empty((n_sensor, n), kind)
        G, C, gain = np.empty((n_sensor, n), kind), np.empty((n_sensor, n_sensor), kind), np.empty((n, n_sensor), kind)
        array, e, due = np.empty((n, 2 * n), kind), np.empty(n_sensor, kind), np.empty(n_sensor, np.bool_)
        lost = np.empty(1, kind)
        node, share, whole, F_between, Q_between = clocked
        rows = core if form == JOSEPH else n
        x[:], P[:], F[:], Q[:], H[:] = x_in, P_in, F_in, Q_in, H_in
        reach, seen = np.empty((n, 2), np.int64), np.empty((n_sensor, 4), np.int64)
        spans(F, core, n, reach)
        spans(H, 0, core, seen[:, :2])
        spans(H, core, n, seen[:, 2:])
        begin = 0
        while begin < Z.shape[1]:
            stop = Z.shape[1]
            if node.size > 0:
                stop = alike(node, share, whole, begin)
                if started and whole[begin] > 0:
                    between(F, F_between, NODES, 0.0, n, rows)
                    between(Q, Q_between, NODES, 0.0, n, rows)
                    coast(x, P, F, Q, reach, work, moved, g, array, G, gain, lost, due, n, core, form, whole[begin])
                between(F, F_between, node[begin], share[begin], n, rows)
                between(Q, Q_between, node[begin], share[begin], n, rows)
            for k in range(begin, stop):
                if started:
                    if form == SQUARE_ROOT:
                        predict_root(x, P, F, Q, array, moved, n)
                        recall_root(x, P, G, gain, lost, due, n)
                    elif form == JOSEPH:
                        predict(x, P, F, Q, reach, work, moved, n, core)
                        recall(x, P, 0, kind.type(LOST_VARIANCE), kind.type(0.0), g, n)
                    else:
                        predict_plain(x, P, F, Q, work, moved, n)
                read = False
                for i in range(n_sensor):
                    row = HEADER_ROWS + INNOVATION_ROWS * i
                    out[row + INNOVATION, k] = np.nan
                    out[row + INNOVATION_VARIANCE, k] = np.nan
                    due[i] = np.isfinite(Z[i, k])
                    e[i] = kind.type(0.0)
                    if due[i]:
                        if form == SQUARE_ROOT:
                            e[i], spread = innovation_root(x, P, H, i, kind.type(Z[i, k]), n)
                        else:
                            e[i], spread = innovation(x, P, H, seen, i, kind.type(Z[i, k]), g, n, core)
                        outside[i] = outside_gate(outside[i], e[i], spread + R[i])
                        if 0 < outside[i] <= PATIENCE:
                            due[i], e[i] = False, kind.type(0.0)
                            continue
                        read = True
                        out[row + INNOVATION, k] = e[i]
                        out[row + INNOVATION_VARIANCE, k] = spread + R[i]
                if read:
                    started = True
                if form == SQUARE_ROOT:
                    if read:
                        gain_root(x, P, H, e, R, due, G, C, gain, n, n_sensor)
                    # Sent out first: in hardware the covariance has until the next reading.
                    out[RATE, k] = x[0]
                    if read:
                        update_root(P, G, gain, R, due, n, n_sensor)
                    out[STD, k] = np.sqrt(row_square(P, 0, n))
                else:
                    for i in range(n_sensor):
                        if due[i]:
                            if form == JOSEPH:
                                update(x, P, H, seen, i, kind.type(Z[i, k]), R[i], g, K, n, core)
                            else:
                                update_plain(x, P, H, seen, i, kind.type(Z[i, k]), R[i], g, K, n, core)
                    out[RATE, k] = x[0]
                    out[STD, k] = np.sqrt(P[0, 0])
            begin = stop
        x_in[:], P_in[:] = x, P
        return started

    return run


@njit(cache=True, forceinline=True, error_model="numpy")
def still_changing(K, before, share, n, n_sensor):  # pragma: no cover
    """Return whether an element of the gains has changed by more than `share` of itself, and keep them in `before`."""
    changing = False
    for j in range(n):
        for i in range(n_sensor):
            changing = changing or not abs(K[j, i] - before[j, i]) <= share * abs(K[j, i])
            before[j, i] = K[j, i]
    return changing


@njit(cache=True, error_model="numpy")
def coast_toward(x, P, F, Q, reach, work, moved, g, n, core, last, count):  # pragma: no cover
    """Do what `coast` does, believing that the rate does not depart further from its last value than `last` says."""
    for _ in range(count):
        predict(x, P, F, Q, reach, work, moved, n, core)
        recall(x, P, 0, last[1] + last[2], last[0], g, n)


@functools.lru_cache
def settling_kernel(n: int, n_sensor: int, n_slow: int = 0) -> Any:  # noqa: PLR0915
    """Return run(x, P, F, Q, H, R, Z, clocked, cycle, progress, last, granted, out), the Kalman filter until its gains
    have settled, then with those.

    `cycle` = (K, C, settled, before): gains (n_step, n, n_sensor), variance of an innovation (n_step, n_sensor) and
    covariance after the readings (n_step, n, n) of each step of the cycle in which the readings repeat, and the gains
    (n, n_sensor) that the next check compares with. `progress` = [started, step, mode, steps since the last check,
    steps of the cycle kept, steps between checks, which sensors are there], then one count per sensor as in
    `outside_gate`. A reading that is due and missing ends the settled state: the recursion goes on from its covariance
    with the Q of the sensors that are there, Q (2^n_sensor, n, n), bit i for sensor i. `last` = [rate, its variance,
    variance of its departure], of the last reading: with no sensor at all the rate is not believed to go further.
    `granted` (2^n_sensor, order) is the variance of the rate's derivatives that is believed of a signal which those
    sensors could follow. `out` as in `kalman_kernel`. The table Q of `clocked` has one more axis in front, as Q; gains
    never settle where steps are of any length (`progress[EVERY]` is to be out of reach).
    """
    states, readings, fast = n, n_sensor, n - n_slow

    @njit(cache=True, error_model="numpy")
    def run(x_in, P_in, F_in, Q_in, H_in, R, Z, clocked, cycle, progress, last, granted, out):  # noqa: PLR0912, PLR0915  # pragma: no cover
        n, n_sensor, core = np.int64(states), np.int64(readings), np.int64(fast)
        x, moved, e, C = np.empty(n), np.empty(n), np.empty(n_sensor), np.empty(n_sensor)
        P, F, Q, work = np.empty((n, n)), np.empty((n, n)), np.empty((n, n)), np.empty((n, n))
        H, g, gain = np.empty((n_sensor, n)), np.empty(n), np.empty(n)
        # What F and Q hold: the step of that node and share, and the noise of the sensors that are there.
        placed, ending, present = -1, 0.0, -1
        node, share, before_it, F_between, Q_between = clocked
        Q[:] = Q_in[progress[PRESENT]]
        K, C_settled, settled, before = cycle
        x[:], P[:], F[:], H[:] = x_in, P_in, F_in, H_in
        reach, seen = np.empty((n, 2), np.int64), np.empty((n_sensor, 4), np.int64)
        spans(F, core, n, reach)
        spans(H, 0, core, seen[:, :2])
        spans(H, core, n, seen[:, 2:])
        now = np.zeros((n, n_sensor))
        for k in range(Z.shape[1]):
            step = progress[STEP]
            there = progress[PRESENT]
            if progress[STARTED] > 0:
                if node.size > 0:
                    if before_it[k] > 0:
                        between(F, F_between, NODES, 0.0, n, core)
                        between(Q, Q_between[there], NODES, 0.0, n, core)
                        coast_toward(x, P, F, Q, reach, work, moved, g, n, core, last, before_it[k])
                        placed = -1
                    if node[k] != placed or share[k] != ending or there != present:
                        between(F, F_between, node[k], share[k], n, core)
                        between(Q, Q_between[there], node[k], share[k], n, core)
                        placed, ending = node[k], share[k]
                elif present != there:
                    Q[:] = Q_in[there]
                present = there
                move(x, F, reach, moved, n, core)
            if progress[MODE] == SETTLED:
                whole = True
                for i in range(n_sensor):
                    e[i], C[i] = Z[i, k], C_settled[step, i]
                    for j in range(n):
                        e[i] -= H[i, j] * x[j]
                    whole = whole and not np.isinf(Z[i, k]) and not e[i] * e[i] > GATE * GATE * C[i]
                if not whole:
                    progress[MODE] = RECURSION
                    P[:] = settled[step - 1]
            read = progress[MODE] == SETTLED
            if progress[MODE] != SETTLED:
                if progress[STARTED] > 0:
                    grow(P, F, Q, reach, work, n, core)
                    recall(x, P, 0, last[1] + last[2], last[0], g, n)
                for i in range(n_sensor):
                    e[i] = np.nan
                    if np.isinf(Z[i, k]) and progress[PRESENT] >> i & 1:
                        progress[PRESENT] &= ~(1 << i)
                        for j in range(1, granted.shape[1]):
                            recall(x, P, j, granted[progress[PRESENT], j], 0.0, g, n)
                    if np.isfinite(Z[i, k]):
                        progress[PRESENT] |= 1 << i
                        e[i], spread = innovation(x, P, H, seen, i, Z[i, k], g, n, core)
                        C[i] = spread + R[i]
                        progress[COUNTS + i] = outside_gate(progress[COUNTS + i], e[i], C[i])
                        if 0 < progress[COUNTS + i] <= PATIENCE:
                            e[i] = np.nan
                        read = read or np.isfinite(e[i])
                    # Whatever is missing begins the wait for settled gains anew.
                    if np.isinf(Z[i, k]) or (np.isfinite(Z[i, k]) and np.isnan(e[i])):
                        progress[MODE], progress[SINCE], before[:] = RECURSION, 0, 0.0
            for i in range(n_sensor):
                row = HEADER_ROWS + INNOVATION_ROWS * i
                out[row + INNOVATION, k] = e[i]
                out[row + INNOVATION_VARIANCE, k] = C[i] if np.isfinite(e[i]) else np.nan
                for j in range(n):
                    now[j, i] = 0.0
                if not np.isfinite(e[i]):
                    continue
                if progress[MODE] == SETTLED:
                    left = Z[i, k]
                    for j in range(n):
                        left -= H[i, j] * x[j]
                    for j in range(n):
                        x[j] += K[step, j, i] * left
                else:
                    update(x, P, H, seen, i, Z[i, k], R[i], g, gain, n, core)
                    for j in range(n):
                        now[j, i] = gain[j]
            if read:
                progress[STARTED] = 1
            out[RATE, k] = x[0]
            variance = settled[step, 0, 0] if progress[MODE] == SETTLED else P[0, 0]
            out[STD, k] = np.sqrt(variance)
            if read:
                last[0], last[1] = x[0], variance
            if progress[MODE] == RECURSION and progress[STARTED] > 0:
                progress[SINCE] += 1
                if step == 0 and progress[SINCE] > progress[EVERY]:
                    progress[SINCE] = 0
                    if not still_changing(now, before, SETTLED_CHANGE, n, n_sensor):
                        progress[MODE], progress[KEPT] = KEEPING, 0
            if progress[MODE] == KEEPING:
                K[step], settled[step] = now, P
                for i in range(n_sensor):
                    C_settled[step, i] = C[i]
                progress[KEPT] += 1
                if progress[KEPT] == len(K):
                    progress[MODE] = SETTLED
            progress[STEP] = (step + 1) % len(K)
        x_in[:], P_in[:] = x, P

    return run


@njit(cache=True, forceinline=True, error_model="numpy")
def watch_increments(sensor, z):  # pragma: no cover
    """Update N_k / dT by (28)-(30): the mean of half the squared increments, or its fading form."""
    if np.isfinite(sensor.previous_reading):
        sensor.increments += 1
        weight = max(1.0 / sensor.increments, sensor.least_weight)
        step = z - sensor.previous_reading
        sensor.increment_variance += weight * (0.5 * step * step - sensor.increment_variance)
    sensor.previous_reading = z


@njit(cache=True, forceinline=True, error_model="numpy")
def judge_band(sensor):  # pragma: no cover
    """On entering a band of N_k, set R to the band's value; within a band leave R alone."""
    if not sensor.banded or sensor.increments < sensor.wait:
        return
    band = 0
    for level in range(2):
        if sensor.increment_variance >= sensor.thresholds[level]:
            band = level + 1
    if band != sensor.band:
        sensor.band = band
        sensor.R = sensor.levels[band]
        # A band may set R below the floor; then its own value is the floor.
        sensor.lowest = min(sensor.R, max(sensor.floor, sensor.R / sensor.clamp))
        sensor.highest = sensor.R * sensor.clamp


@njit(cache=True, forceinline=True, error_model="numpy")
def inflation(sensor, windows, i, square, C):  # pragma: no cover
    """Return S of (36): max(1, alpha C_hat / C), C_hat the mean (34) of `square` over the last readings."""
    n_window = windows.shape[1]
    at = sensor.window_count % n_window
    sensor.window_sum += square - windows[i, at]
    windows[i, at] = square
    sensor.window_count += 1
    if at == n_window - 1:
        # Once a lap the sum is formed anew: the rounding left by one huge innovation must not stay for ever.
        total = 0.0
        for m in range(n_window):
            total += windows[i, m]
        sensor.window_sum = total
    mean = sensor.window_sum / min(sensor.window_count, n_window)
    return max(1.0, sensor.alpha * mean / C)


@njit(cache=True, forceinline=True, error_model="numpy")
def set_R(sensor, R):  # pragma: no cover
    """Set R within its bounds."""
    if sensor.lowest > R:
        R = sensor.lowest
        sensor.hits += 1
    elif sensor.highest < R:
        R = sensor.highest
        sensor.hits += 1
    sensor.R = R


@njit(cache=True, forceinline=True, error_model="numpy")
def adapt_R(sensor, square, spread):  # pragma: no cover
    """Apply (17), R <- (1 - d)R + d(square - spread) with d = (1 - beta)/(1 - beta^(k+1)), within the bounds of R."""
    sensor.power *= sensor.forget
    d = (1.0 - sensor.forget) / (1.0 - sensor.power)
    set_R(sensor, (1.0 - d) * sensor.R + d * (square - spread))


@njit(cache=True, forceinline=True, error_model="numpy")
def adapt_offset(sensor, e):  # pragma: no cover
    """Apply (16), r <- (1 - d)r + d(z - H x_prior); the innovation `e` has r taken off already."""
    sensor.offset_power *= sensor.forget
    d = (1.0 - sensor.forget) / (1.0 - sensor.offset_power)
    sensor.offset += d * e


@njit(cache=True, forceinline=True, error_model="numpy")
def observe(sensor, e, z):  # pragma: no cover
    """Prepare the use of the reading z with the innovation e (11): N_k, band and R.

    Return the square that stands for e e' in (17) and (34), NaN if there is no difference yet.
    """
    watch_increments(sensor, z)
    judge_band(sensor)
    if sensor.follow and sensor.increments > 0:
        set_R(sensor, sensor.increment_variance)
    return 0.5 * (e - sensor.previous_innovation) ** 2 if sensor.difference else e * e


@njit(cache=True, forceinline=True, error_model="numpy")
def learn(sensor, e, square, spread):  # pragma: no cover
    """Adapt R and r of a sensor after its reading was used."""
    if sensor.adapt_R and np.isfinite(square):
        adapt_R(sensor, square, spread)
    if sensor.adapt_offset:
        adapt_offset(sensor, e)
    sensor.previous_innovation = e


@njit(cache=True, forceinline=True, error_model="numpy")
def adapt_Q(Q, chosen, x, x_prior, P_post, P_prior, d, n):  # pragma: no cover
    """Apply (15) with +P to the chosen diagonal elements of Q; return how many the guard at zero held.

    K e is x - x_prior, and A P_prev A' is P_prior - Q; of P only the diagonal counts.
    """
    hits = 0
    for j in range(n):
        if chosen[j]:
            moved = x[j] - x_prior[j]
            value = Q[j, j] + d * (moved * moved + P_post[j] - P_prior[j])
            if value < 0.0:
                value = 0.0
                hits += 1
            Q[j, j] = value
    return hits


@functools.lru_cache
def adaptive_kernel(n: int, n_sensor: int, form: int = JOSEPH, n_slow: int = 0) -> Any:  # noqa: PLR0915
    """Return run(x, P, F, Q, H, Z, clocked, sensors, windows, chosen, progress, forget, out), the Sage-Husa family over
    a block.

    As `kalman_kernel`, with R and its adaptation in `sensors` (n_sensor,) of dtype SENSOR, the squared innovations of
    the sliding windows in `windows` (n_sensor, n_window), the diagonal elements of Q that adapt in `chosen` (n,), and
    `progress` = [started, beta^k, guard hits of Q]. Q that
    adapts takes regular steps only. What the adaptation remembers is in double precision whatever the arrays are.
    """
    states, readings, fast = n, n_sensor, n - n_slow

    @njit(cache=True, error_model="numpy")
    def run(x_in, P_in, F_in, Q_in, H_in, Z, clocked, sensors, windows, chosen, progress, forget, out):  # noqa: PLR0912, PLR0915  # pragma: no cover
        n, n_sensor, core = np.int64(states), np.int64(readings), np.int64(fast)
        kind = x_in.dtype
        x, x_prior, P_prior, P_post = np.empty(n, kind), np.empty(n, kind), np.empty(n, kind), np.empty(n, kind)
        moved, g, K = np.empty(n, kind), np.empty(n, kind), np.empty(n, kind)
        P, F, Q, work = np.empty((n, n), kind), np.empty((n, n), kind), np.empty((n, n), kind), np.empty((n, n), kind)
        H, due = np.empty((n_sensor, n), kind), np.empty(n_sensor, np.bool_)
        e, spread, R = np.empty(n_sensor, kind), np.empty(n_sensor, kind), np.empty(n_sensor, kind)
        square = np.empty(n_sensor)
        G, C, gain = np.empty((n_sensor, n), kind), np.empty((n_sensor, n_sensor), kind), np.empty((n, n_sensor), kind)
        array, lost = np.empty((n, 2 * n), kind), np.empty(1, kind)
        node, share, whole, F_between, Q_between = clocked
        rows = core if form == JOSEPH else n
        x[:], P[:], F[:], Q[:], H[:] = x_in, P_in, F_in, Q_in, H_in
        reach, seen = np.empty((n, 2), np.int64), np.empty((n_sensor, 4), np.int64)
        spans(F, core, n, reach)
        spans(H, 0, core, seen[:, :2])
        spans(H, core, n, seen[:, 2:])
        adapts_Q = chosen.any()
        begin = 0
        while begin < Z.shape[1]:
            stop = Z.shape[1]
            if node.size > 0:
                stop = alike(node, share, whole, begin)
                if progress[0] > 0.0 and whole[begin] > 0:
                    between(F, F_between, NODES, 0.0, n, rows)
                    between(Q, Q_between, NODES, 0.0, n, rows)
                    coast(x, P, F, Q, reach, work, moved, g, array, G, gain, lost, due, n, core, form, whole[begin])
                between(F, F_between, node[begin], share[begin], n, rows)
                between(Q, Q_between, node[begin], share[begin], n, rows)
            for k in range(begin, stop):
                predicted = progress[0] > 0.0
                if predicted:
                    if form == SQUARE_ROOT:
                        predict_root(x, P, F, Q, array, moved, n)
                        recall_root(x, P, G, gain, lost, due, n)
                    elif form == JOSEPH:
                        predict(x, P, F, Q, reach, work, moved, n, core)
                        recall(x, P, 0, kind.type(LOST_VARIANCE), kind.type(0.0), g, n)
                    else:
                        predict_plain(x, P, F, Q, work, moved, n)
                read = False
                for i in range(n_sensor):
                    row = ADAPTIVE_HEADER_ROWS + ADAPTIVE_ROWS * i
                    for m in range(ADAPTIVE_ROWS):
                        out[row + m, k] = np.nan
                    due[i] = np.isfinite(Z[i, k])
                    e[i], R[i] = kind.type(0.0), kind.type(1.0)
                    if not due[i]:
                        continue
                    z = kind.type(Z[i, k] - sensors[i].offset)
                    if form == SQUARE_ROOT:
                        e[i], spread[i] = innovation_root(x, P, H, i, z, n)
                    else:
                        e[i], spread[i] = innovation(x, P, H, seen, i, z, g, n, core)
                    sensors[i].outside = outside_gate(sensors[i].outside, e[i], spread[i] + sensors[i].R)
                    if 0 < sensors[i].outside <= PATIENCE:
                        due[i], e[i] = False, kind.type(0.0)
                        continue
                    read = True
                    square[i], factor = observe(sensors[i], e[i], Z[i, k]), 1.0
                    if sensors[i].alpha != 0.0 and np.isfinite(square[i]):
                        factor = inflation(sensors[i], windows, i, square[i], spread[i] + sensors[i].R)
                    R[i] = factor * sensors[i].R
                    out[row + INNOVATION, k], out[row + INNOVATION_VARIANCE, k] = e[i], spread[i] + sensors[i].R
                    out[row + R_USED, k], out[row + INFLATION, k] = sensors[i].R, factor
                    if sensors[i].increments > 0:
                        out[row + INCREMENTS, k] = sensors[i].increment_variance
                    if sensors[i].band >= 0:
                        out[row + BAND, k] = sensors[i].band
                if adapts_Q:
                    for j in range(n):
                        x_prior[j] = x[j]
                        P_prior[j] = row_square(P, j, n) if form == SQUARE_ROOT else P[j, j]
                if form == SQUARE_ROOT and read:
                    gain_root(x, P, H, e, R, due, G, C, gain, n, n_sensor)
                    # Sent out first: in hardware the covariance has until the next reading.
                    out[RATE, k] = x[0]
                    update_root(P, G, gain, R, due, n, n_sensor)
                hits = 0
                for i in range(n_sensor):
                    if due[i]:
                        z = kind.type(Z[i, k] - sensors[i].offset)
                        if form == JOSEPH:
                            update(x, P, H, seen, i, z, R[i], g, K, n, core)
                        elif form == CONVENTIONAL:
                            update_plain(x, P, H, seen, i, z, R[i], g, K, n, core)
                        learn(sensors[i], e[i], square[i], spread[i])
                    elif not np.isnan(Z[i, k]):
                        sensors[i].previous_innovation = np.nan
                        sensors[i].previous_reading = np.nan
                    hits += sensors[i].hits
                if read and predicted and adapts_Q:
                    progress[1] *= forget
                    d = (1.0 - forget) / (1.0 - progress[1])
                    for j in range(n):
                        P_post[j] = row_square(P, j, n) if form == SQUARE_ROOT else P[j, j]
                        # Q is diagonal here, and so is its root.
                        if form == SQUARE_ROOT:
                            Q[j, j] = Q[j, j] * Q[j, j]
                    progress[2] += adapt_Q(Q, chosen, x, x_prior, P_post, P_prior, d, n)
                    if form == SQUARE_ROOT:
                        for j in range(n):
                            Q[j, j] = np.sqrt(Q[j, j])
                if read:
                    progress[0] = 1.0
                out[RATE, k] = x[0]
                out[STD, k] = np.sqrt(row_square(P, 0, n) if form == SQUARE_ROOT else P[0, 0])
                out[Q_RATE, k] = row_square(Q, 0, n) if form == SQUARE_ROOT else Q[0, 0]
                out[GUARD_HITS, k] = hits + progress[2]
            begin = stop
        x_in[:], P_in[:] = x, P
        if adapts_Q:
            Q_in[:] = Q

    return run


@functools.lru_cache
def gains_kernel(n: int, n_sensor: int, n_slow: int = 0) -> Any:
    """Return run(P, F, Q, H, R, due, started, gains, variance, std) -> widest, the covariance of `kalman_kernel`
    without any reading.

    P (n, n), in Joseph form, is replaced; `due` (n_sensor, n_time) says which readings there are. `gains` (n_time,
    n_sensor, n), `variance` (n_time, n_sensor) of the innovations and `std` (n_time,) of the rate are filled where
    there are some. Many states with the same gaps share them, as long as the rate is not recalled: `widest` is its
    largest variance before a reading [rad^2/s^2].
    """
    states, readings, fast = n, n_sensor, n - n_slow

    @njit(cache=True, error_model="numpy")
    def run(P_in, F_in, Q_in, H_in, R, due, started, gains, variance, std):  # pragma: no cover
        n, n_sensor, core = np.int64(states), np.int64(readings), np.int64(fast)
        # No reading enters the covariance: a state and readings of zero stand for all.
        x, moved, g, K = np.zeros(n), np.empty(n), np.empty(n), np.empty(n)
        P, F, Q, work, H = (
            np.empty((n, n)),
            np.empty((n, n)),
            np.empty((n, n)),
            np.empty((n, n)),
            np.empty((n_sensor, n)),
        )
        P[:], F[:], Q[:], H[:] = P_in, F_in, Q_in, H_in
        reach, seen = np.empty((n, 2), np.int64), np.empty((n_sensor, 4), np.int64)
        spans(F, core, n, reach)
        spans(H, 0, core, seen[:, :2])
        spans(H, core, n, seen[:, 2:])
        widest = 0.0
        for k in range(std.size):
            if started:
                predict(x, P, F, Q, reach, work, moved, n, core)
                widest = max(widest, P[0, 0])
            for i in range(n_sensor):
                if due[i, k]:
                    variance[k, i] = innovation(x, P, H, seen, i, 0.0, g, n, core)[1] + R[i]
                    started = True
            for i in range(n_sensor):
                if due[i, k]:
                    update(x, P, H, seen, i, 0.0, R[i], g, K, n, core)
                    for j in range(n):
                        gains[k, i, j] = K[j]
            std[k] = np.sqrt(P[0, 0])
        P_in[:] = P
        return widest

    return run
