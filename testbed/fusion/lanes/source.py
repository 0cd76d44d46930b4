"""Straight-line source of the kernels of lanes, which the compiler turns into vector instructions.

Everything that a lane has stands in one array W (n_row, LANES), one row per number, and the innermost loop runs over
the lanes. States, covariance and matrices are plain variables in it, zeros of F and H left out: no index to compute, no
array that could be another one. Readings and estimates, which each lane has in an array of its own, stand lane beside
lane while they are worked on, a part of the block at a time that stays in the processor's nearest cache.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

# Lanes of a pack: two vectors of eight. What is left of a pack is padded.
LANES = 16
# A reading that many standard deviations off fires the gate, as in `testbed.fusion.kernels.covariance`.
GATE = 1000.0
# What a lane remembers of a sensor, in this order; see `testbed.fusion.kernels.covariance.SENSOR`.
MEMORY = ("R", "lowest", "highest", "hits", "innovation", "reading", "increment", "window", "band")
# Steps that are worked on at a time: a number of each lane takes 32 kB for them.
PART = 256
_HEAD = f"""\
from math import sqrt

import numpy as np
from numba import njit


@njit(cache=True, forceinline=True, error_model="numpy")
def first_of(due):
    for k in range(due.size):
        if due[k]:
            return k
    return due.size


@njit(cache=True, forceinline=True, error_model="numpy")
def spread(Z, i, begin, n, first, stride, z):
    for s in range({LANES}):
        own = Z[s]
        for k in range(first, n, stride):
            z[k, s] = own[i, begin + k]


@njit(cache=True, forceinline=True, error_model="numpy")
def collect(part, first, stride, found):
    for s in range(found.shape[0]):
        for k in range(first, found.shape[1], stride):
            found[s, k] = part[k, s]


@njit(cache=True, error_model="numpy")
def part(%s):
"""
_RUN = """

