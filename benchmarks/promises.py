"""What a benchmark promises: each is printed with what was measured, and a miss is said by the exit status.

`python benchmarks/promises.py [NAME ...]` runs the benchmarks, all or some, from any folder, prints one table at the
end and exits with 1 if a promise was missed.
"""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
import tempfile
from dataclasses import asdict, dataclass
from pathlib import Path

FOLDER = Path(__file__).parent
# Where a benchmark that is run among others notes its promises.
NOTES = "TESTBED_BENCH_NOTES"
# What takes half an hour by itself, with fewer seeds or motions in the table of all.
SHORT = {"self_calibration": ["1", "kalman", "10 Hz", "0.01 deg/s at 10 Hz"], "verdict": ["4"]}


@dataclass(frozen=True)
class Promise:
    """A bound and what was measured: `at_most` tells on which side of the bound it has to be."""

    what: str
    bound: float
    measured: float
    at_most: bool = True

    @property
    def ratio(self) -> float:
        """Measured over promised, so that more than 1 is a miss; of a least bound what is not positive misses it."""
        if self.at_most:
            return self.measured / self.bound
        return self.bound / self.measured if self.measured > 0.0 else math.inf

    @property
    def kept(self) -> bool:
        """Whether it holds; what is not a number does not."""
        return self.ratio <= 1.0

    def row(self) -> str:
        """Return its line of the table."""
        side = "at most" if self.at_most else "at least"
        verdict = "" if self.kept else "   MISSED"
        return f"{self.what:<76}{side:>9} {self.bound:<10.4g}{self.measured:>10.4g}{self.ratio:>8.2f}{verdict}"


HEAD = f"{'promise':<86}{'bound':<10}{'measured':>10}{'ratio':>8}"


def conclude(*promises: Promise) -> None:
    """Print the promises of a benchmark, note them for the table of all, and exit with 1 if one was missed."""
    print(HEAD, *(one.row() for one in promises), sep="\n")
    if NOTES in os.environ:
        with Path(os.environ[NOTES]).open("a", encoding="utf-8") as stream:
            stream.writelines(json.dumps(asdict(one)) + "\n" for one in promises)
    sys.exit(not all(one.kept for one in promises))


def main(*names: str) -> None:
    """Run benchmarks one after the other and print one table."""
    scripts = [FOLDER / f"bench_{name}.py" for name in names] or sorted(FOLDER.glob("bench_*.py"))
    failed = []
    with tempfile.TemporaryDirectory() as folder:
        notes = Path(folder) / "notes"
        notes.touch()
        for script in scripts:
            print(f"== {script.stem}", flush=True)
            command = [sys.executable, str(script), *SHORT.get(script.stem.removeprefix("bench_"), [])]
            done = subprocess.run(command, env={**os.environ, NOTES: str(notes)}, check=False)
            failed += [script.stem] if done.returncode else []
        rows = [Promise(**json.loads(line)) for line in notes.read_text(encoding="utf-8").splitlines()]
    print("", HEAD, *(one.row() for one in rows), sep="\n")
    if failed:
        print(f"missed or failed: {', '.join(failed)}")
    sys.exit(bool(failed))


if __name__ == "__main__":
    main(*sys.argv[1:])
