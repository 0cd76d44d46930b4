"""`wideband` under 64 seeds side by side against its kernel under one seed after the other, on readings of the shipped
scenarios.

A filter of the bank that starts again from a better one goes on with a covariance of its own; under seeds in lockstep
all that do so at one step from one covariance share what it becomes. Printed for a table at rest, two lines, and
jitter, with the belief eq39, states for slow noise and without, no reading missing: microseconds a seed and step of
both, and how many covariances there are for each seed, of 16 filters. Both work on the same block, one after the other,
and the ratio is the median of the blocks; what the compiler takes in an empty cache folder is printed beside. The
estimates shall be the same to 1e-12; they are to the bit. And nanoseconds a step of a filter of 16 states that shares
its covariance with no other, lane beside lane. Run:
python benchmarks/bench_wideband_lanes.py
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from copy import deepcopy
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Any

import numpy as np
from numba import njit
from promises import Promise, conclude

import testbed
from testbed.campaigns.many import ManySensors
from testbed.chain.pipeline import block_lengths
from testbed.chain.truth import Truth
from testbed.fusion.belief import default_belief
from testbed.fusion.filters.wideband import Wideband, WidebandParameters
from testbed.fusion.lanes.bank import BANKS_AT_ONCE, FEWEST
from testbed.fusion.lanes.bank_source import bank_source
from testbed.fusion.lanes.module import module_of
from testbed.fusion.lanes.pack import pattern_of
from testbed.fusion.lanes.source import LANES
from testbed.fusion.lanes.together import Together

if TYPE_CHECKING:
    from collections.abc import Iterator

SCENARIOS = Path(__file__).parents[1] / "scenarios"
RATES = {"mhd_ars": 20_000.0, "mems_gyro": 2_000.0}
# The ratio that is promised, with states for slow noise and without.
PROMISED = {"static": (11.0, 8.0), "mixed_0p5hz_10hz": (5.0, 5.0), "wideband_jitter": (4.0, 4.0)}


def readings(name: str, seeds: list[int]) -> Iterator[list[dict[str, Any]]]:
    """Yield what each seed reads in each second of a scenario."""
    changes = {"turntable.engine": "modal", "duration": "5 s", "settle": "0 s", "expect": None}
    scenario = testbed.load_scenario(SCENARIOS / f"{name}.yaml").with_(**changes)
    truth, many = Truth(scenario.with_seed(1)), {key: ManySensors(scenario, key, seeds) for key in scenario.sensors}
    for n_time in block_lengths(scenario):
        _, block = truth.process(n_time)
        for sensor in many.values():
            sensor.take(block)
        given = {key: sensor.readings(seeds) for key, sensor in many.items()}
        yield [{key: values[j] for key, values in given.items()} for j in range(len(seeds))]


def covariances(filters: list[Any]) -> float:
    """Return how many different covariances the filters of all banks have, over the banks."""
    half = np.tril_indices(len(filters[0]._x))
    P = np.stack([one._P[half] for one in filters])
    return sum(len(np.unique(P[:, :, m], axis=0)) for m in range(P.shape[2])) / len(filters)


def compare(name: str, coloured: bool) -> tuple[float, float]:
    """Return how many times faster seeds go side by side, and the largest deviation over the largest estimate."""
    seeds = list(range(1, BANKS_AT_ONCE + 1))
    first = Wideband(default_belief(), RATES, WidebandParameters(coloured=coloured))
    alone, lanes = ([deepcopy(first) for _ in seeds] for _ in range(2))
    together, spent, off, peak, own = Together(first), [], 0.0, 0.0, []
    for number, given in enumerate(readings(name, seeds)):
        received = [one.received(values) for one, values in zip(alone, given, strict=True)]
        times = [time.process_time()]
        ours = [one.rate.copy() for one in together.process(lanes, received)]
        times.append(time.process_time())
        theirs = [one.estimated(*values).rate for one, values in zip(alone, received, strict=True)]
        times.append(time.process_time())
        off = max(off, *(float(np.abs(a - b).max()) for a, b in zip(ours, theirs, strict=True)))
        peak = max(peak, *(float(np.abs(b).max()) for b in theirs))
        if number:  # in the first block the kernels are compiled or loaded
            spent.append(np.diff(times) / (len(seeds) * theirs[0].size))
            own.append(covariances(lanes))
    ratio = median(after / before for before, after in spent)
    us = [1e6 * median(values) for values in zip(*spent, strict=True)]
    print(
        f"{name:<18}{len(first.model.F):>3} states: {us[1]:.2f} us alone, {us[0]:.3f} side by side, {ratio:.1f} times; "
        f"{median(own):.1f} covariances a seed",
        flush=True,
    )
    return ratio, off / peak


def compile_s(coloured: bool) -> float:
    """Return what compiling the lanes takes [CPU s]."""
    with tempfile.TemporaryDirectory() as cache:
        call = f"import bench_wideband_lanes as b; print(b.compiled_here({coloured}))"
        place = {"XDG_CACHE_HOME": cache, "PYTHONPATH": os.pathsep.join([str(Path(__file__).parent), *sys.path[1:]])}
        command = [sys.executable, "-c", call]
        return float(subprocess.run(command, env={**os.environ, **place}, check=True, stdout=subprocess.PIPE).stdout)


def compiled_here(coloured: bool) -> float:
    """Return what the first block of lanes takes over the second one [CPU s]."""
    lanes = [Wideband(default_belief(), RATES, WidebandParameters(coloured=coloured)) for _ in range(FEWEST)]
    together, spent = Together(lanes[0]), []
    for given in readings("static", list(range(FEWEST))):
        received = [one.received(values) for one, values in zip(lanes, given, strict=True)]
        begin = time.process_time()
        for _ in together.process(lanes, received):
            pass
        spent.append(time.process_time() - begin)
    return spent[0] - spent[1]


def recursion(module: Any) -> Any:
    """Return what advances a pack of filters, a covariance each, by functions of a generated module."""
    grow, advance_states = module.grow, module.advance_states
    innovate0, use0, innovate1, use1 = module.innovate0, module.use0, module.innovate1, module.use1

    @njit  # type: ignore[untyped-decorator]
    def steps(n: int, model: Any, arrays: Any, due: Any) -> None:  # pragma: no cover
        F, H, Q, R = model
        C, G, W, of, z = arrays
        even = np.zeros(1, np.bool_)
        for k in range(n):
            now = due[k % len(due)]
            grow(C, F, Q)
            if now[0]:
                innovate0(C, H[0])
                use0(C, H[0], R[0])
            if now[1]:
                innovate1(C, H[1])
                use1(C, H[1], R[1])
            advance_states(W, F, H, G, of, even, z, now)

    return steps


def own_ns() -> float:
    """Return what the recursion of a lane with a covariance of its own takes a step, of two sensors the gyro read at
    every tenth [ns]; print it.
    """
    belief = {name: one.model_copy(update={"lowest_frequency": 1e-3}) for name, one in default_belief().items()}
    one = Wideband(belief, RATES, WidebandParameters(start="rest"))
    model, n, core = one.model, len(one.model.F), len(one.model.F) - one.model.n_slow
    source = bank_source(pattern_of(one), model.n_slow, len(one._score))
    steps = recursion(sys.modules[module_of(source.text).run.py_func.__module__])
    half = np.concatenate([one._P[np.tril_indices(n)], one._Q[np.tril_indices(core)]])
    # In each lane another filter of the bank.
    C, W = np.zeros((len(source.of_covariance), LANES)), np.zeros(LANES * len(source.bank.names))
    C[: len(half)] = half
    G, of, z = np.zeros((LANES, source.shown)), np.arange(LANES)[None], np.full((2, LANES), 1e-6)
    due = np.array([[k == 0 or name == "mhd_ars" for name in one.schedule.sensors] for k in range(10)])
    spent = []
    placed = []
    for _ in range(30):
        # Where it lies in memory changes the time by a tenth.
        placed.append(C.copy())
        begin = time.process_time()
        steps(2000, (model.F, model.H, model.Q, one._R), (placed[-1].reshape(-1), G, W, of, z), due)
        spent.append(1e9 * (time.process_time() - begin) / (2000 * LANES))
    print(f"{n} states, a covariance of its own: {min(spent):.1f} ns a step of the recursion")
    return min(spent)


def main() -> None:
    """Print both for each scenario and the promises."""
    promises, most = [], 0.0
    for number, coloured in enumerate((True, False)):
        for name, promised in PROMISED.items():
            ratio, off = compare(name, coloured)
            most = max(most, off)
            what = f"wideband, 64 seeds over one by one: {name}, {'slow noise' if coloured else 'white'} [-]"
            promises.append(Promise(what, promised[number], ratio, at_most=False))
        print(f"compiled in {compile_s(coloured):.0f} CPU s", flush=True)
    promises.append(
        Promise("a filter of 16 states with a covariance of its own, lane beside lane [ns]", 75.0, own_ns())
    )
    conclude(*promises, Promise("wideband: off its kernel, of the largest estimate [-]", 1e-12, most))


if __name__ == "__main__":
    main()
