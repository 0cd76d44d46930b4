"""A sweep on a real scheduler with real workers, all on loopback, and what is killed of it."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from testbed.campaigns.store import CASES, read_cases
from testbed.campaigns.study import load_study
from testbed.campaigns.sweep import sweep
from tests.campaigns.test_study import written

pytestmark = pytest.mark.slow

POINTS, SEEDS = 20, 2
STUDY = f"vary: {{motion.0.sine.frequency: {{linear: [5 Hz, 40 Hz], points: {POINTS}}}}}\nseeds: {SEEDS}\n"
PATIENCE = 120.0


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Return the rows that one launch in one process gives."""
    folder = tmp_path_factory.mktemp("whole")
    return rows_of(sweep(load_study(written(folder, STUDY)), out=folder / "out"))


def rows_of(folder):
    return read_cases(folder).drop_columns("launch")


def finished(folder):
    """Return the cases and seeds that are on the disk."""
    if not (folder / CASES).is_dir() or not any((folder / CASES).glob("part-*")):
        return set()
    rows = read_cases(folder)
    return set(zip(rows["case"].to_pylist(), rows["seed"].to_pylist(), strict=True))


def until(condition):
    """Wait for a condition and return its value."""
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        if value := condition():
            return value
        time.sleep(0.05)
    msg = "waited in vain"
    raise AssertionError(msg)


class Cluster:
    """A scheduler and workers of one thread, each a process of its own, that find each other by a file."""

    def __init__(self, folder, workers):
        self._file = folder / f"scheduler-{time.monotonic_ns()}.json"
        common = ["--scheduler-file", str(self._file), "--host", "127.0.0.1", "--no-dashboard"]
        self.scheduler = self._start("dask_scheduler", *common, "--port", "0")
        until(self._file.exists)
        each = ["--nthreads", "1", "--no-nanny", "--local-directory", str(folder)]
        self.workers = [self._start("dask_worker", *common, *each) for _ in range(workers)]

    @staticmethod
    def _start(name, *words):
        command = [sys.executable, "-m", f"distributed.cli.{name}", *words]
        return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    @property
    def address(self):
        import json

        return json.loads(self._file.read_text())["address"]

    def stop(self):
        for process in (*self.workers, self.scheduler):
            process.kill()
            process.wait()


@contextlib.contextmanager
def cluster(folder, workers=2):
    one = Cluster(folder, workers)
    try:
        yield one
    finally:
        one.stop()


def launched(path, out, *words):
    command = [sys.executable, "-m", "testbed", "sweep", str(path), "--out", str(out), "--quiet", *words]
    return subprocess.Popen(command, stderr=subprocess.PIPE, text=True)


def test_a_worker_that_is_killed_in_mid_campaign_costs_nothing(whole, tmp_path):
    out = tmp_path / "out"
    with cluster(tmp_path) as found:
        parent = launched(written(tmp_path, STUDY), out, "--scheduler", found.address)
        until(lambda: finished(out))
        assert parent.poll() is None, "the campaign was over before anything was killed"
        found.workers[0].send_signal(signal.SIGKILL)
        _, said = parent.communicate(timeout=PATIENCE)
        assert parent.returncode == 0, said
    assert rows_of(out).equals(whole)
    assert set(read_cases(out)["launch"].to_pylist()) == {1}


def test_a_campaign_goes_on_after_its_scheduler_was_lost(whole, tmp_path):
    out, path = tmp_path / "out", written(tmp_path, STUDY)
    with cluster(tmp_path) as found:
        parent = launched(path, out, "--scheduler", found.address)
        before = until(lambda: finished(out))
        found.scheduler.send_signal(signal.SIGKILL)
        _, said = parent.communicate(timeout=PATIENCE)
    assert parent.returncode == 3, said
    assert "the scheduler was lost" in said
    assert "run the same command again" in said
    assert before <= finished(out)
    assert len(finished(out)) < POINTS * SEEDS, "the campaign was over before anything was killed"
    with cluster(tmp_path, workers=1) as found:
        again = launched(path, out, "--scheduler", found.address)
        _, said = again.communicate(timeout=PATIENCE)
        assert again.returncode == 0, said
    assert rows_of(out).equals(whole)
    assert set(read_cases(out)["launch"].to_pylist()) == {1, 2}


@pytest.mark.skipif(os.name != "posix", reason="forks of POSIX systems")
def test_a_parent_that_is_killed_at_20_random_moments_loses_nothing_that_was_finished(whole, tmp_path):
    """Each launch only adds, and the end is that of one launch. Three of four moments are from the first line on, the
    others from a part that was written on.
    """
    path, out = written(tmp_path, STUDY), tmp_path / "out"
    rng, before, ends = np.random.default_rng(3), set(), []
    command = [sys.executable, "-m", "tests.campaigns.killed", str(path), str(out)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as launches:
        for number in range(20):
            launches.stdin.write(f"{number % 4 // 3} {rng.uniform(0.0, 0.4)}\n")
            launches.stdin.flush()
            ends.append(launches.stdout.readline().strip())
            now = finished(out)
            assert before <= now
            before = now
        launches.stdin.close()
    assert set(ends) <= {"signal 9", "status 0"}
    assert "signal 9" in ends
    assert 0 < len(before) < POINTS * SEEDS
    last = launched(path, out)
    _, said = last.communicate(timeout=PATIENCE)
    assert last.returncode == 0, said
    assert rows_of(out).equals(whole)
    assert not [entry for entry in (out / CASES).iterdir() if not entry.name.startswith("part-")]
