"""A campaign: what a further seed costs, and a step of filters side by side in lanes.

CPU seconds of `testbed.evaluate` on the mixed scenario (20 s, three filters, modal plant) with 2 and with 34 seeds: the
difference is what a further seed costs, and 1000 seeds are extrapolated from both; and of one whole `testbed.run` in
memory, imports and compiled functions loaded. Lanes: nanoseconds per lane and
step, of filters that share one covariance and of filters that have their own: of the recursion alone, readings lane
beside lane in, estimates, claims and innovations out; and of all that a block costs, gains for 128 seeds, readings and
estimates moved to and from each lane's arrays included. CPU seconds that the compiler takes for their
generated kernels, in a process whose cache folder is empty. Run:
python benchmarks/bench_campaign.py [--seeds 34]
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from copy import deepcopy
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from promises import Promise, conclude

import testbed
from testbed.fusion import FILTERS
from testbed.fusion.belief import default_belief
from testbed.fusion.lanes.source import LANES, PART
from testbed.fusion.lanes.together import Together
from testbed.parts import resolve

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

SCENARIO = Path(__file__).parents[1] / "scenarios" / "mixed_0p5hz_10hz.yaml"
RATES = {"mhd_ars": 20_000.0, "mems_gyro": 2_000.0}
N_TIME = 20_000
# As `testbed.evaluate` has them: 128 seeds that share what they can, a pack of which is there at a time.
PACKS = 8


def seconds(task: Callable[[], object], repeats: int) -> float:
    """Return the least CPU time of some runs [s]: what else the machine does only ever adds."""
    times = []
    for _ in range(repeats):
        begin = time.process_time()
        task()
        times.append(time.process_time() - begin)
    return min(times)


def started_lanes(name: str, belief: Mapping[str, Any], **parameters: Any) -> tuple[Any, list[Any], list[Any]]:
    """Return lanes of a filter, the filters of all packs, and the readings of each."""
    kind = resolve("filter", name, FILTERS)
    first = kind(belief, RATES, kind.Parameters(**parameters))
    filters, rng = [deepcopy(first) for _ in range(PACKS * LANES)], np.random.default_rng(1)
    given = [
        {sensor: 1e-4 * rng.standard_normal(round(N_TIME * rate / 20_000.0)) for sensor, rate in RATES.items()}
        for _ in filters
    ]
    lanes = Together(first)._lanes
    assert lanes is not None
    return lanes, filters, given


def lane_ns(name: str, belief: Mapping[str, Any], **parameters: Any) -> tuple[float, float]:
    """Return nanoseconds per lane and step: of the recursion alone, and of all that a block costs, pack after pack of
    readings that have just been received.
    """
    lanes, filters, given = started_lanes(name, belief, **parameters)

    def block() -> list[float]:
        spent = []
        for k in range(0, len(filters), LANES):
            pack = filters[k : k + LANES]
            received = [one.received(values) for one, values in zip(pack, given[k : k + LANES], strict=True)]
            begin = time.process_time()
            lanes.advance(pack, received, range(LANES))
            spent.append(time.process_time() - begin)
        return spent

    block()
    # Each pack at its best, since it is done before others on this machine have their turn.
    best = np.min([block() for _ in range(7)], axis=0)
    return recursion_ns(lanes, filters, given), 1e9 * float(best.sum()) / (N_TIME * len(filters))


def recursion_ns(lanes: Any, filters: list[Any], given: list[Any]) -> float:
    """Return nanoseconds per lane and step of what `lanes` compute, readings lane beside lane, as many steps as they
    take at a time.
    """
    received = [one.received(values) for one, values in zip(filters[:LANES], given, strict=False)]
    asked: list[tuple[Any, ...]] = []
    run, lanes._run = lanes._run, lambda *arguments: asked.append(arguments)
    lanes.advance(filters[:LANES], received, range(LANES))
    # `run` takes what `part` does, but for the readings of each lane and whether there was one before.
    at = next(i for i, one in enumerate(asked[0]) if isinstance(one, tuple))
    *common, _, readings = asked[0][: at + 1]
    z = np.stack(readings, axis=-1)[:, :PART].copy()
    common = [one[:, :PART] if one.dtype == np.bool_ else one[:PART] if len(one) == N_TIME else one for one in common]
    found = [np.empty((*one.shape[1:-1], PART, LANES)) for one in asked[0][at + 1 :]]
    part = sys.modules[run.py_func.__module__].part

    def parts() -> None:
        for _ in range(N_TIME // PART):
            part(*common, z, *found)

    parts()
    return 1e9 * seconds(parts, 15) / (N_TIME // PART * PART * LANES)


def compile_s(name: str, **parameters: Any) -> float:
    """Return what compiling the lanes of a filter of five states takes [CPU s]."""
    with tempfile.TemporaryDirectory() as cache:
        call = f"import bench_campaign as b; print(b.compiled_here({name!r}, **{parameters!r}))"
        place = {"XDG_CACHE_HOME": cache, "PYTHONPATH": os.pathsep.join([str(Path(__file__).parent), *sys.path[1:]])}
        command = [sys.executable, "-c", call]
        return float(subprocess.run(command, env={**os.environ, **place}, check=True, stdout=subprocess.PIPE).stdout)


def compiled_here(name: str, **parameters: Any) -> float:
    """Return what the first block of lanes takes over the second one [CPU s]; what ships compiled is loaded before."""
    kind = resolve("filter", name, FILTERS)
    first = kind(default_belief(), RATES, kind.Parameters(**parameters))
    filters = [deepcopy(first) for _ in range(LANES)]
    # Readings that never change are struck out, and lanes do nothing.
    rng = np.random.default_rng(1)
    given = {sensor: 1e-4 * rng.standard_normal(round(N_TIME * rate / 20_000.0)) for sensor, rate in RATES.items()}
    first.process(given)
    lanes = Together(first)._lanes
    assert lanes is not None
    received = [one.received(given) for one in filters]
    begin = time.process_time()
    lanes.advance(filters, received, range(LANES))
    between = time.process_time()
    lanes.advance(filters, received, range(LANES))
    return 2.0 * between - begin - time.process_time()


def main() -> None:
    """Print the costs and the promises."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=34)
    most = parser.parse_args().seeds
    scenario = testbed.load_scenario(SCENARIO).with_(**{"turntable.engine": "modal"})
    coloured = scenario.with_(**{"fusion.kalman": {"belief": "exact"}}).fusion["kalman"].belief
    testbed.evaluate(scenario.with_(duration="2 s", settle="1 s"), range(2))
    white = scenario.with_(**{"fusion.kalman": {"coloured": False}})
    whole = seconds(lambda: testbed.run(white), 3)
    few = seconds(lambda: testbed.evaluate(scenario, range(2)), 2)
    many = seconds(lambda: testbed.evaluate(scenario, range(most)), 2)
    further = (many - few) / (most - 2)
    # A truth is played once for 128 seeds.
    thousand = 1000 * further + np.ceil(1000 / 128) * max(few - 2 * further, 0.0)
    print(f"2 seeds {few:.3f} CPU s, {most} seeds {many:.3f} CPU s; 1000 seeds are extrapolated")
    shared, own = compile_s("kalman", coloured=False), compile_s("shakf")
    print(f"compiling lanes of five states: {shared:.1f} CPU s with a shared covariance, {own:.1f} with their own")
    promises = [
        Promise("a run of 20 s in memory, 3 filters of white noise, modal plant [CPU s]", 0.65, whole),
        Promise("a further seed x 3 filters x 20 s, modal plant [CPU s]", 0.06, further),
        Promise("1000 seeds x 3 filters x 20 s, modal plant, extrapolated [CPU s]", 60.0, float(thousand)),
    ]
    for what, alone, whole, name, belief, parameters in (
        ("shared covariance, 5 states", 3.0, 8.0, "kalman", default_belief(), {"coloured": False}),
        ("shared covariance, coloured noise", 6.0, 18.0, "kalman", coloured, {}),
        ("shared covariance, steady_state, coloured noise", 7.0, 22.0, "steady_state", coloured, {"frequency": 10.0}),
        ("own covariance, shakf, 5 states", 8.0, 18.0, "shakf", default_belief(), {}),
    ):
        recursion, block = lane_ns(name, belief, **parameters)
        promises += [
            Promise(f"lane-step, {what}: recursion [ns]", alone, recursion),
            Promise(f"lane-step, {what}: with gains and moving [ns]", whole, block),
        ]
    conclude(*promises)


if __name__ == "__main__":
    main()
