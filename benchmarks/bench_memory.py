"""Memory of `testbed run` against duration: peak resident set of whole processes.

Promise: a 10 min run needs no more than a 1 min run plus 20 %. Give durations in seconds as arguments; mode `fixed`
unless `servo` is among them.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

from promises import Promise, conclude

ROOT = Path(__file__).parents[1]
PROGRAM = (
    "import resource, sys\nfrom testbed.cli import main\n"
    "sys.argv = ['testbed', 'run', sys.argv[1], '--out', sys.argv[2]]\n"
    "try:\n    main()\nfinally:\n    print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)\n"
)


def peak_mb(duration: float, mode: str) -> float:
    text = (ROOT / "scenarios" / "mixed_0p5hz_10hz.yaml").read_text().split("expect:")[0]
    text = (
        text.replace("duration: 20 s", f"duration: {duration} s")
        .replace("settle: 10 s", "settle: 1 s")
        .replace("{preset: air_bearing}", f"{{mode: {mode}}}")
    )
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "scenario.yaml"
        path.write_text(text)
        done = subprocess.run(
            [sys.executable, "-c", PROGRAM, str(path), f"{folder}/run"], check=True, capture_output=True, text=True
        )
    return float(done.stdout.splitlines()[-1])


def main(*arguments: str) -> None:
    mode = "servo" if "servo" in arguments else "fixed"
    durations = [float(a) for a in arguments if a != "servo"] or [60.0, 600.0]
    peaks = {duration: peak_mb(duration, mode) for duration in durations}
    for duration, peak in peaks.items():
        print(f"{mode}, {duration:6g} s: peak {peak:7.1f} MB")
    first, last = peaks[durations[0]], peaks[durations[-1]]
    what = f"memory of a run of {durations[-1]:g} s over one of {durations[0]:g} s, mode {mode} [-]"
    conclude(Promise(what, 1.2, last / first))


if __name__ == "__main__":
    main(*sys.argv[1:])