@njit(cache=True, error_model="numpy")
def run({matrices}, W, {given}, due, started, Z, {found}):
    one, each = ({PART}, {LANES}), (due.shape[0], {PART}, {LANES})
    z = np.empty(each)
{rooms}
    for s in range({LANES}):
        {worst} = 0.0
    for begin in range(0, due.shape[1], {PART}):
        end = min(begin + {PART}, due.shape[1])
{spreads}
        started = part({matrices}, W, {sliced}, due[:, begin:end], started, z, {parts})
{collects}
"""


@dataclass(frozen=True)
class Pattern:
    """Where the matrices of a model are not zero, and when it is read.

    Parameters
    ----------
    F, H : tuple of tuple of int
        Columns that are not zero, by row.
    strides : tuple of int
        Steps between two readings of each sensor.
    """

    F: tuple[tuple[int, ...], ...]
    H: tuple[tuple[int, ...], ...]
    strides: tuple[int, ...]

    @property
    def n(self) -> int:
        """Number of states."""
        return len(self.F)


@dataclass
class Workspace:
    """Rows of W by name, in the order in which they were asked for.

    Parameters
    ----------
    names : list of str
        Their names.
    """

    names: list[str] = field(default_factory=list)

    def at(self, name: str) -> str:
        """Return the element of a row in the present lane."""
        if name not in self.names:
            self.names.append(name)
        return f"W[{LANES * self.names.index(name)} + s]"


def state_names(n: int) -> list[str]:
    """Return the rows of the states.

    Parameters
    ----------
    n : int
        How many.
    """
    return [f"x{i}" for i in range(n)]


def covariance_names(n: int) -> list[str]:
    """Return the rows of the lower half of P, row after row.

    Parameters
    ----------
    n : int
        States.
    """
    return [_p(i, j) for i in range(n) for j in range(i + 1)]


def memory_names(n_sensor: int) -> list[str]:
    """Return the rows of what a lane remembers of its sensors, one sensor after the other.

    Parameters
    ----------
    n_sensor : int
        Sensors.
    """
    return [f"{name}_{i}" for i in range(n_sensor) for name in MEMORY]


def shared_source(pattern: Pattern) -> tuple[str, list[str]]:
    """Return the source of run(F, H, W, gains, variance, due, started, Z, rate, innovation), and the rows of its W.

    States of lanes that share one covariance: `gains` (n_time, n_sensor, n) and `variance` (n_time, n_sensor) belong to
    the readings that are `due` (n_sensor, n_time). Z are LANES arrays (n_sensor, n_time), `innovation` is (n_lane,
    n_sensor, n_time), `rate` (n_lane, n_time), for as many of the first lanes as are wanted. The row ``worst`` holds
    the largest squared innovation over that of the gate.

    Parameters
    ----------
    pattern : Pattern
        Of F and H.
    """
    n, rows = pattern.n, Workspace(state_names(pattern.n))
    sensors = range(len(pattern.H))
    text = _HEAD % "F, H, W, gains, variance, due, started, Z, rate, innovation"
    lines = [
        *_matrices(pattern),
        "    for k in range(due.shape[1]):",
        "        if started:",
        *_lanes(12, _move(pattern, rows)),
    ]
    for i in sensors:
        read = [f"{rows.at(f'z{i}')} = Z[{i}, k, s]"]
        e = [
            *_load(rows, state_names(n)),
            f"e = {rows.at(f'z{i}')}{_seen(pattern, i)}",
            f"innovation[{i}, k, s] = e",
            f"{rows.at('worst')} = max({rows.at('worst')}, e * e * scale)",
        ]
        lines += [f"        if due[{i}, k]:", "            started = True", *_lanes(12, read)]
        lines += [f"            scale = {1.0 / GATE**2!r} / variance[k, {i}]", *_lanes(12, e)]
    for i in sensors:
        gains = [f"            k{j} = gains[k, {i}, {j}]" for j in range(n)]
        use = [*_load(rows, state_names(n)), f"e = {rows.at(f'z{i}')}{_seen(pattern, i)}"]
        use += [f"{rows.at(f'x{j}')} = x{j} + k{j} * e" for j in range(n)]
        lines += [f"        if due[{i}, k]:", *gains, *_lanes(12, use)]
    lines += [*_lanes(8, [f"rate[k, s] = {rows.at('x0')}"]), "    return started"]
    run = _in_parts(pattern, "F, H", {"gains": True, "variance": True}, {"rate": False, "innovation": True}, rows)
    return text + "\n".join(lines) + run, rows.names


def adaptive_source(pattern: Pattern) -> tuple[str, list[str]]:
    """Return the source of run(F, Q, H, W, windows, common, seen, due, started, Z, rate, std, innovation, variance),
    and the rows of its W.

    The Sage-Husa family with R that adapts, a covariance per lane in Joseph form. `windows` (n_sensor, n_window, LANES)
    holds the squared innovations of the sliding windows, `common` (n_sensor,) one SENSOR record per sensor with what
    all lanes have in common, `seen` (n_sensor,) how many readings there were. Z are LANES arrays (n_sensor, n_time),
    `innovation` and its `variance` are (n_lane, n_sensor, n_time), `rate` and `std` (n_lane, n_time), for as many of
    the first lanes as are wanted.

    Parameters
    ----------
    pattern : Pattern
        Of F and H.
    """
    n, n_sensor = pattern.n, len(pattern.H)
    rows = Workspace([*state_names(n), *covariance_names(n), *memory_names(n_sensor)])
    text = _HEAD % "F, Q, H, W, windows, common, seen, due, started, Z, rate, std, innovation, variance"
    lines = [*_matrices(pattern), *(f"    q{i}_{j} = Q[{i}, {j}]" for i in range(n) for j in range(i + 1))]
    lines += ["    n_window = windows.shape[1]", "    for k in range(due.shape[1]):", "        if started:"]
    lines += _lanes(12, [*_move(pattern, rows), *_grow(pattern, rows)])
    for i in range(n_sensor):
        lines += [f"        if due[{i}, k]:", "            started = True", *_observe(pattern, rows, i)]
    for i in range(n_sensor):
        lines += [f"        if due[{i}, k]:", *_use(pattern, rows, i)]
    lines += _lanes(8, [f"rate[k, s] = {rows.at('x0')}", f"std[k, s] = sqrt({rows.at(_p(0, 0))})"])
    found = {"rate": False, "std": False, "innovation": True, "variance": True}
    run = _in_parts(pattern, "F, Q, H", {"windows": False, "common": False, "seen": False}, found, rows)
    return text + "\n".join([*lines, "    return started"]) + run, rows.names


def _in_parts(
    pattern: Pattern, matrices: str, given: Mapping[str, bool], found: Mapping[str, bool], rows: Workspace
) -> str:
    """Return run, which works on a block part by part; of `given` those that are true begin with the time, of `found`
    those that are true are there for each sensor.
    """
    rooms = [f"    part_{name} = np.empty({'each' if each else 'one'})" for name, each in found.items()]
    spreads, collects = [], []
    for i, stride in enumerate(pattern.strides):
        spreads.append(f"        first{i} = first_of(due[{i}, begin:end])")
        spreads.append(f"        spread(Z, {i}, begin, end - begin, first{i}, {stride}, z[{i}])")
    for name, each in found.items():
        if not each:
            collects.append(f"        collect(part_{name}, 0, 1, {name}[:, begin:end])")
            continue
        collects += [
            f"        collect(part_{name}[{i}], first{i}, {stride}, {name}[:, {i}, begin:end])"
            for i, stride in enumerate(pattern.strides)
        ]
    return _RUN.format(
        matrices=matrices,
        given=", ".join(given),
        sliced=", ".join(f"{name}[begin:end]" if timed else name for name, timed in given.items()),
        found=", ".join(found),
        parts=", ".join(f"part_{name}" for name in found),
        rooms="\n".join(rooms),
        spreads="\n".join(spreads),
        collects="\n".join(collects),
        worst=rows.at("worst"),
        PART=PART,
        LANES=LANES,
    )


def _p(i: int, j: int) -> str:
    return f"p{max(i, j)}_{min(i, j)}"


def _lanes(indent: int, body: Iterable[str]) -> list[str]:
    """Return a loop over the lanes."""
    return [f"{' ' * indent}for s in range({LANES}):", *(f"{' ' * indent}    {line}" for line in body)]


def _load(rows: Workspace, names: Iterable[str]) -> Iterator[str]:
    return (f"{name} = {rows.at(name)}" for name in names)


def _matrices(pattern: Pattern) -> Iterator[str]:
    """Yield F and H as plain variables."""
    for name, matrix in (("f", pattern.F), ("h", pattern.H)):
        for i, row in enumerate(matrix):
            yield from (f"    {name}{i}_{j} = {name.upper()}[{i}, {j}]" for j in row)


def _sum(terms: Iterable[str]) -> str:
    return " + ".join(terms) or "0.0"


def _seen(pattern: Pattern, i: int) -> str:
    """Return - H_i x, term by term."""
    return "".join(f" - h{i}_{j} * x{j}" for j in pattern.H[i])


def _move(pattern: Pattern, rows: Workspace) -> list[str]:
    """Return x = F x."""
    moved = [f"{rows.at(f'x{i}')} = {_sum(f'f{i}_{j} * x{j}' for j in row)}" for i, row in enumerate(pattern.F)]
    return [*_load(rows, state_names(pattern.n)), *moved]


def _grow(pattern: Pattern, rows: Workspace) -> list[str]:
    """Return P = F P F' + Q."""
    n, lines = pattern.n, list(_load(rows, covariance_names(pattern.n)))
    lines += [f"w{i}_{j} = {_sum(f'f{i}_{m} * {_p(m, j)}' for m in pattern.F[i])}" for i in range(n) for j in range(n)]
    lines += [
        f"{rows.at(_p(i, j))} = q{i}_{j} + {_sum(f'w{i}_{m} * f{j}_{m}' for m in pattern.F[j])}"
        for i in range(n)
        for j in range(i + 1)
    ]
    return lines


