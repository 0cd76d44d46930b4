"""A campaign: what a further seed costs, and a step of filters side by side in lanes.

CPU seconds of `testbed.evaluate` on the mixed scenario (20 s, three filters, modal plant) with 2 and with 34 seeds: the
difference is what a further seed costs, and 1000 seeds are extrapolated from both. Lanes: nanoseconds per lane and
step, of filters that share one covariance and of filters that have their own, readings and estimates moved to and from
each lane's arrays included, and CPU seconds that the compiler takes for their generated kernels, in a process whose
cache folder is empty. Run:
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
from testbed.fusion.lanes.source import LANES
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


def lane_ns(name: str, belief: Mapping[str, Any], **parameters: Any) -> float:
    """Return nanoseconds per lane and step, pack after pack of readings that have just been received."""
    kind = resolve("filter", name, FILTERS)
    first = kind(belief, RATES, kind.Parameters(**parameters))
    filters, rng = [deepcopy(first) for _ in range(PACKS * LANES)], np.random.default_rng(1)
    given = [
        {sensor: 1e-4 * rng.standard_normal(round(N_TIME * rate / 20_000.0)) for sensor, rate in RATES.items()}
        for _ in filters
    ]
    lanes = Together(first)._lanes
    assert lanes is not None

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
    return 1e9 * float(best.sum()) / (N_TIME * len(filters))


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
    given = {sensor: np.zeros(round(N_TIME * rate / 20_000.0)) for sensor, rate in RATES.items()}
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
    few = seconds(lambda: testbed.evaluate(scenario, range(2)), 2)
    many = seconds(lambda: testbed.evaluate(scenario, range(most)), 2)
    further = (many - few) / (most - 2)
    # A truth is played once for 128 seeds.
    thousand = 1000 * further + np.ceil(1000 / 128) * max(few - 2 * further, 0.0)
    print(f"2 seeds {few:.3f} CPU s, {most} seeds {many:.3f} CPU s; 1000 seeds are extrapolated")
    shared, own = compile_s("kalman", coloured=False), compile_s("shakf")
    print(f"compiling lanes of five states: {shared:.1f} CPU s with a shared covariance, {own:.1f} with their own")
    conclude(
        Promise("a further seed x 3 filters x 20 s, modal plant [CPU s]", 0.06, further),
        Promise("1000 seeds x 3 filters x 20 s, modal plant, extrapolated [CPU s]", 60.0, float(thousand)),
        Promise(
            "lane-step with a shared covariance, 5 states [ns]",
            3.0,
            lane_ns("kalman", default_belief(), coloured=False),
        ),
        Promise("lane-step with a shared covariance, coloured noise [ns]", 18.0, lane_ns("kalman", coloured)),
        Promise(
            "lane-step with a shared covariance, steady_state, coloured noise [ns]",
            22.0,
            lane_ns("steady_state", coloured, frequency=10.0),
        ),
        Promise("lane-step with its own covariance, shakf, 5 states [ns]", 8.0, lane_ns("shakf", default_belief())),
    )


if __name__ == "__main__":
    main()
