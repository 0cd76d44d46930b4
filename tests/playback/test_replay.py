"""What a replay leaves: metrics with and without a reference, a folder like any other, the same for any block."""

from __future__ import annotations

import json
from types import SimpleNamespace

import numpy as np
import pytest

import testbed
from testbed.errors import ScenarioError
from tests.playback.conftest import LINES, SETTLE


def without_reference(folder):
    """Return the map of the run's sensors alone."""
    return {
        "file": folder / "run.nc",
        "channels": {name: {"column": f"sensors/{name}/rate"} for name in ("mhd_ars", "mems_gyro")},
    }


@pytest.fixture(scope="module")
def kept(bench, tmp_path_factory):
    """Return replays in folders, one with a reference and one without."""
    _, folder = bench
    place = tmp_path_factory.mktemp("kept")
    testbed.replay(folder, ["kalman", "wideband"], settle=SETTLE, lines=LINES, out=place / "with")
    testbed.replay([], ["kalman", "wideband"], map=without_reference(folder), out=place / "without")
    return place


def test_without_a_reference_no_error_is_known(kept):
    metrics = json.loads((kept / "without" / "metrics.json").read_text())
    assert metrics["seed"] is None
    assert metrics["replay"]["reference"] is False
    gyro, kalman = metrics["sensors"]["mems_gyro"], metrics["fusion"]["kalman"]
    assert "rmse_deg_s" not in gyro
    run = testbed.open_run(kept / "without")
    assert run.truth.n_time == run.commanded.n_time == 0
    late = np.degrees(run.sensors["mems_gyro"].rate[200:])  # a tenth of a second
    assert metrics["settle_s"] == 0.1
    assert gyro["mean_deg_s"] == pytest.approx(np.nanmean(late), rel=1e-9)
    assert gyro["spread_deg_s"] == pytest.approx(np.nanstd(late), rel=1e-9)
    assert gyro["missing"] == np.count_nonzero(np.isnan(late)) > 0
    claimed = np.degrees(run.fusion["kalman"].std[2000:])
    assert kalman["mean_std_deg_s"] == pytest.approx(np.sqrt(np.mean(claimed**2)), rel=1e-9)
    assert kalman["consistency"]["nees"] is None
    assert kalman["consistency"]["verdict"] is not None
    assert 0.5 < kalman["consistency"]["nis_mems_gyro"] < 2.0


def test_errors_are_those_of_the_signals(kept):
    run = testbed.open_run(kept / "with")
    error = np.degrees(run.fusion["kalman"].rate - run.truth.rate)[5000:]
    assert run.metrics.fusion["kalman"].rmse_deg_s == pytest.approx(np.sqrt(np.mean(error**2)), rel=1e-9)
    lost = np.degrees(run.sensors["mems_gyro"].rate - run.truth.rate[::10])[500:]
    assert run.metrics.sensors["mems_gyro"].rmse_deg_s == pytest.approx(np.sqrt(np.nanmean(lost**2)), rel=1e-9)


@pytest.mark.parametrize("name", ["with", "without"])
def test_the_folder_is_one_like_any_other(name, kept):
    folder = kept / name
    manifest = json.loads((folder / "manifest.json").read_text())
    files = {"report.html", "recording.rrd", "run.nc", "metrics.json", "scenario.yaml"}
    assert set(manifest["files"]) == files == {path.name for path in folder.iterdir()} - {"manifest.json"}
    run = testbed.open_run(folder)
    assert repr(run).startswith("<Run bench, 1 s, replayed") or name == "without"
    assert set(run.plot()) >= {"rates", "spectrum"}
    assert ("errors" in run.plot()) == (name == "with")
    assert list(run.to_pandas().index) == ["mhd_ars", "mems_gyro", "kalman", "wideband"]
    assert run.to_xarray()["fusion/kalman/rate"].size == 20_000
    assert "seed" not in run.to_xarray().attrs


def test_the_report_says_what_was_replayed(kept):
    for name in ("with", "without"):
        page = (kept / name / "report.html").read_text(encoding="utf-8")
        assert 'data-kind="channel" data-name="mems_gyro"' in page
        # A twentieth of its readings is lost.
        assert (
            '<tr data-kind="finding" data-name="mems_gyro"><th scope="row">mems_gyro</th><td class="text">gaps' in page
        )
        assert "Seed" not in page
        assert ("There is no reference" in page) == (name == "without")
        assert (">RMSE<" in page) == (name == "with")


def test_filters_of_a_replay_can_be_replayed_again(kept, bench):
    again = testbed.replay(bench[1], kept / "with" / "scenario.yaml")
    np.testing.assert_array_equal(
        again.fusion["wideband"].rate, testbed.open_run(kept / "with").fusion["wideband"].rate
    )


@pytest.mark.parametrize("block", [7, 4001, 20_000])
def test_any_block_gives_the_same_bits(block, bench):
    whole, parts = (testbed.replay([], ["kalman"], map=without_reference(bench[1]), block=n) for n in (10**6, block))
    for signal in whole.fusion["kalman"]:
        np.testing.assert_array_equal(parts.fusion["kalman"][signal], whole.fusion["kalman"][signal])
    assert parts.metrics.sensors["mhd_ars"].spread_deg_s == pytest.approx(
        whole.metrics.sensors["mhd_ars"].spread_deg_s, rel=1e-9
    )


