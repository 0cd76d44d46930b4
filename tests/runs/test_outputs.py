"""A run writes what is asked for, and says what it was told not to write."""

from __future__ import annotations

import json
import resource
import subprocess
import sys

import pytest

import testbed
from testbed.runs.outputs import OUTPUTS, chosen
from tests.scenes import short, short_file
from tests.shell import call

FILES = {"netcdf": "run.nc", "recording": "recording.rrd", "report": "report.html"}


def named(folder):
    return {path.name for path in folder.iterdir()} - {"manifest.json", "metrics.json", "scenario.yaml"}


@pytest.mark.parametrize("outputs", [["metrics"], ["netcdf"], ["recording"], ["report", "netcdf"], None])
def test_the_folder_holds_what_was_asked_for(tmp_path, outputs):
    run = testbed.run(short(tmp_path), out=tmp_path / "run", outputs=outputs)
    wanted = FILES if outputs is None else outputs
    assert named(run.folder) == {FILES[name] for name in wanted if name in FILES}
    everything = testbed.run(short(tmp_path)).metrics
    assert run.metrics.fusion == everything.fusion
    manifest = json.loads((run.folder / "manifest.json").read_text())
    assert manifest["outputs"] == list(chosen(outputs))


def test_a_run_without_signals_has_its_metrics_and_says_so(tmp_path):
    testbed.run(short(tmp_path), out=tmp_path / "run", outputs=["metrics"])
    run = testbed.open_run(tmp_path / "run")
    assert run.metrics.fusion["kalman"].rmse_deg_s > 0.0
    assert not run.sensors
    with pytest.raises(AttributeError, match="no signal 'rate'"):
        _ = run.truth.rate
    from testbed.report import write_report

    with pytest.raises(testbed.ScenarioError, match="without netcdf among its outputs; run it again with it"):
        write_report(tmp_path / "run")
    # A lost file is something else.
    testbed.run(short(tmp_path), out=tmp_path / "whole")
    (tmp_path / "whole" / "run.nc").unlink()
    with pytest.raises(testbed.ScenarioError, match=r"run\.nc is missing"):
        testbed.open_run(tmp_path / "whole")


def test_what_cannot_be_is_refused(tmp_path):
    with pytest.raises(testbed.ScenarioError, match="unknown output 'netcfd'; did you mean 'netcdf'"):
        testbed.run(short(tmp_path), out=tmp_path / "run", outputs=["netcfd"])
    with pytest.raises(testbed.ScenarioError, match="add netcdf"):
        testbed.run(short(tmp_path), out=tmp_path / "run", outputs=["report"])
    with pytest.raises(ValueError, match="beside out"):
        testbed.run(short(tmp_path), outputs=["metrics"])
    assert chosen(None) == OUTPUTS


@pytest.mark.parametrize(
    ("arguments", "status", "said"),
    [
        (("--outputs", "metrics, netcdf"), 0, ""),
        (("--outputs", "metric"), 2, "did you mean 'metrics'"),
        (("--outputs", "netcdf", "--view"), 2, "add recording"),
    ],
)
def test_the_command_takes_a_list(tmp_path, arguments, status, said):
    path = short_file(tmp_path)
    done = call("run", path, "--out", tmp_path / "run", "--quiet", *arguments, cwd=tmp_path)
    assert done.returncode == status, done.stderr
    assert said in done.stderr
    if not status:
        assert named(tmp_path / "run") == {"run.nc"}


PEAK = """
import resource, sys, testbed
testbed.run(sys.argv[1], out=sys.argv[2], outputs=["netcdf"])
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""


@pytest.mark.slow
def test_memory_is_flat_in_duration_with_out(tmp_path):
    """Six times the duration, at most 20 % more; in memory each second of it would take 14 MB."""
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss > 0
    peaks = []
    for seconds in (5, 30):
        mode = ("turntable: {preset: air_bearing}", "turntable: {mode: fixed}")
        path = short_file(tmp_path, ("duration: 0.5 s", f"duration: {seconds} s"), mode)
        command = [sys.executable, "-c", PEAK, str(path), str(tmp_path / f"run{seconds}")]
        peaks.append(float(subprocess.run(command, capture_output=True, text=True, check=True).stdout))
    assert peaks[1] < 1.2 * peaks[0]
