"""Start of the command: what `testbed run SCENARIO --outputs metrics` takes until its progress is shown and the first
sample is simulated, over `import numpy, scipy, mujoco, numba`. Both are the CPU time that a process of its own has used
by then, read within it: one has started Python, loaded the libraries, read and checked the scenario, loaded compiled
functions and played 60 ms on trial for the forecast; the other has the four modules, of which scipy loads nothing else.

Promise: at most 1.5 times. Also printed: the start stage by stage; whole processes, from `--help` to a run of one
simulated second with all outputs; and where that run goes, by what each output and a further second add. Everything was
run once before, so that bytecode and compiled functions are cached; medians, and of the promise that of the ratios
within each turn.
"""

from __future__ import annotations

import json
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from importlib import import_module
from pathlib import Path

from promises import Promise, conclude

ROOT = Path(__file__).parents[1]
# Ends where the progress of the run would be shown.
UNTIL_IT_RUNS = """
import os, time
from testbed.cli import main
from testbed.cli.options import Output

def begin(*_):
    print(time.process_time(), flush=True)
    os._exit(0)

Output.progress = begin
main()
"""
LIBRARIES = "import time, numpy, scipy, mujoco, numba; print(time.process_time())"
# What is loaded, in an order in which each pays for what it brings along.
STAGES = {
    "command line: typer, rich": "testbed.cli.app testbed.cli.loading",
    "numpy, scipy, mujoco, numba": "numpy scipy mujoco numba",
    "scipy.linalg, scipy.optimize": "scipy.linalg scipy.optimize",
    "pint, with dask, which it imports": "pint",
    "the testbed's modules": "testbed.chain.forecast testbed.chain.runner testbed.cli.check_page testbed.cli.terminal "
    "testbed.scenario.loader",
}
RUN = ("-m", "testbed", "run")
METRICS, LONGER, NETCDF, RECORDING, ALL = (
    "run of 1 s: metrics",
    "run of 2 s: metrics",
    "run of 1 s: metrics, netcdf",
    "run of 1 s: metrics, netcdf, recording",
    "run of 1 s: all, report too",
)
WHOLE = {
    "--help": ("-m", "testbed", "--help"),
    "list": ("-m", "testbed", "list"),
    "check": ("-m", "testbed", "check", "1s.yaml"),
    METRICS: (*RUN, "1s.yaml", "--outputs", "metrics"),
    LONGER: (*RUN, "2s.yaml", "--outputs", "metrics"),
    NETCDF: (*RUN, "1s.yaml", "--outputs", "metrics,netcdf"),
    RECORDING: (*RUN, "1s.yaml", "--outputs", "metrics,netcdf,recording"),
    ALL: (*RUN, "1s.yaml"),
}


def said(*arguments: str, cwd: str) -> str:
    """Return what a Python process prints; it writes bytecode, as Python does unless it is told otherwise."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    command = [sys.executable, *arguments]
    return subprocess.run(command, check=True, capture_output=True, text=True, cwd=cwd, env=environment).stdout


def seconds(*arguments: str, cwd: str) -> float:
    """Return the CPU time of a whole process and its children [s]."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    said(*arguments, cwd=cwd)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def stages(path: str) -> dict[str, float]:
    """Go through the start of this process as a run does, and return the CPU time of each stage [s]."""
    spent = {"Python itself": time.process_time()}

    def lap(label: str) -> None:
        spent[label] = time.process_time() - sum(spent.values())

    with import_module("testbed.cli.loading").loading():
        for label, modules in STAGES.items():
            for module in modules.split():
                import_module(module)
            lap(label)
        scenario = import_module("testbed.scenario.loader").load_scenario(path)
        lap("scenario: read, checked, built")
        import_module("testbed.chain.forecast").forecast(scenario)
        lap("compiled functions: loaded, 60 ms played")
    return spent


def divided(start: float, whole: dict[str, float]) -> dict[str, float]:
    """Return where a run of one second with all outputs goes, by differences [s]."""
    second = whole[LONGER] - whole[METRICS]
    return {
        "start": start,
        "a second of MuJoCo, sensors and filters": second,
        "bounds and optimum, metrics, end": whole[METRICS] - start - second,
        "run.nc": whole[NETCDF] - whole[METRICS],
        "recording": whole[RECORDING] - whole[NETCDF],
        "report": whole[ALL] - whole[RECORDING],
    }


def write_scenarios(folder: str) -> None:
    """Write the mixed scenario, cut to one and two seconds, and without what it expects."""
    text = (ROOT / "scenarios" / "mixed_0p5hz_10hz.yaml").read_text().split("expect:")[0]
    for length in (1, 2):
        cut = text.replace("duration: 20 s", f"duration: {length} s").replace("settle: 10 s", "settle: 0.5 s")
        Path(folder, f"{length}s.yaml").write_text(cut)


def show(title: str, turns: list[dict[str, float]]) -> None:
    """Print the medians over the turns, the first of which filled the caches."""
    print(f"{title:<44}   CPU s")
    for label in turns[0]:
        print(f"  {label:<42}{statistics.median(turn[label] for turn in turns[1:]):8.3f}")


def main(repeats: int = 5) -> None:
    start = ("-c", UNTIL_IT_RUNS, "run", "1s.yaml", "--outputs", "metrics")
    with tempfile.TemporaryDirectory() as folder:
        write_scenarios(folder)
        starts, stage, whole, parts = [], [], [], []
        for _ in range(repeats + 1):
            libraries, begun = (float(said(*command, cwd=folder)) for command in (("-c", LIBRARIES), start))
            starts.append({"import numpy, scipy, mujoco, numba": libraries, "start of the command": begun})
            stage.append(json.loads(said(__file__, "stages", "1s.yaml", cwd=folder)))
            whole.append({label: seconds(*command, cwd=folder) for label, command in WHOLE.items()})
            parts.append(divided(begun, whole[-1]))
    show("until the work begins", starts)
    show("the start, stage by stage", stage)
    show("whole processes", whole)
    show("a run of 1 s with all outputs", parts)
    ratio = statistics.median(begun / libraries for libraries, begun in (turn.values() for turn in starts[1:]))
    conclude(Promise("start of the command over the import of numpy, scipy, mujoco, numba [-]", 1.5, ratio))


if __name__ == "__main__":
    if sys.argv[1:2] == ["stages"]:
        print(json.dumps(stages(sys.argv[2])))
    else:
        main()
