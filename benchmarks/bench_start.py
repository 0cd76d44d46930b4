"""Start-up: a 1 s scenario, the second time, against the import of the libraries that it needs; and `testbed --help`.

Promise: at most twice what importing its libraries takes; `--help` imports no heavy library. Whole processes, taken in
turn; medians of their own time, which others on the machine stretch but little, and of the ratio within each turn.
"""

from __future__ import annotations

import resource
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

from promises import Promise, conclude

LIBRARIES = "numpy, scipy, mujoco, numba"
ROOT = Path(__file__).parents[1]


def seconds(*command: str, cwd: str) -> float:
    """Return the CPU time of a process and its children [s]."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([sys.executable, *command], check=True, capture_output=True, cwd=cwd)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main(repeats: int = 7) -> None:
    text = (ROOT / "scenarios" / "mixed_0p5hz_10hz.yaml").read_text()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "one_second.yaml"
        path.write_text(
            text.replace("duration: 20 s", "duration: 1 s")
            .replace("settle: 10 s", "settle: 0.5 s")
            .replace("expect:", "description2:")
            .split("description2:")[0]
        )
        cases = {
            "import of the libraries": ("-c", f"import {LIBRARIES}"),
            "testbed run, 1 s": ("-m", "testbed", "run", str(path)),
            "testbed --help": ("-m", "testbed", "--help"),
        }
        times: dict[str, list[float]] = {label: [] for label in cases}
        for turn in range(repeats + 1):
            for label, command in cases.items():
                used = seconds(*command, cwd=folder)
                if turn:  # the first turn fills the caches
                    times[label].append(used)
    medians = {label: statistics.median(values) for label, values in times.items()}
    for label, value in medians.items():
        print(f"{label:<26}{value:7.2f} s CPU")
    pairs = zip(times["testbed run, 1 s"], times["import of the libraries"], strict=True)
    ratio = statistics.median(run / libraries for run, libraries in pairs)
    conclude(Promise("start: a run of 1 s over the import of numpy, scipy, mujoco, numba [-]", 1.5, ratio))


if __name__ == "__main__":
    main()
