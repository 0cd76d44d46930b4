"""Source of lanes that share one covariance: states, and gains that are given."""

from __future__ import annotations

from typing import TYPE_CHECKING

from testbed.fusion.lanes.source import (
    GATE,
    HEAD,
    Pattern,
    Workspace,
    added,
    in_parts,
    less_seen,
    load,
    matrices_of,
    moved_states,
    over_lanes,
    state_names,
)

if TYPE_CHECKING:
    from collections.abc import Sequence


def shared_source(pattern: Pattern) -> tuple[str, list[str]]:
    """Return the source of run(F, H, W, gains, variance, due, started, Z, rate, innovation), and the rows of its W.

    States of lanes that share one covariance: `gains` (n_time, n_sensor, n) and `variance` (n_time, n_sensor) belong to
    the readings that are `due` (n_sensor, n_time), in sets of `Pattern.together`. Z are LANES arrays (n_sensor,
    n_time), `innovation` is (n_lane, n_sensor, n_time), `rate` (n_lane, n_time), for as many of the first lanes as are
    wanted. The row ``beyond`` says by how much the largest squared innovation is beyond the gate [rad^2/s^2], 0 if none
    is.

    Parameters
    ----------
    pattern : Pattern
        Of F and H.
    """
    rows = Workspace([*state_names(pattern.n), "beyond"])
    lines = [*matrices_of(pattern), "    for k in range(due.shape[1]):"]
    # A step in one loop for each set of sensors that are read at once: the states stay in registers.
    for number, together in enumerate(pattern.together):
        there = (f"{'' if i in together else 'not '}due[{i}, k]" for i in range(len(pattern.H)))
        lines += [f"        {'elif' if number else 'if'} {' and '.join(there)}:"]
        lines += [f"            {line}" for i in together for line in _given(pattern, i)]
        lines += over_lanes(12, _step(pattern, rows, together))
    text = HEAD % "F, H, W, gains, variance, due, Z, rate, innovation" + "\n".join(lines)
    found = {"rate": False, "innovation": True}
    return text + in_parts(pattern, ("F", "H"), {"gains": True, "variance": True}, found, rows), rows.names


def _given(pattern: Pattern, i: int) -> list[str]:
    """Return gains and gate of a sensor."""
    gains = [f"k{i}_{j} = gains[k, {i}, {j}]" for j in range(pattern.n)]
    return [f"limit{i} = {GATE**2!r} * variance[k, {i}]", *gains]


def _step(pattern: Pattern, rows: Workspace, together: Sequence[int]) -> list[str]:
    """Return a step of one lane: all innovations, then one reading after the other."""
    states = state_names(pattern.n)
    lines = [*load(rows, states), *moved_states(pattern), f"beyond = {rows.at('beyond')}"]
    for i in together:
        lines += [f"z{i} = Z[{i}, k, s]", f"e{i} = z{i}{less_seen(pattern, i)}", f"innovation[{i}, k, s] = e{i}"]
        lines += [f"beyond = max(beyond, e{i} * e{i} - limit{i})"]
    for i in together:
        # Of the first, nothing has come in between.
        lines += [f"e{i} = z{i}{less_seen(pattern, i)}"] if i != together[0] else []
        lines += [f"x{j} = {added((f'x{j}', f'k{i}_{j} * e{i}'))}" for j in range(pattern.n)]
    stored = [f"{rows.at(name)} = {name}" for name in (*states, "beyond")]
    return [*lines, *stored, "rate[k, s] = x0"]