def _project(pattern: Pattern, i: int) -> list[str]:
    """Return g = P H_i' and its innovation's spread."""
    g = [f"g{j} = {_sum(f'h{i}_{m} * {_p(m, j)}' for m in pattern.H[i])}" for j in range(pattern.n)]
    return [*g, f"spread = {_sum(f'h{i}_{j} * g{j}' for j in pattern.H[i])}"]


def _observe(pattern: Pattern, rows: Workspace, i: int) -> list[str]:
    """Return what `covariance.observe` does: N_k, band, R in force, S, before any reading of the instant is used."""
    memory = {name: rows.at(f"{name}_{i}") for name in MEMORY}
    z, one = rows.at(f"z{i}"), f"common[{i}]"
    scalars = [
        f"one = {one}",
        f"fresh = seen[{i}] > 0",
        "if fresh:",
        "    one.increments += 1",
        "weight = max(1.0 / max(one.increments, 1), one.least_weight) if fresh else 0.0",
        "judged = one.banded and one.increments >= one.wait",
        "valid = fresh or not one.difference",
        "half, whole = (0.5, 1.0) if one.difference else (1.0, 0.0)",
        "low, high = one.thresholds[0], one.thresholds[1]",
        "level0, level1, level2 = one.levels[0], one.levels[1], one.levels[2]",
        "floor, clamp = one.floor, one.clamp",
    ]
    lines = [f"            {line}" for line in scalars]
    lines += _lanes(12, [f"{z} = Z[{i}, k, s]"])
    body = [
        *_load(rows, [*state_names(pattern.n), *covariance_names(pattern.n)]),
        *_project(pattern, i),
        f"e = {z}{_seen(pattern, i)}",
        f"R = {memory['R']}",
        f"{rows.at('worst')} = max({rows.at('worst')}, {1.0 / GATE**2!r} * e * e / (spread + R))",
        f"step = {z} - ({memory['reading']} if fresh else {z})",
        f"increment = {memory['increment']} + weight * (0.5 * step * step - {memory['increment']})",
        f"{memory['reading']} = {z}",
        f"{memory['increment']} = increment",
        "band = (1.0 if increment >= low else 0.0) + (1.0 if increment >= high else 0.0)",
        "level = level0 if increment < low else level1",
        "level = level if increment < high else level2",
        f"moved = judged and band != {memory['band']}",
        "R = level if moved else R",
        f"{memory['R']} = R",
        f"{memory['lowest']} = min(R, max(floor, R / clamp)) if moved else {memory['lowest']}",
        f"{memory['highest']} = R * clamp if moved else {memory['highest']}",
        f"{memory['band']} = band if moved else {memory['band']}",
        f"before = {memory['innovation']} if fresh else 0.0",
        "square = e - whole * before",
        f"{rows.at(f'square{i}')} = half * square * square",
        f"{rows.at(f'spread{i}')} = spread",
        f"{rows.at(f'used{i}')} = R",
        f"{memory['innovation']} = e",
        f"innovation[{i}, k, s] = e",
        f"variance[{i}, k, s] = spread + R",
    ]
    lines += _lanes(12, body)
    total, square = memory["window"], rows.at(f"square{i}")
    slide = [
        f"{total} = {total} + ({square} - windows[{i}, at, s])",
        f"windows[{i}, at, s] = {square}",
    ]
    scale = [
        f"mean = {total} / n_seen",
        f"C = {rows.at(f'spread{i}')} + {memory['R']}",
        f"{rows.at(f'used{i}')} = {rows.at(f'used{i}')} * max(1.0, alpha * mean / C)",
    ]
    lines += [
        "            if one.alpha != 0.0 and valid:",
        "                alpha, at = one.alpha, one.window_count % n_window",
        "                one.window_count += 1",
        "                n_seen = float(min(one.window_count, n_window))",
        *_lanes(16, slide),
        "                if at == n_window - 1:",
        *_lanes(20, [f"{total} = 0.0"]),
        "                    for b in range(n_window):",
        *_lanes(24, [f"{total} = {total} + windows[{i}, b, s]"]),
        *_lanes(16, scale),
    ]
    return lines


