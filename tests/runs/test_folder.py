"""The run folder: complete, readable by others, whole or not at all."""

from __future__ import annotations

import json

import numpy as np
import pytest
import xarray as xr

import testbed
from testbed.errors import RunError, ScenarioError
from testbed.notebook import open_run
from testbed.runs.atomic import write_text
from testbed.runs.folder import ESSENTIAL, RunFolder, failing_as_run_error, write_metrics
from testbed.scenario.loader import load_scenario
from tests.chain.test_pipeline import signals
from tests.scenes import short


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    folder = tmp_path_factory.mktemp("stored")
    scenario = short(folder)
    return scenario, testbed.run(scenario, out=folder / "run"), folder


def test_run_folder_is_complete_and_alone(stored):
    _, run, folder = stored
    assert {p.name for p in run.folder.iterdir()} == {*ESSENTIAL, "manifest.json", "recording.rrd", "report.html"}
    assert {p.name for p in folder.iterdir()} == {"run", "short.yaml"}


def test_stored_signals_equal_those_in_memory(stored):
    """Rates and angles bit for bit; diagnostics to the rounding of float32."""
    scenario, run, _ = stored
    memory, disk = signals(testbed.run(scenario)), signals(run)
    assert memory.keys() == disk.keys()
    for name, values in memory.items():
        kept = disk[name]
        assert np.array_equal(values.astype(kept.dtype), kept, equal_nan=True), name
        assert kept.dtype == np.float64 or name.startswith("fusion/"), name
    assert disk["fusion/kalman/rate"].dtype == disk["truth/mhd_ars_rate"].dtype == np.float64


def test_run_nc_opens_in_xarray_with_time_as_a_number_and_units_everywhere(stored):
    _, run, _ = stored
    for group in ("commanded", "truth", "sensors/mhd_ars", "sensors/mems_gyro", "fusion/kalman", "fusion/arw_shakf"):
        with xr.open_dataset(run.folder / "run.nc", group=group, engine="h5netcdf") as data:
            assert data.time.dtype == np.float64
            assert data.time.attrs["units"] == "s"
            assert all("units" in data[name].attrs for name in data.data_vars)
            assert data.rate.attrs["units"] == "rad/s"
            assert data.rate.dims == ("time",)
            assert data.rate.size == round(0.5 * data.attrs["sample_rate_hz"])


def test_metrics_json_has_the_documented_form_and_no_nan(stored):
    _, run, _ = stored
    text = (run.folder / "metrics.json").read_text()

    def refuse(constant):
        raise AssertionError(constant)

    metrics = json.loads(text, parse_constant=refuse)
    assert metrics == run.metrics
    assert {
        "scenario",
        "seed",
        "duration_s",
        "settle_s",
        "versions",
        "sensors",
        "fusion",
        "budget",
        "expectations",
    } <= metrics.keys()
    for entry in metrics["fusion"].values():
        assert {"rmse_deg_s", "rmse_aligned_deg_s", "floor_rmse_deg_s", "optimum_rmse_deg_s", "lines"} <= entry.keys()
        assert entry["lines"][0].keys() == {
            "frequency_hz",
            "gain",
            "gain_ci95",
            "phase_deg",
            "phase_ci95_deg",
            "error_deg_s",
            "optimum_deg_s",
        }
    assert 0.0 < metrics["fusion"]["kalman"]["optimum_rmse_deg_s"] < metrics["fusion"]["kalman"]["rmse_deg_s"]


def test_metrics_follow_from_the_stored_signals(stored):
    """The definition, recomputed from run.nc: rms of estimate minus truth over the part after settle."""
    _, run, _ = stored
    late = run.truth.time >= 0.2
    for name, group in run.fusion.items():
        error = (group.rate - run.truth.rate)[late]
        assert run.metrics["fusion"][name]["rmse_deg_s"] == pytest.approx(
            np.rad2deg(np.sqrt(np.mean(error**2))), rel=1e-12
        )
    gyro = run.sensors["mems_gyro"]
    error = (gyro.rate - run.truth.rate[::10])[gyro.time >= 0.2]
    assert run.metrics["sensors"]["mems_gyro"]["rmse_deg_s"] == pytest.approx(
        np.rad2deg(np.sqrt(np.mean(error**2))), rel=1e-12
    )


