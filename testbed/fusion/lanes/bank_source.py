"""Source of banks of filters under many seeds: the seeds are the lanes, and a covariance stands once for all filters
that have it, whatever their seeds.
"""

from __future__ import annotations

import hashlib
import inspect
from typing import TYPE_CHECKING, NamedTuple

from testbed.fusion.lanes import heirs
from testbed.fusion.lanes.covariance_source import (
    OF_READING,
    as_argument,
    covariance_functions,
    covariance_rows,
    noise_names,
    shown_names,
)
from testbed.fusion.lanes.mixture_source import Bank, mixture_functions
from testbed.fusion.lanes.source import (
    LANES,
    Pattern,
    added,
    covariance_names,
    function,
    less_seen,
    matrices_of,
    moved_states,
    over_lanes,
    state_names,
)

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

# Steps after which packs of covariances are filled up.
_CLOSED = 16
_JIT = '@njit(cache=True, error_model="numpy")'
# Numba's disk cache watches the generated file alone, so that this changes with what it calls, too.
_HEAD = f"""\
import numpy as np
from numba import njit

from testbed.fusion.lanes.heirs import change, close_ranks

# {hashlib.sha256(inspect.getsource(heirs).encode()).hexdigest()}
LANES = {LANES}
"""
# A step of its own before the first reading, where nothing moves. In W[p] stand the filters of a pack of seeds, one
# after the other.
_RUN = f"""

{_JIT}
def start_again(W, of, even, ahead, C, noise, child, users, live, counted):
    best, alike = np.empty(LANES, np.int64), 0
    for s in range(LANES):
        best[s] = np.int64(ahead[s])
        alike += 1 if ahead[s] == ahead[0] else 0
    for m in range(len(of)):
        own = W[m * {{width}} : (m + 1) * {{width}}]
        slower = own[{{slower}} * LANES : ({{slower}} + 1) * LANES]
        behind = 0
        for s in range(LANES):
            behind += 1 if slower[s] > 0.0 else 0
        if behind > 0:
            if alike == LANES:
                follow(own, W[best[0] * {{width}} : (best[0] + 1) * {{width}}])
            else:
                for s in range(LANES):
                    if slower[s] > 0.0:
                        other = W[best[s] * {{width}} : (best[s] + 1) * {{width}}]
                        for k in range(s, ({{own}} + 1) * LANES, LANES):
                            own[k] = other[k]
            even[m] = change(slower, best, m, of, C, {{kept}}, noise, child, users, live, counted)


{_JIT}
def run(F, H, common, R, setting, C, G, noise, W, of, even, child, users, live, counted, due, z, found, beyond):
    forget, gate, restart = setting[1], setting[2], setting[4]
    rate, std, innovation, variance = found
    ahead, some = np.empty(LANES), np.empty(LANES)
    started, still, lost = setting[0] > 0.0, np.zeros(F.shape), 0.0
    for i in range(len(F)):
        still[i, i] = 1.0
    for p in range(len(W)):
        weigh(W[p])
    for k in range(len(z)):
        if k % {{every}} == 0:
            close_ranks(C, {{moved}}, of, users, live, counted)
        lost = max(lost, advance_covariances(C, G, live, F, common, H, R, due[k], started))
        for p in range(len(W)):
            w = W[p]
            advance_states(w, F if started else still, H, G, of[p], even[p], z[k, p], due[k])
            fade(w, forget)
{{readings}}
            weigh(w)
            if contest(w, restart, ahead, some) > 0.0:
                start_again(w, of[p], even[p], ahead, C, noise, child, users, live, counted)
            mix(w, rate[k, p], std[k, p])
        started = True
        counted[0] += 1
    return lost
"""


class BankSource(NamedTuple):
    """Source of banks, and where what is in its arrays.

    Parameters
    ----------
    text : str
        The module, with `run`.
    of_covariance : list of str
        Rows of what a covariance has, each LANES numbers.
    bank : Bank
        Those of what the filters have.
    shown : int
        How many numbers of a covariance the filters look at.
    """

    text: str
    of_covariance: list[str]
    bank: Bank
    shown: int


