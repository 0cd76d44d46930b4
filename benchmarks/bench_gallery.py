"""The gallery: every script of the site's build in at most 10 s.

Processor time of whole processes, the second of two, so that kernels are compiled.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
from pathlib import Path

from promises import Promise, conclude

ROOT = Path(__file__).parents[1]
MOST = 10.0


def seconds(script: Path) -> float:
    """Return the processor time of a script [s]."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    environment = {**os.environ, "MPLBACKEND": "agg", "PYTHONPATH": str(ROOT)}
    subprocess.run([sys.executable, "-W", "ignore", str(script)], check=True, capture_output=True, env=environment)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main() -> None:
    used = {}
    for script in sorted((ROOT / "examples" / "gallery").glob("plot_*.py")):
        used[script.stem] = [seconds(script) for _ in range(2)][1]
        print(f"{script.stem:<32}{used[script.stem]:6.1f} s", flush=True)
    slowest = max(used, key=lambda name: used[name])
    conclude(Promise(f"gallery: the slowest script, {slowest} [s]", MOST, used[slowest]))


if __name__ == "__main__":
    main()
