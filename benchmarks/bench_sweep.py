"""The scale of a sweep: what a case costs beside its simulation, how cost grows, what a second worker is worth.

- Overhead: CPU seconds of a sweep whose cases are not played (their rows are ready made), from 10 cases to --cases:
  agenda, rows, store, page with its figures, the best of some sweeps where they are short. What a case takes is
  promised for every number of cases, and what a further one takes. What checking a case takes before the first one runs
  is printed beside it.
- Length: CPU seconds of `testbed.evaluate` from 1 s to --seconds; what a further simulated second costs stays the same.
- Workers: wall clock of a sweep of --worker-cases with one worker over that with two, both as clusters that start anew
  (on a machine with two free cores), and the peak resident set of a worker after half of the cases and after all.
- All filters: the peak resident set of a worker that plays every filter of `testbed list` over ten seeds, in a case of
  --filter-seconds (12 s are enough: nothing that a filter holds reaches further back; half an hour of processor time
  for 600 s).

From these follows, on paper, what a million cases on 100 machines take.
Run: python benchmarks/bench_sweep.py [--cases 10000] [--seconds 3600] [--without-workers] [--worker-cases 300]
     [--filter-seconds 12]
"""

from __future__ import annotations

import argparse
import tempfile
import time
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import psutil
from promises import Promise, conclude

import testbed
from testbed.campaigns import engine
from testbed.campaigns.agenda import Agenda, Task, play
from testbed.campaigns.study import Study, load_study
from testbed.campaigns.sweep import sweep
from testbed.fusion import FILTERS

if TYPE_CHECKING:
    from collections.abc import Callable

BASE = """\
name: base
seed: 1
duration: {seconds:g} s
settle: 0.5 s
turntable: {{engine: auto}}
motion: [{{sine: {{frequency: 10 Hz, rate: 1 deg/s}}}}]
sensors: {{mhd_ars: {{preset: sx300}}, mems_gyro: {{preset: adis16505_filtered}}}}
fusion: {{{fusion}}}
"""
TWO = "kalman: {}, arw_shakf: {}"
# Those that do not speak for themselves.
NEEDS = {"self_calibrating": "{filter: {kalman: {order: 3, q: 1e10 (deg/s)^2/s^5}}}"}


def study_of(folder: Path, cases: int, seconds: float = 1.0, fusion: str = TWO, seeds: int = 1) -> Study:
    """Return a study of one axis."""
    (folder / "base.yaml").write_text(BASE.format(seconds=seconds, fusion=fusion))
    axis = f"{{linear: [1 Hz, 20 Hz], points: {cases}}}"
    study = f"name: scale\nbase: base.yaml\nseeds: {seeds}\nvary: {{motion.0.sine.frequency: {axis}}}\n"
    (folder / "study.yaml").write_text(study)
    return load_study(folder / "study.yaml")


def longer(scenario: testbed.Scenario, seconds: float) -> testbed.Scenario:
    """Return the scenario with another duration."""
    return scenario.with_(duration=f"{seconds:g} s")


def cpu(task: Callable[[], object]) -> float:
    """Return the CPU time of a call [s]."""
    begin = time.process_time()
    task()
    return time.process_time() - begin


