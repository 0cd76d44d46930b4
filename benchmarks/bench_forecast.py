"""What `check` foretells of a run against what the run takes, and how long the first `check` takes, nothing compiled.

Promised: the disk within a factor of two, the first `check` within 5 CPU seconds. A step of each shipped filter is
printed beside what is assumed of it. Run: python benchmarks/bench_forecast.py
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from promises import Promise, conclude

import testbed
from testbed.chain.forecast import forecast
from testbed.fusion import FILTERS
from testbed.fusion.belief import default_belief
from testbed.parts import resolve

SCENARIOS = Path(__file__).parents[1] / "scenarios"
LENGTHS = {
    "mixed_0p5hz_10hz": ("0.5 s", "2 s", "20 s"),
    "wideband_jitter": ("2 s", "6 s"),
    "static": ("2 s", "20 s"),
    "static_allan": ("100 s",),
    "fog/thermal_cycle": ("1000 s", "85200 s"),
}
RATES = {"mhd_ars": 20_000.0, "mems_gyro": 2_000.0}


def sizes() -> float:
    """Print disk and time, foretold and taken; return by which factor the disk is off at the most."""
    worst = 1.0
    for name, lengths in LENGTHS.items():
        for length in lengths:
            scenario = testbed.load_scenario(SCENARIOS / f"{name}.yaml").with_(
                duration=length, settle="0 s", expect=None
            )
            size = forecast(scenario)
            with tempfile.TemporaryDirectory() as folder:
                begin = time.process_time()
                testbed.run(scenario, out=Path(folder) / "run")
                spent = time.process_time() - begin
                written = sum(path.stat().st_size for path in (Path(folder) / "run").iterdir())
            worst = max(worst, size.disk_bytes / written, written / size.disk_bytes)
            print(
                f"{name:<20}{length:>8}: {size.disk_bytes / 1e6:7.2f} MB of {written / 1e6:7.2f} MB "
                f"({size.disk_bytes / written:.2f}), {size.seconds:5.1f} s of {spent:5.1f} s CPU"
            )
    return worst


def steps(n_time: int = 40_000) -> None:
    """Print the time of a step of each filter, assumed and taken."""
    noise = np.random.default_rng(1)
    readings = {name: 1e-3 * noise.standard_normal(round(n_time * rate / 2e4)) for name, rate in RATES.items()}
    for name in FILTERS:
        cls = resolve("filter", name, FILTERS)
        stage = cls(default_belief(), RATES, cls.Parameters())
        stage.process(readings)
        begin = time.process_time()
        stage.process(readings)
        spent = (time.process_time() - begin) / n_time
        print(f"{name:<20}{1e6 * stage.step_seconds:7.2f} us a step assumed, {1e6 * spent:7.2f} us taken")


def first_check() -> float:
    """Print how long `testbed check` takes with nothing compiled, and with everything; return the first [CPU s]."""
    spent = []
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "testbed", "check", SCENARIOS / "mixed_0p5hz_10hz.yaml", "--quiet"]
        for what in ("first", "second"):
            begin = children_s()
            subprocess.run(command, check=True, env=os.environ | {"NUMBA_CACHE_DIR": folder})
            spent.append(children_s() - begin)
            print(f"{what} check: {spent[-1]:.1f} CPU s")
    return spent[0]


def children_s() -> float:
    """Return the CPU time of the processes that were waited for [s]."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def main() -> None:
    """Print what was foretold and taken, and the promises."""
    first = first_check()
    steps()
    conclude(
        Promise("forecast: the first check, nothing compiled [CPU s]", 5.0, first),
        Promise("forecast: disk foretold and written, the larger over the smaller [-]", 2.0, sizes()),
    )


if __name__ == "__main__":
    main()