def _use(pattern: Pattern, rows: Workspace, i: int) -> list[str]:
    """Return what `covariance.update` and `covariance.learn` do: the reading is used, then R adapts."""
    n, memory = pattern.n, {name: rows.at(f"{name}_{i}") for name in MEMORY}
    pairs = [(a, b) for a in range(n) for b in range(n)]
    body = [
        *_load(rows, [*state_names(n), *covariance_names(n)]),
        *_project(pattern, i),
        f"R = {rows.at(f'used{i}')}",
        f"e = {rows.at(f'z{i}')}{_seen(pattern, i)}",
        "C = spread + R",
        *(f"k{j} = g{j} / C" for j in range(n)),
        *(f"{rows.at(f'x{j}')} = x{j} + k{j} * e" for j in range(n)),
        *(f"a{a}_{b} = {_p(a, b)} - k{a} * g{b}" for a, b in pairs),
        *(f"t{j} = {_sum(f'h{i}_{m} * a{m}_{j}' for m in pattern.H[i])} - R * k{j}" for j in range(n)),
        *(f"{rows.at(_p(a, b))} = a{a}_{b} - t{a} * k{b}" for a, b in pairs if b <= a),
    ]
    learn = [
        f"R = (1.0 - d) * {memory['R']} + d * ({rows.at(f'square{i}')} - {rows.at(f'spread{i}')})",
        f"below, above = R < {memory['lowest']}, R > {memory['highest']}",
        f"{memory['hits']} = {memory['hits']} + (1.0 if below or above else 0.0)",
        f"R = {memory['lowest']} if below else R",
        f"{memory['R']} = {memory['highest']} if above and not below else R",
    ]
    return [
        *_lanes(12, body),
        f"            one = common[{i}]",
        f"            if one.adapt_R and (not one.difference or seen[{i}] > 0):",
        "                one.power *= one.forget",
        "                d = (1.0 - one.forget) / (1.0 - one.power)",
        *_lanes(16, learn),
        f"            seen[{i}] += 1",
    ]