def overhead_ms(folder: Path, study: Study, cases: int) -> float:
    """Return what a sweep costs beside the simulation: the first case's rows stand for those of all [ms]."""
    many = replace(study, cases=tuple(replace(study.cases[0], number=k) for k in range(cases)))
    ready, (axis,) = play(Task(study.cases[0], 0, study.seeds)), study.axes

    def instant(task: Task) -> list[dict[str, Any]]:
        # As `testbed.campaigns.rows` makes them, hash and all, at points of their own.
        own = {"case": task.case.number, axis: 1.0 + task.case.number / cases, "scenario_sha256": task.case.sha256}
        return [{**row, **own} for row in ready]

    real, engine.play = engine.play, instant
    places = [folder / f"instant_{cases}_{k}" for k in range(max(1, 100 // cases))]
    try:
        return 1e3 * min(cpu(lambda out=out: sweep(many, out=out)) for out in places)
    finally:
        engine.play = real


def clustered(study: Study, workers: int) -> tuple[float, float]:
    """Return the wall clock of a sweep on a cluster [s], and the largest resident set that any worker had [MB]."""
    most = 0.0

    def take(_task: Task, _rows: list[dict[str, Any]]) -> None:
        nonlocal most
        most = max(most, *map(peak_mb, psutil.Process().children(recursive=True)))

    begin = time.monotonic()
    engine.play_on_cluster(Agenda(study, ()), take, workers=workers)
    return time.monotonic() - begin, most


def peak_mb(process: psutil.Process) -> float:
    """Return the largest resident set of a process since its program began [MB]; that of `getrusage` counts the parent.

    Linux says so; elsewhere it is that of now.
    """
    status = Path(f"/proc/{process.pid}/status")
    if not status.exists():
        return float(process.memory_info().rss) / 1e6
    fields = dict(line.split(":", 1) for line in status.read_text().splitlines())
    return float(fields.get("VmHWM", "0 kB").split()[0]) * 1.024e-3  # Linux writes kB and means 1024


def main() -> None:
    """Print the costs and the promises."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=1000)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--without-workers", action="store_true")
    parser.add_argument("--worker-cases", type=int, default=300)
    parser.add_argument("--filter-seconds", type=float, default=12.0)
    given = parser.parse_args()
    promises = []
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        check = cpu(lambda: study_of(folder, 20)) / 20
        study = study_of(folder, 2)
        overhead_ms(folder, study, 100)
        counts = [n for n in (10, 100, 1000, 10_000) if n <= given.cases]
        costs = {n: overhead_ms(folder, study, n) for n in counts}
        each = [(costs[b] - costs[a]) / (b - a) for a, b in pairwise(counts)]
        for n, cost in costs.items():
            print(f"{n:6d} cases: {cost:.0f} ms beside their simulation, {cost / n:.2f} ms a case")
        print(f"of which once: {costs[counts[0]] - counts[0] * each[0]:.0f} ms")
        print(f"checking a case before the first one runs: {1e3 * check:.0f} ms")
        span = f"{counts[0]} to {counts[-1]} cases"
        promises.append(Promise(f"overhead a case, {span} [ms]", 5.0, max(costs[n] / n for n in counts)))
        promises.append(Promise(f"overhead of a further case, {span} [ms]", 5.0, max(each)))
        scenario = study.cases[0].scenario
        testbed.evaluate(scenario, [1])
        lengths = [s for s in (1.0, 10.0, 60.0, 600.0, 3600.0) if s <= given.seconds]
        spent = {s: min(cpu(lambda s=s: testbed.evaluate(longer(scenario, s), [1])) for _ in range(2)) for s in lengths}
        further = [(spent[b] - spent[a]) / (b - a) for a, b in pairwise(lengths)]
        for (a, b), cost in zip(pairwise(lengths), further, strict=True):
            print(f"from {a:g} s to {b:g} s: {1e3 * cost:.1f} ms of processor time per simulated second")
        print(f"a case of 1 s, design and optimum included: {1e3 * spent[1.0]:.0f} ms")
        what = f"a second of {lengths[-1]:g} s over one of {lengths[1]:g} s [-]"
        promises.append(Promise(what, 1.2, further[-1] / further[0]))
        if not given.without_workers:
            n = given.worker_cases
            _, few = clustered(study_of(folder, n // 2, 4.0), 1)
            one, many = clustered(study_of(folder, n, 4.0), 1)
            two, most = clustered(study_of(folder, n, 4.0), 2)
            print(f"{n} cases of 4 s: one worker {one:.1f} s, two {two:.1f} s; a worker held {many:.0f} MB at the most")
            promises += [
                Promise(f"one worker over two, {n} cases of 4 s [-]", 1.8, one / two, at_most=False),
                Promise("peak memory of a worker [MB]", 400.0, max(few, many, most)),
                Promise(f"memory of a worker after {n} cases over that after {n // 2} [-]", 1.1, many / few),
            ]
            every = ", ".join(f"{name}: {NEEDS.get(name, '{}')}" for name in FILTERS)
            _, most = clustered(study_of(folder, 1, given.filter_seconds, every, 10), 1)
            what = f"peak memory of a worker, all {len(FILTERS)} filters, ten seeds of {given.filter_seconds:g} s [MB]"
            promises.append(Promise(what, 400.0, most))
        whole, beside = spent[10.0] + 1e-3 * each[-1], 1e-3 * each[-1]
        print(f"on paper: 1e6 cases of 10 s, one seed, on 100 machines of 8 cores: {1e6 * whole / 800 / 3600:.2f} h")
        print(f"  of which the parent, alone: {1e6 * beside / 3600:.2f} h for rows and store,")
        print(f"  and {1e6 * check / 3600:.1f} h to check the cases, in 50 studies of 20 000")
    conclude(*promises)


if __name__ == "__main__":
    main()
