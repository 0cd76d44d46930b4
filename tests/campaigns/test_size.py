"""What a sweep takes is told before it begins: within a factor of two of what it then takes."""

from __future__ import annotations

import json
import re
import subprocess
import sys

import pytest
from typer.testing import CliRunner

from testbed.campaigns.size import Size, size_of, sweep_words, warm
from testbed.campaigns.study import load_study
from testbed.cli.app import app
from testbed.cli.designs import prove
from testbed.cli.options import Output
from testbed.fusion.checked import CheckedFilter
from tests.campaigns.test_study import written

# Sensors that vary cost each case its own search for the optimum, cases of unlike lengths their own simulation.
VARIED = """
vary:
  sensors.mems_gyro.angle_random_walk: {random: [0.1 deg/sqrt(h), 1 deg/sqrt(h)], points: 2}
  duration: {linear: [1 s, 3 s], points: 3}
seeds: 12
"""
# Compiled first: that it takes longer then is said nowhere in numbers.
TAKEN = """
import json, resource, sys, time
from pathlib import Path
from testbed.campaigns.size import size_of, warm
from testbed.campaigns.study import load_study
from testbed.campaigns.sweep import sweep
study, out = load_study(sys.argv[1]), Path(sys.argv[2])
told = size_of(study)
begun = time.process_time()
sweep(study, out=out)
cpu = time.process_time() - begun
disk = sum(path.stat().st_size for path in out.rglob("*") if path.is_file())
memory = 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
print(json.dumps([[told.cpu_seconds, cpu], [told.memory_bytes, memory], [told.disk_bytes, disk]]))
"""
SAID = r"(\d+) cases?, at most (\d+) runs?, about \d+ s of processor time in \d+ s, \d+ MB of memory, [\d.]+ MB of disk"


@pytest.mark.slow
def test_what_is_told_is_within_a_factor_of_two_of_what_is_taken(tmp_path):
    """Processor time, memory and disk of a process that finds everything compiled."""
    path = written(tmp_path, VARIED)
    warm(load_study(path))
    launch = [sys.executable, "-c", TAKEN, str(path), str(tmp_path / "out")]
    done = subprocess.run(launch, check=True, capture_output=True, text=True)
    for name, (told, taken) in zip(("CPU s", "memory", "disk"), json.loads(done.stdout), strict=True):
        print(f"{name}: told {told:.3g}, taken {taken:.3g}")
        assert 0.5 < told / taken < 2.0, name


def test_time_and_memory_follow_the_number_of_workers(tmp_path):
    study = load_study(written(tmp_path, "vary: {duration: [0.2 s, 0.4 s]}\nseeds: 2\n"))
    one, two = size_of(study), size_of(study, 2)
    assert one.seconds == one.cpu_seconds
    assert two.seconds >= 0.5 * two.cpu_seconds
    assert two.memory_bytes > 2 * one.memory_bytes
    assert one.disk_bytes == two.disk_bytes
    assert (one.cases, one.runs) == (2, 4)


def test_with_a_clock_of_its_own_the_filters_are_tried_too(tmp_path, monkeypatch):
    """They take most of the time, and what they compile is to stand in the cache of the workers."""
    played, process = [], CheckedFilter.process
    monkeypatch.setattr(CheckedFilter, "process", lambda *given: played.append(given) or process(*given))
    study = load_study(written(tmp_path, "vary: {sensors.mems_gyro.clock.error: [300 ppm, 500 ppm]}\nseeds: 1\n"))
    warm(study)
    # Two filters in two cases, before the two that are timed.
    assert len(played) == 4
    assert size_of(study).cpu_seconds > 0.0
    assert len(played) == 4 + 4 + 4


def test_the_words_have_all_of_it():
    said = sweep_words(Size(3, 30, 40.0, 20.0, 300_000_000, 250_000))
    assert said == ("3 cases, at most 30 runs, about 40 s of processor time in 20 s, 300 MB of memory, 0.25 MB of disk")
    assert "about 20 min of processor time in 10 min" in sweep_words(Size(3, 30, 1200.0, 600.0, 1, 1))
    assert sweep_words(Size(1, 1, 1.0, 1.0, 1, 1)).startswith("1 case, at most 1 run, about 1 s")


def test_sweep_says_it_before_it_begins(tmp_path):
    path = written(tmp_path, "vary: {motion.0.sine.frequency: [5 Hz, 20 Hz]}\nseeds: 2\n")
    spoken = CliRunner().invoke(app, ["sweep", str(path), "--out", str(tmp_path / "out")])
    assert spoken.exit_code == 0
    said = re.search(SAID, spoken.stderr)
    assert said is not None
    assert said.groups() == ("2", "4")
    assert spoken.stderr.index("cases, at most") < spoken.stderr.index("runs, best")


def test_what_a_proof_takes_is_told_before_it_begins(tmp_path, monkeypatch, capsys):
    """`testbed design --prove` is a sweep of the chosen chain: one case."""
    study = load_study(written(tmp_path, "seeds: 2\n"))
    monkeypatch.setattr("testbed.design.proof.proof_study", lambda *_: study)
    monkeypatch.setattr("testbed.design.proof.read_proof", lambda *_: {})
    monkeypatch.setattr("testbed.campaigns.sweep.sweep", lambda *_, **__: print("began", file=sys.stderr))
    prove(None, None, tmp_path, seeds=2, workers=1, plugins=(), output=Output())
    said = re.search(f"{SAID}\nbegan", capsys.readouterr().err)
    assert said is not None
    assert said.groups() == ("1", "2")
