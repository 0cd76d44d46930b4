"""A benchmark that misses its promise says so by its exit status, from any folder, and all share one table."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
PROGRAM = "import sys; sys.path.insert(0, {folder!r}); from promises import Promise, conclude; conclude({promises})"


@pytest.mark.parametrize(
    ("promises", "status"),
    [
        ("Promise('a', 2.0, 1.0), Promise('b', 2.0, 3.0, at_most=False)", 0),
        ("Promise('a', 2.0, 1.0), Promise('b', 2.0, 2.1)", 1),
        ("Promise('b', 2.0, 1.9, at_most=False)", 1),
        ("Promise('a', 2.0, float('nan'))", 1),
        ("Promise('a lowest eigenvalue', 1e-17, -1e-16, at_most=False)", 1),
        ("Promise('hits', 3, 0, at_most=False)", 1),
    ],
)
def test_a_miss_is_said(tmp_path, promises, status):
    notes = tmp_path / "notes"
    code = PROGRAM.format(folder=str(BENCHMARKS), promises=promises)
    environment = {"TESTBED_BENCH_NOTES": str(notes), "PATH": ""}
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == status, done.stderr
    assert ("MISSED" in done.stdout) == bool(status)
    assert len([json.loads(line) for line in notes.read_text().splitlines()]) == promises.count("Promise")
