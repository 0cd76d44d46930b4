"""Launches of a sweep that are killed: ``python -m tests.campaigns.killed STUDY OUT``, a line on stdin for each.

A line says how many parts are to be written first, and how much later it is killed [s]; how it ended is the answer.
Each launch is a fork of this process, which has the libraries loaded and no thread.
"""

from __future__ import annotations

import os
import signal
import sys
import time
from pathlib import Path

import testbed.campaigns.evaluate
import testbed.fusion.filters.kalman
import testbed.fusion.filters.steady_state  # noqa: F401 - what a launch would load
from testbed.campaigns.store import CASES
from testbed.campaigns.study import load_study
from testbed.campaigns.sweep import sweep
from tests.crash.driver import begin, end

PATIENCE = 120.0


def parts(out: Path) -> int:
    return len(list((out / CASES).glob("part-*")))


def main(path: Path, out: Path) -> None:
    for line in sys.stdin:
        more, moment = map(float, line.split())
        wanted, latest = parts(out) + more, time.monotonic() + PATIENCE
        child = begin(lambda _: sweep(load_study(path), out=out), 0, path.with_name("said.txt"))
        while parts(out) < wanted and time.monotonic() < latest:
            time.sleep(0.01)
        time.sleep(moment)
        os.kill(child, signal.SIGKILL)
        print(end(child), flush=True)


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:]))