def test_the_stored_scenario_runs_again_to_the_same_bits(stored):
    _, run, _ = stored
    again = testbed.run(load_scenario(run.folder / "scenario.yaml"))
    assert np.array_equal(again.fusion["arw_shakf"].rate, run.fusion["arw_shakf"].rate)


def test_an_earlier_run_folder_is_replaced_whole(tmp_path):
    scenario, out = short(tmp_path), tmp_path / "run"
    testbed.run(scenario, out=out)
    testbed.run(scenario, out=out, seed=5)
    assert open_run(out).metrics["seed"] == 5
    assert {p.name for p in tmp_path.iterdir()} == {"run", "short.yaml"}


def test_an_empty_folder_is_taken_and_anything_else_is_refused(tmp_path):
    (tmp_path / "empty").mkdir()
    with RunFolder(tmp_path / "empty") as folder:
        (folder.path / "x").write_text("x")
        folder.finish()
    assert (tmp_path / "empty" / "x").exists()
    (tmp_path / "thesis").mkdir()
    (tmp_path / "thesis" / "chapter.tex").write_text("years of work")
    (tmp_path / "file").write_text("a file")
    for name in ("thesis", "file"):
        with pytest.raises(ScenarioError, match="is no folder of the testbed"):
            testbed.run(short(tmp_path), out=tmp_path / name)
    assert (tmp_path / "thesis" / "chapter.tex").read_text() == "years of work"


def test_a_place_that_cannot_be_written_is_refused(tmp_path):
    (tmp_path / "file").write_text("a file")
    with pytest.raises(ScenarioError, match="cannot be written"):
        testbed.run(short(tmp_path), out=tmp_path / "file" / "run")


def test_a_run_that_fails_leaves_nothing_behind(tmp_path, monkeypatch):
    def broken(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("testbed.runs.netcdf.NetcdfStore.write", broken)
    with pytest.raises(RunError, match=r"the disk is full; the run got as far as t = 0 s"):
        testbed.run(short(tmp_path), out=tmp_path / "run")
    assert [p.name for p in tmp_path.iterdir()] == ["short.yaml"]


def test_an_interrupted_run_leaves_nothing_behind_and_the_earlier_one_alone(tmp_path):
    scenario, out = short(tmp_path), tmp_path / "run"
    testbed.run(scenario, out=out)

    def interrupt(_done):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        testbed.run(scenario, out=out, seed=99, progress=interrupt)
    assert {p.name for p in tmp_path.iterdir()} == {"run", "short.yaml"}
    assert open_run(out).metrics["seed"] == 11


def test_open_run_says_what_is_missing(tmp_path):
    with pytest.raises(ScenarioError, match=r"expected a run folder, but .*scenario\.yaml, .*run\.nc, .*metrics\.json"):
        open_run(tmp_path)
    for name in ESSENTIAL:
        (tmp_path / name).write_text("{}")
    with pytest.raises(ScenarioError, match=r"metrics\.json: scenario: Field required"):
        open_run(tmp_path)
    least = {"scenario": "a", "seed": 1, "duration_s": 1.0, "settle_s": 0.0, "sensors": {}, "fusion": {}}
    (tmp_path / "metrics.json").write_text(json.dumps(least))
    with pytest.raises(ScenarioError, match=r"run\.nc: expected a complete NetCDF-4 file"):
        open_run(tmp_path)


def test_write_metrics_refuses_nan(tmp_path):
    with pytest.raises(ValueError, match="not JSON compliant"):
        write_metrics(tmp_path, {"rmse_deg_s": float("nan")})
    assert not list(tmp_path.iterdir())


def test_write_text_replaces_whole_or_not_at_all(tmp_path):
    path = tmp_path / "a.txt"
    write_text(path, "first")
    with pytest.raises(UnicodeEncodeError):
        write_text(path, "half \ud800")
    assert path.read_text() == "first"
    assert [p.name for p in tmp_path.iterdir()] == ["a.txt"]


def test_failures_of_the_file_system_name_their_cause():
    with pytest.raises(RunError, match=r"out could not be written: .*Read-only"), failing_as_run_error("out"):
        raise OSError(30, "Read-only file system")


def test_signals_name_what_there_is(stored):
    _, run, _ = stored
    with pytest.raises(AttributeError, match=r"no signal 'ratte' \(there are time, rate"):
        _ = run.sensors["mhd_ars"].ratte
    assert "rate" in dir(run.truth)
    with pytest.raises(KeyError):
        _ = run.truth["nothing"]
