"""Where the time of a run goes: every stage, in one process.

Promise: all stages outside MuJoCo of a mixed scenario with three filters, run.nc and recording take at most 0.2 CPU s
per simulated second. Prints CPU seconds per stage. The first run warms the compiled code up and is not
counted.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections import defaultdict
from pathlib import Path

from promises import Promise, conclude

import testbed
from testbed.fusion import FILTERS
from testbed.judging.judge import Judge
from testbed.models.motion import MotionProfile
from testbed.models.turntable.turntable import Turntable
from testbed.parts import resolve
from testbed.recording import RecordingWriter
from testbed.runs.netcdf import NetcdfStore
from testbed.sensors.mems_gyro import MemsGyroStage
from testbed.sensors.mhd_ars import MhdArsStage

ROOT = Path(__file__).parents[1]
STAGES = {
    "motion": (MotionProfile, "process"),
    "turntable": (Turntable, "process"),
    "sensors: mhd_ars": (MhdArsStage, "process"),
    "sensors: mems_gyro": (MemsGyroStage, "process"),
    "metrics": (Judge, "write"),
    "run.nc": (NetcdfStore, "write"),
    "recording: write": (RecordingWriter, "write"),
    "recording: close": (RecordingWriter, "close"),
}


def timed(spent, label, function):
    def wrapper(*args, **kwargs):
        begin = time.process_time()
        try:
            return function(*args, **kwargs)
        finally:
            spent[label] += time.process_time() - begin

    return wrapper


def main(duration: float = 60.0) -> None:
    spent: dict[str, float] = defaultdict(float)
    for label, (owner, name) in STAGES.items():
        setattr(owner, name, timed(spent, label, getattr(owner, name)))
    for name in ("kalman", "shakf", "arw_shakf"):
        method = resolve("filter", name, FILTERS)
        method.process = timed(spent, f"fusion: {name}", method.process)
    from testbed import report

    report.write_report = timed(spent, "report", report.write_report)
    text = (ROOT / "scenarios" / "mixed_0p5hz_10hz.yaml").read_text()
    with tempfile.TemporaryDirectory() as folder:
        for length in (2.0, duration):
            path = Path(folder) / "scenario.yaml"
            path.write_text(
                text.replace("duration: 20 s", f"duration: {length} s").replace("settle: 10 s", "settle: 1 s")
            )
            scenario = testbed.load_scenario(path)
            spent.clear()
            begin = time.process_time()
            testbed.run(scenario, out=Path(folder) / "run")
            total = time.process_time() - begin
    mujoco = spent["turntable"]
    for label, seconds in sorted(spent.items(), key=lambda item: -item[1]):
        print(f"{label:<24}{seconds:8.3f} s CPU  {1e6 * seconds / (duration * 20_000):7.3f} us per base sample")
    print(f"{'anything else':<24}{total - sum(spent.values()):8.3f} s CPU")
    print(f"{'whole run':<24}{total:8.3f} s CPU for {duration:g} s: {duration / total:.1f} x real time")
    what = "run of a mixed second, three filters, all outputs, MuJoCo's stepping apart [CPU s]"
    conclude(Promise(what, 0.2, (total - mujoco) / duration))


if __name__ == "__main__":
    main(*map(float, sys.argv[1:]))