def bank_source(pattern: Pattern, n_slow: int, n_filter: int) -> BankSource:
    """Return the source of run(F, H, common, R, setting, C, G, noise, W, of, even, child, users, live, counted, due, z,
    found, beyond) -> the largest variance of a rate [rad^2/s^2].

    The recursion of `testbed.fusion.kernels.bank.bank_kernel` in Joseph form, to the bit, over a part of a block of
    regular steps in which no reading is missing. W (n_pack, M * n_row * LANES) is what the filters have, a pack of
    seeds after the other, C and G of `covariance_functions` what the covariances have. `of` (n_pack, M, LANES) is the
    number of the covariance of each, `even` (n_pack, M) tells whether a whole pack has the same; `noise` (M, n_noise),
    `child`, `users`, `live`, `counted` are those of `testbed.fusion.lanes.heirs`, `common`, `setting` the kernel's.
    `due` (n_time, n_sensor) tells which readings there are in z (n_time, n_pack, n_sensor, LANES); `found` are rate,
    std (n_time, n_pack, LANES), innovation and its variance (n_time, n_sensor, n_pack, LANES). Where `beyond` (n_pack,
    LANES) is above 0, the gate refused a reading, and what is left of that seed is of no use; nor is any where the
    variance of a rate would have been recalled.

    Parameters
    ----------
    pattern : Pattern
        Of F and H.
    n_slow : int
        States of slow noise, the last ones.
    n_filter : int
        M, filters of the bank.
    """
    bank = bank_rows(pattern, n_filter)
    functions = [*covariance_functions(pattern, n_slow), _states(pattern, bank)]
    functions += mixture_functions(bank, len(pattern.H))
    text = _HEAD + "".join(f"\n\n{_JIT}\n{one}\n" for one in functions)
    kept = len(covariance_names(pattern.n))
    text += _RUN.format(
        width=LANES * len(bank.names),
        own=bank.names.index("own"),
        slower=bank.names.index("slower"),
        kept=as_argument(kept),
        moved=as_argument(kept + len(noise_names(pattern.n - n_slow))),
        every=_CLOSED,
        readings="\n".join(_reading(i) for i in range(len(pattern.H))),
    )
    return BankSource(text, covariance_rows(pattern, n_slow).names, bank, len(shown_names(pattern)))


def bank_rows(pattern: Pattern, n_filter: int) -> Bank:
    """Return the rows of a filter: states, variance of its rate, score and weight, whether it starts again; of each
    sensor its innovation and what it looks at of its covariance.

    Parameters
    ----------
    pattern : Pattern
        Of F and H.
    n_filter : int
        Filters of the bank.
    """
    sensors = range(len(pattern.H))
    found = [f"{name}{i}" for name in ("e", "ratio") for i in sensors]
    looked = [_named(name) for name in shown_names(pattern)[1:]]
    return Bank((*state_names(pattern.n), "own", "score", "weight", "slower", *found, *looked), n_filter)


def _reading(i: int) -> str:
    """Return what a reading does to the mixture."""
    lines = [
        f"if due[k, {i}]:",
        f"    judge{i}(w, R[{i}], gate, innovation[k, {i}, p], variance[k, {i}, p], beyond[p])",
        f"    credit{i}(w, gate)",
    ]
    return "\n".join(f"            {line}" for line in lines)


def _states(pattern: Pattern, bank: Bank) -> str:
    """Return a step of the filters of a pack, whose covariances are a step ahead."""
    width, shown = LANES * len(bank.names), shown_names(pattern)
    lines = [
        *matrices_of(pattern),
        "    for m in range(len(of)):",
        f"        W = W_of[m * {width} : (m + 1) * {width}]",
    ]
    for number, together in enumerate(pattern.together):
        there = (f"{'' if i in together else 'not '}due[{i}]" for i in range(len(pattern.H)))
        names = [name for name in shown if name == "own" or int(name.rpartition("_")[2]) in together]
        looked = [(_named(name), f"g[{shown.index(name)}]") for name in names]
        step = list(_step(pattern, bank, together))
        lines += [f"        {'elif' if number else 'if'} {' and '.join(there)}:", "            if even[m]:"]
        lines += ["                g = G[of[m, 0]]", *(f"                {name} = {at}" for name, at in looked)]
        lines += over_lanes(16, step)
        lines += ["            else:"]
        lines += over_lanes(16, ["g = G[of[m, s]]", *(f"{bank.at(name)} = {at}" for name, at in looked)])
        lines += over_lanes(16, [*(f"{name} = {bank.at(name)}" for name, _ in looked), *step])
    return function("advance_states(W_of, F, H, G, of, even, z, due)", lines)


def _named(name: str) -> str:
    """Return the name of what a filter looks at in a filter: without a line between a quantity and its sensor."""
    head, line, sensor = name.rpartition("_")
    return f"{head}{sensor}" if head in OF_READING else f"{head}{line}{sensor}"


def _step(pattern: Pattern, bank: Bank, together: Sequence[int]) -> Iterator[str]:
    """Yield a step of one filter: all innovations, then one reading after the other."""
    states = state_names(pattern.n)
    yield from (f"{name} = {bank.at(name)}" for name in states)
    yield from moved_states(pattern)
    yield f"{bank.at('own')} = own"
    for i in together:
        yield from (f"z{i} = z[{i}, s]", f"e{i} = z{i}{less_seen(pattern, i)}", f"{bank.at(f'e{i}')} = e{i}")
        yield from (f"{bank.at(f'{name}{i}')} = {name}{i}" for name in ("spread", "logarithm"))
    for i in together:
        # Of the first, nothing has come in between.
        yield from [f"e{i} = z{i}{less_seen(pattern, i)}"] if i != together[0] else []
        yield f"{bank.at(f'ratio{i}')} = abs(e{i}) / root{i}"
        yield from (f"x{j} = {added((f'x{j}', f'k{j}_{i} * e{i}'))}" for j in range(pattern.n))
    yield from (f"{bank.at(name)} = {name}" for name in states)
