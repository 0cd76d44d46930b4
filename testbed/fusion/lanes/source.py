"""Straight-line source of the kernels of lanes, which the compiler turns into vector instructions: what they share.

Everything that a lane has stands in one array W (n_row, LANES), one row per number, and the innermost loop runs over
the lanes. States, covariance and matrices are plain variables in it, zeros of F and H left out: no index to compute, no
array that could be another one. Readings and estimates, which each lane has in an array of its own, stand lane beside
lane while they are worked on, a part of the block at a time that stays in the processor's nearest cache.
"""

from __future__ import annotations

import hashlib
import inspect
import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from testbed.fusion.lanes import moving

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

# Lanes of a pack: two vectors of eight. What is left of a pack is padded.
LANES = 16
# A reading that many standard deviations off fires the gate, as in `testbed.fusion.kernels.covariance`.
GATE = 1000.0
# What a lane remembers of a sensor, in this order; see `testbed.fusion.kernels.covariance.SENSOR`.
MEMORY = ("R", "lowest", "highest", "hits", "innovation", "reading", "increment", "window", "band")
# Steps that are worked on at a time: a number of each lane takes 32 kB for them.
PART = 256
# Numba's disk cache watches the generated file alone, so that this changes with what it calls, too.
HEAD = f"""\
from math import sqrt

import numpy as np
from numba import njit

from testbed.fusion.lanes.moving import collect, first_of, spread

# {hashlib.sha256(inspect.getsource(moving).encode()).hexdigest()}


@njit(cache=True, error_model="numpy")
def part(%s):
"""
# Before the first reading nothing moves: a step of its own, by the matrices of standing still.
_RUN = """

@njit(cache=True, error_model="numpy")
def run({matrices}, W, {given}, due, started, Z, {found}):
    one, each = ({PART}, {LANES}), (due.shape[0], {PART}, {LANES})
    z = np.empty(each)
{rooms}
{still}
    for s in range({LANES}):
        {beyond} = 0.0
    begin = 0
    while begin < due.shape[1]:
        end = min(begin + ({PART} if started else 1), due.shape[1])
{moving}
{spreads}
        part({stepped}, W, {sliced}, due[:, begin:end], z, {parts})
{collects}
        started, begin = started or due[:, begin].any(), end
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

    @property
    def together(self) -> list[tuple[int, ...]]:
        """Sensors that are read at one instant, each set that there is, the most frequent one first."""
        steps = np.arange(math.lcm(*self.strides))[:, None] % self.strides == 0
        sets, counts = np.unique(steps, axis=0, return_counts=True)
        return [tuple(np.flatnonzero(sets[at]).tolist()) for at in np.argsort(-counts, kind="stable")]


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
    return [entry(i, j) for i in range(n) for j in range(i + 1)]


def memory_names(n_sensor: int) -> list[str]:
    """Return the rows of what a lane remembers of its sensors, one sensor after the other.

    Parameters
    ----------
    n_sensor : int
        Sensors.
    """
    return [f"{name}_{i}" for i in range(n_sensor) for name in MEMORY]


def in_parts(
    pattern: Pattern, matrices: Sequence[str], given: Mapping[str, bool], found: Mapping[str, bool], rows: Workspace
) -> str:
    """Return the source of run, which works on a block part by part.

    Parameters
    ----------
    pattern : Pattern
        Of F and H.
    matrices : sequence of str
        What comes before W.
    given, found : mapping of str to bool
        What comes behind it, and whether it begins with the time; what is filled, and whether each sensor has it.
    rows : Workspace
        Rows of W, ``beyond`` among them.
    """
    still = {"F": "np.eye(F.shape[0])", "Q": "np.zeros(Q.shape)"}
    stepped = [name if name not in still else f"step_{name}" for name in matrices]
    moving = [f"            step_{name}[:] = {name}" for name in matrices if name in still]
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
        matrices=", ".join(matrices),
        stepped=", ".join(stepped),
        still="\n".join(f"    step_{name} = {matrix}" for name, matrix in still.items() if name in matrices),
        moving="\n".join(["        if started:", *moving]),
        given=", ".join(given),
        sliced=", ".join(f"{name}[begin:end]" if timed else name for name, timed in given.items()),
        found=", ".join(found),
        parts=", ".join(f"part_{name}" for name in found),
        rooms="\n".join(rooms),
        spreads="\n".join(spreads),
        collects="\n".join(collects),
        beyond=rows.at("beyond"),
        PART=PART,
        LANES=LANES,
    )


def entry(i: int, j: int) -> str:
    """Return the name of an element of P: its lower half stands for both.

    Parameters
    ----------
    i, j : int
        Row and column.
    """
    return f"p{max(i, j)}_{min(i, j)}"


def over_lanes(indent: int, body: Iterable[str]) -> list[str]:
    """Return a loop over the lanes.

    Parameters
    ----------
    indent : int
        Columns before it.
    body : iterable of str
        Its lines.
    """
    return [f"{' ' * indent}for s in range({LANES}):", *(f"{' ' * indent}    {line}" for line in body)]


def load(rows: Workspace, names: Iterable[str]) -> Iterator[str]:
    """Return lines that give the rows of those names to variables of the same name.

    Parameters
    ----------
    rows : Workspace
        All rows.
    names : iterable of str
        Some of them.
    """
    return (f"{name} = {rows.at(name)}" for name in names)


def function(head: str, lines: Iterable[str]) -> str:
    """Return the source of a function.

    Parameters
    ----------
    head : str
        Its name and arguments.
    lines : iterable of str
        Its body.
    """
    return "\n".join([f"def {head}:", *lines])


def matrices_of(pattern: Pattern) -> Iterator[str]:
    """Yield F and H as plain variables.

    Parameters
    ----------
    pattern : Pattern
        Of both.
    """
    for name, matrix in (("f", pattern.F), ("h", pattern.H)):
        for i, row in enumerate(matrix):
            yield from (f"    {name}{i}_{j} = {name.upper()}[{i}, {j}]" for j in row)


def added(terms: Iterable[str]) -> str:
    """Return a sum.

    Parameters
    ----------
    terms : iterable of str
        In their order.
    """
    return " + ".join(terms) or "0.0"


def less_seen(pattern: Pattern, i: int) -> str:
    """Return - H_i x, term by term.

    Parameters
    ----------
    pattern : Pattern
        Of F and H.
    i : int
        Sensor.
    """
    return "".join(f" - h{i}_{j} * x{j}" for j in pattern.H[i])


def moved_states(pattern: Pattern) -> list[str]:
    """Return x = F x, of plain variables.

    Parameters
    ----------
    pattern : Pattern
        Of F.
    """
    moved = [f"y{i} = {added(f'f{i}_{j} * x{j}' for j in row)}" for i, row in enumerate(pattern.F)]
    return [*moved, *(f"x{i} = y{i}" for i in range(pattern.n))]
