"""Cases played by several workers, each watched from outside: one that hangs or dies is a fault and is replaced."""

from __future__ import annotations

import collections
import json
import multiprocessing
import os
import sys
import tempfile
import time
from pathlib import Path
from queue import Empty

from tests.fuzz.cases import KINDS, case
from tests.fuzz.play import MOST_MEMORY, MOST_SECONDS, Result, fairly, memory, play
from tests.fuzz.texts import BASES, VALID

# A worker that says nothing for so long hangs where no signal reaches it [s].
_SILENCE = 300.0


def work(jobs, results, folder):
    """Play cases until there are no more; the memory of the imports does not count."""
    os.environ.pop("TESTBED_PLUGINS", None)
    path = Path(folder) / f"case_{os.getpid()}.yaml"
    for base in BASES:
        play("tree", base, path, 120.0)
    for kind in KINDS:
        play(kind, VALID.get(kind) or case(kind, 0), path, 120.0)
    base = memory()
    for kind, seed in iter(jobs.get, None):
        results.put((os.getpid(), kind, seed, None, 0))
        results.put((os.getpid(), kind, seed, fairly(kind, case(kind, seed), path), memory() - base))


class Table:
    """Counts what happened, and writes every fault down."""

    def __init__(self, out):
        self.out, self.counts, self.faults = out, collections.Counter(), []
        self.slowest, self.largest, self.spent, self.next = (0.0, ""), 0, 0.0, 0.0

    def add(self, kind, seed, result, grown):
        self.counts[kind, result.outcome] += 1
        self.spent += result.seconds
        self.largest = max(self.largest, grown)
        self.slowest = max(self.slowest, (result.seconds, f"{kind} {seed}"))
        if result.fault:
            self.faults.append({"kind": kind, "seed": seed, "fault": result.fault})
            print(f"{kind} {seed}: {result.fault.strip().splitlines()[-1][:200]}", flush=True)
            (self.out / f"{kind}_{seed}.yaml").write_text(case(kind, seed), errors="surrogatepass")
            (self.out / "faults.json").write_text(json.dumps(self.faults, indent=1))

    def progress(self):
        """Say now and then how far it got."""
        if time.monotonic() > self.next:
            print(f"{sum(self.counts.values())} cases, {len(self.faults)} faults", file=sys.stderr, flush=True)
            self.next = time.monotonic() + 30.0

    def show(self, seconds):
        total = sum(self.counts.values())
        print(f"{total} cases in {seconds:.0f} s, {1e3 * self.spent / max(total, 1):.1f} ms each")
        for (kind, outcome), number in sorted(self.counts.items()):
            print(f"  {kind} {outcome}: {number}")
        print(f"slowest {self.slowest[0]:.2f} s ({self.slowest[1]}), bar {MOST_SECONDS:g} s")
        print(f"memory {self.largest >> 20} MB above the imports, bar {MOST_MEMORY >> 20} MB")
        print(f"faults: {len(self.faults)}")


def run(kinds, cases, workers, first, out):
    """Play `cases` of all kinds together; return the table."""
    context = multiprocessing.get_context("spawn")
    jobs, results, table = context.Queue(), context.Queue(), Table(out)
    for i in range(cases):
        jobs.put((kinds[i % len(kinds)], first + i // len(kinds)))
    for _ in range(workers):
        jobs.put(None)
    with tempfile.TemporaryDirectory() as folder:
        living = {}

        def spawn():
            process = context.Process(target=work, args=(jobs, results, folder))
            process.start()
            living[process.pid] = [process, time.monotonic() + _SILENCE, None]

        for _ in range(workers):
            spawn()
        while sum(table.counts.values()) < cases:
            table.progress()
            now = time.monotonic()
            try:
                pid, kind, seed, result, grown = results.get(timeout=1.0)
            except Empty:
                pid = None
            if pid in living:
                living[pid][1:] = now, (kind, seed) if result is None and kind else None
                if result is not None:
                    table.add(kind, seed, result, grown)
            for pid, (process, heard, at) in list(living.items()):
                # One that ended by itself has done its part; its last words may still be on their way.
                if process.exitcode == 0 or (process.is_alive() and now - heard < _SILENCE):
                    continue
                process.kill()
                process.join()
                del living[pid]
                if at:
                    table.add(*at, Result("killed", now - heard, f"hung or died, exit code {process.exitcode}"), 0)
                spawn()
        for process, _, _ in living.values():
            process.kill()
            process.join()
    return table