def test_a_reference_with_a_gap_is_judged_where_it_is_known(bench, tmp_path):
    """Every second reading of the truth's own clock, and a tenth of a second lost."""
    run, folder = bench
    stamps, rate = np.arange(0, 20_000, 2), np.degrees(run.truth.rate[::2])
    kept_rows = ~((stamps >= 10_000) & (stamps < 12_000))
    lines = (f"{50_000 * t},{w!r}" for t, w in zip(stamps[kept_rows], rate[kept_rows].tolist(), strict=True))
    (tmp_path / "encoder.csv").write_text("t [ns],w [deg/s]\n" + "\n".join(lines) + "\n")
    said = without_reference(folder)
    said["channels"]["reference"] = {"file": tmp_path / "encoder.csv", "column": "w [deg/s]"}
    again = testbed.replay([], ["kalman"], map=said, settle=SETTLE)
    known = np.isfinite(again.truth.rate)
    np.testing.assert_array_equal(np.flatnonzero(~known), [*range(9_999, 12_000), 19_999])
    np.testing.assert_allclose(again.truth.rate[known], run.truth.rate[known], atol=1e-9)
    error = (again.fusion["kalman"].rate - again.truth.rate)[5000:]
    assert again.metrics.fusion["kalman"].rmse_deg_s == pytest.approx(
        np.degrees(np.sqrt(np.nanmean(error**2))), rel=1e-9
    )


@pytest.mark.parametrize(
    ("said", "message"),
    [
        ({"settle": 5.0}, "--settle: expected less than the 1 s of the recording"),
        ({"lines": [12e3]}, "--lines: expected frequencies below 10000 Hz"),
    ],
)
def test_what_makes_no_sense_is_refused(said, message, bench):
    with pytest.raises(ScenarioError, match=message):
        testbed.replay(bench[1], ["kalman"], **said)


@pytest.mark.parametrize(
    ("said", "message"),
    [
        ({"filters": ["calman"]}, "unknown filter 'calman'"),
        ({"belief": "eq93"}, "eq93"),
        ({"settle": -1.0}, "--settle: expected a time from 0 s on"),
        ({"lines": [-1.0, 10.0]}, r"--lines: expected frequencies above 0 Hz, got -1 Hz(.|\n)*need a reference"),
        ({"start": "moving"}, "--start: expected unknown or rest"),
        ({"outputs": ["reprot"], "out": "x"}, "unknown output 'reprot'"),
        ({"out": "taken"}, "taken: exists and is no folder of the testbed"),
    ],
)
def test_what_is_wrong_is_told_before_the_recording_is_read(said, message, bench, tmp_path, monkeypatch):
    """A record of hours takes minutes to read."""

    def read(_plans):
        pytest.fail("the recording was read")

    monkeypatch.setattr("testbed.playback.source.read_plans", read)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "taken").write_text("mine")
    with pytest.raises(ScenarioError, match=message):
        testbed.replay([], map=without_reference(bench[1]), **{"filters": ["kalman"], **said})


def test_outputs_without_a_folder_are_refused(bench):
    with pytest.raises(ValueError, match="outputs: expected only beside out"):
        testbed.replay(bench[1], ["kalman"], outputs=["metrics"])


def test_a_replay_that_its_disk_cannot_hold_is_refused_at_its_first_block(bench, tmp_path, monkeypatch):
    place = tmp_path / "run"
    testbed.replay(bench[1], ["kalman"], out=place)
    took = sum(path.stat().st_size for path in place.iterdir())
    monkeypatch.setattr("shutil.disk_usage", lambda _: SimpleNamespace(free=took // 2))
    with pytest.raises(ScenarioError, match=r"the run takes about .* GB, but its disk has room for"):
        testbed.replay(bench[1], ["kalman"], out=place)
    # Room for it by what it took, and half as much again.
    monkeypatch.setattr("shutil.disk_usage", lambda _: SimpleNamespace(free=round(1.5 * took)))
    testbed.replay(bench[1], ["kalman"], out=place)


def test_what_a_filter_refuses_is_told_by_its_name(bench):
    said = {"channels": {"mhd_ars": {"column": "sensors/mhd_ars/rate"}}}
    with pytest.raises(ScenarioError, match="blending: belief: expected two sensors") as error:
        testbed.replay(bench[1] / "run.nc", ["blending", "kalman", "wideband"], map=said)
    assert "kalman" not in str(error.value)


def test_an_interrupt_leaves_nothing_behind(bench, tmp_path):
    """A block is done, then the user stops it: an earlier folder there stays as it was."""

    def stop(_done):
        raise KeyboardInterrupt

    place = tmp_path / "kept"
    testbed.replay(bench[1], ["blending"], out=place, outputs=["metrics"])
    before = (place / "metrics.json").read_bytes()
    with pytest.raises(KeyboardInterrupt):
        testbed.replay(bench[1], ["kalman"], out=place, block=1000, progress=stop)
    assert [path.name for path in tmp_path.iterdir()] == ["kept"]
    assert (place / "metrics.json").read_bytes() == before
