"""Source of a step of many covariances side by side, each a lane: what filters share that read the same sensors at the
same instants.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from testbed.fusion.lanes.source import (
    Pattern,
    Workspace,
    added,
    covariance_names,
    entry,
    function,
    load,
    matrices_of,
    over_lanes,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

# What a covariance has beside its gains, of each sensor: the spread that the gate sees, then of the innovation as it is
# used the standard deviation and the logarithm of the variance.
OF_READING = ("spread", "root", "logarithm")


def covariance_rows(pattern: Pattern, n_slow: int) -> Workspace:
    """Return the rows of a covariance: its lower half, the noise of the states before those of slow noise, and what a
    reading leaves.

    Parameters
    ----------
    pattern : Pattern
        Of F and H.
    n_slow : int
        States of slow noise, the last ones.
    """
    n = pattern.n
    left = [*(f"g{j}" for j in range(n)), *(f"k{j}" for j in range(n)), "spread"]
    return Workspace([*covariance_names(n), *noise_names(n - n_slow), *left])


def covariance_functions(pattern: Pattern, n_slow: int) -> list[str]:
    """Return the functions of advance_covariances(C, G, live, F, common, H, R, due, started) -> the largest variance of
    a rate [rad^2/s^2].

    A step of the covariances C (n_pack, n_row * LANES), of packs in which some are `live`, to the bit what the kernels
    of `testbed.fusion.kernels.bank` do in Joseph form; the noise of the last states is `common` (n, n). Of those
    readings that are `due` (n_sensor,), G (n_pack * LANES, n_shown) has what `shown_names` lists.

    Parameters
    ----------
    pattern : Pattern
        Of F and H.
    n_slow : int
        States of slow noise, the last ones.
    """
    rows, core = covariance_rows(pattern, n_slow), pattern.n - n_slow
    of_sensors = [part(pattern, rows, i, core) for i in range(len(pattern.H)) for part in (_innovate, _use)]
    shown = shown_names(pattern)
    return [_grow(pattern, rows, core), *of_sensors, _keep(pattern, rows, shown), _advance(pattern, rows, shown)]


def noise_names(core: int) -> list[str]:
    """Return the rows of the lower half of Q, row after row.

    Parameters
    ----------
    core : int
        States before those of slow noise.
    """
    return [f"q{i}_{j}" for i in range(core) for j in range(i + 1)]


def as_argument(value: int) -> str:
    """Return a number as an argument: a bare one would be part of the type, and the function compiled for each.

    Two processes that compile a function for different types at the same time may also take each other's code from
    numba's disk cache.

    Parameters
    ----------
    value : int
        The number.
    """
    return f"np.int64({value})"


def shown_names(pattern: Pattern) -> list[str]:
    """Return what filters look at of a covariance: the variance of the rate, and of each sensor gains and `OF_READING`.

    Parameters
    ----------
    pattern : Pattern
        Of F and H.
    """
    names = (*(f"k{j}" for j in range(pattern.n)), *OF_READING)
    return ["own", *(f"{name}_{i}" for i in range(len(pattern.H)) for name in names)]


def _grow(pattern: Pattern, rows: Workspace, core: int) -> str:
    """Return what `testbed.fusion.kernels.bank.predict_half` does to covariances."""
    n = pattern.n
    lines = list(matrices_of(Pattern(pattern.F, (), ())))
    lines += [f"    common{i}_{j} = common[{i}, {j}]" for i in range(core, n) for j in range(i + 1)]
    lines += [f"    both{i}_{j} = F[{i}, {i}] * F[{j}, {j}]" for i in range(core, n) for j in range(core, i + 1)]
    body = list(load(rows, [*covariance_names(n), *noise_names(core)]))
    for i in range(core):
        body += [f"w{i}_{j} = {added(f'f{i}_{k} * {entry(k, j)}' for k in pattern.F[i])}" for j in range(n)]
    for i in range(core):
        for j in range(i + 1):
            sums = (f"q{i}_{j}", *(f"f{j}_{k} * w{i}_{k}" for k in pattern.F[j]))
            body += [f"{rows.at(entry(i, j))} = {added(sums)}"]
    for i in range(core, n):
        body += [f"{rows.at(entry(i, j))} = common{i}_{j} + f{i}_{i} * w{j}_{i}" for j in range(core)]
        body += [f"{rows.at(entry(i, j))} = common{i}_{j} + both{i}_{j} * {entry(i, j)}" for j in range(core, i + 1)]
    return function("grow(W, F, common)", [*lines, *over_lanes(4, body)])


def _seen(pattern: Pattern, i: int) -> list[str]:
    return [f"    h{i}_{j} = H[{j}]" for j in pattern.H[i]]


def _innovate(pattern: Pattern, rows: Workspace, i: int, _core: int) -> str:
    """Return what `innovate_half` does to covariances."""
    needed = {entry(k, j) for k in pattern.H[i] for j in range(pattern.n)}
    body = list(load(rows, sorted(needed)))
    body += [f"g{j} = {added(f'h{i}_{k} * {entry(k, j)}' for k in pattern.H[i])}" for j in range(pattern.n)]
    body += [f"{rows.at(f'g{j}')} = g{j}" for j in range(pattern.n)]
    body += [f"{rows.at('spread')} = {added(f'h{i}_{k} * g{k}' for k in pattern.H[i])}"]
    return function(f"innovate{i}(W, H)", [*_seen(pattern, i), *over_lanes(4, body)])


def _use(pattern: Pattern, rows: Workspace, i: int, core: int) -> str:
    """Return what `update_half` does to covariances."""
    n, R = pattern.n, f"R{i}"
    half = [(j, k) for j in range(n) for k in range(j + 1)]
    # Among slow noise a reading changes so little that its rounding needs no second look.
    second = {(j, k): f" - t{j} * k{k}" for j, k in half if k < core}
    body = [
        *load(rows, [*covariance_names(n), *(f"g{j}" for j in range(n))]),
        f"C = 1.0 / ({rows.at('spread')} + {R})",
        *(f"k{j} = g{j} * C" for j in range(n)),
        *(f"{rows.at(f'k{j}')} = k{j}" for j in range(n)),
        *(f"{entry(j, k)} = {entry(j, k)} - k{j} * g{k}" for j, k in half),
        *(f"t{j} = {added(f'h{i}_{k} * {entry(k, j)}' for k in pattern.H[i])} - {R} * k{j}" for j in range(n)),
        *(f"{rows.at(entry(j, k))} = {entry(j, k)}{second.get((j, k), '')}" for j, k in half),
    ]
    return function(f"use{i}(W, H, {R})", [*_seen(pattern, i), *over_lanes(4, body)])


def _keep(pattern: Pattern, rows: Workspace, shown: Sequence[str]) -> str:
    """Return what puts there what the filters look at."""
    first, width, spread = shown.index("k0_0"), pattern.n + len(OF_READING), rows.names.index("spread")
    root, logarithm = (pattern.n + OF_READING.index(name) for name in ("root", "logarithm"))
    lines = [
        "    for c in range(LANES):",
        f"        g = G[c, {first} + {width} * i :]",
        f"        for j in range({pattern.n}):",
        f"            g[j] = W[({rows.names.index('k0')} + j) * LANES + c]",
        f"        variance = W[{spread} * LANES + c] + R",
        f"        g[{root}], g[{logarithm}] = np.sqrt(variance), np.log(variance)",
        f"        G[c, {shown.index('own')}] = W[c]",
    ]
    return function("keep(W, G, i, R)", lines)


def _advance(pattern: Pattern, rows: Workspace, shown: Sequence[str]) -> str:
    """Return the step of all of them."""
    spread, sensors = rows.names.index("spread"), range(len(pattern.H))
    body = ["w, g, fresh = C[p], G[LANES * p : LANES * (p + 1)], -1"]
    body += ["if started:", "    grow(w, F, common)", "    for c in range(LANES):", "        lost = max(lost, w[c])"]
    for i in sensors:
        body += [f"if due[{i}]:", f"    innovate{i}(w, H[{i}])", f"    fresh = {i}", "    for c in range(LANES):"]
        body += [f"        g[c, {shown.index(f'spread_{i}')}] = w[{spread} * LANES + c]"]
    for i in sensors:
        body += [f"if due[{i}]:", f"    if fresh != {i}:", f"        innovate{i}(w, H[{i}])", "    fresh = -1"]
        body += [f"    use{i}(w, H[{i}], R[{i}])", f"    keep(w, g, {as_argument(i)}, R[{i}])"]
    head = ["    lost = 0.0", "    for p in range(live.size):", "        if live[p] > 0:"]
    lines = [*head, *(f"            {line}" for line in body), "    return lost"]
    return function("advance_covariances(C, G, live, F, common, H, R, due, started)", lines)
