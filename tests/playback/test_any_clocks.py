"""Recordings whose clocks have no whole ratio, jitter, or were put right: the filters step from stamp to stamp."""

from __future__ import annotations

import numpy as np
import pytest

import testbed
from testbed.errors import ScenarioError
from testbed.fusion.analysis.finding import Finding, Verdict
from testbed.playback.export import FORMATS

N = 6000


def record(folder, gyro_ns, rng, jitter_ns=0.0):
    """Write a sine of 5 Hz as both sensors would read it without dynamics, each with its own stamps in nanoseconds."""
    stamps = {
        "mhd_ars": np.rint(50_000 * np.arange(N) + jitter_ns * rng.uniform(-1.0, 1.0, N)).astype(np.int64),
        "mems_gyro": gyro_ns[gyro_ns < 50_000 * N],
    }
    readings = {}
    for name, t in stamps.items():
        readings[name] = 0.01 * np.sin(10.0 * np.pi * 1e-9 * t) + 1e-5 * rng.standard_normal(t.size)
        rows = "".join(f"{k},{w!r}\n" for k, w in zip(t.tolist(), readings[name].tolist(), strict=True))
        (folder / f"{name}.csv").write_text(f"t [ns],w [rad/s]\n{rows}", encoding="utf-8")
    time = {"column": "t", "unit": "ns"}
    channels = {name: {"file": folder / f"{name}.csv", "column": "w", "time": time} for name in stamps}
    return {"channels": channels}, readings, stamps


CLOCKS = {
    "2003.704 Hz": np.rint(1e9 / 2003.704 * np.arange(700)).astype(np.int64),
    "6664 Hz": np.rint(1e9 / 6664.0 * np.arange(2100)).astype(np.int64),
    "a third of a millisecond late": 333_333 + 500_000 * np.arange(600),
}


@pytest.mark.parametrize("clock", CLOCKS)
def test_any_clock_gives_what_estimate_gives_of_the_same_stamps(clock, tmp_path, rng):
    said, readings, stamps = record(tmp_path, CLOCKS[clock], rng)
    run = testbed.replay([], ["kalman"], map=said)
    start = run.metrics.replay.start_ns
    kept = {name: stamps[name] >= start for name in stamps}
    found = testbed.estimate(
        "kalman",
        {name: readings[name][kept[name]] for name in stamps},
        time_ns={name: stamps[name][kept[name]] - start for name in stamps},
        sample_rate_hz={name: one.sample_rate_hz for name, one in run.sensors.items()},
    )
    np.testing.assert_array_equal(run.fusion["kalman"].rate, found.rate)
    np.testing.assert_array_equal(run.fusion["kalman"].std, found.std)
    np.testing.assert_allclose(run.fusion["kalman"].time, 1e-9 * found.time_ns, rtol=1e-15)
    parts = testbed.replay([], ["kalman"], map=said, block=777)
    for signal in run.fusion["kalman"]:
        np.testing.assert_array_equal(parts.fusion["kalman"][signal], run.fusion["kalman"][signal], err_msg=signal)


def test_a_jittering_clock_is_kept_and_its_folder_opens(tmp_path, rng):
    said, readings, stamps = record(tmp_path, CLOCKS["6664 Hz"], rng, jitter_ns=5_000.0)
    said["channels"]["reference"] = {**said["channels"]["mhd_ars"]}
    run = testbed.replay([], ["kalman"], map=said, out=tmp_path / "run")
    assert run.fusion["kalman"].stamped
    first = run.metrics.replay.start_ns
    base = stamps["mhd_ars"][stamps["mhd_ars"] >= first]
    np.testing.assert_allclose(run.sensors["mhd_ars"].time, 1e-9 * (base - first), atol=1e-15)
    np.testing.assert_allclose(run.truth.rate, readings["mhd_ars"][stamps["mhd_ars"] >= first], atol=1e-12)
    assert run.metrics.sensors["mhd_ars"].rmse_deg_s < 1e-9
    assert run.metrics.fusion["kalman"].rmse_deg_s is not None
    assert {"rates", "errors", "spectrum"} <= set(run.plot())
    assert (tmp_path / "run" / "recording.rrd").is_file()
    assert (tmp_path / "run" / "report.html").is_file()
    with pytest.raises(ScenarioError, match="expected clocks in whole ratios for a line of sight"):
        testbed.line_of_sight(tmp_path / "run", {"tracker": {"bandwidth": "5 Hz"}, "windows": ["10 ms"]})


@pytest.mark.parametrize("name", FORMATS)
def test_stamps_survive_every_format(name, tmp_path, rng):
    said, _, _ = record(tmp_path, CLOCKS["6664 Hz"], rng, jitter_ns=5_000.0)
    run = testbed.replay([], ["kalman"], map=said, out=tmp_path / "run", outputs=["netcdf"])
    made = testbed.export(tmp_path / "run", name, tmp_path / name)
    again = testbed.replay(made / "log.yaml", ["kalman"])
    for sensor, signals in run.sensors.items():
        # An even clock is told by its rate: its stamps are the same to their rounding.
        np.testing.assert_allclose(again.sensors[sensor].time, signals.time, atol=1.01e-9)
        np.testing.assert_array_equal(again.sensors[sensor].rate, signals.rate)
    # The mean rate of a jittering clock, which the variance of a reading follows, is found anew: one step shorter.
    np.testing.assert_allclose(again.fusion["kalman"].rate, run.fusion["kalman"].rate, atol=1e-7)


def test_a_filter_of_regular_steps_refuses_by_its_name(tmp_path, rng):
    said, _, _ = record(tmp_path, CLOCKS["6664 Hz"], rng)
    with pytest.raises(
        ScenarioError, match=r"self_calibrating: .*expected 20000 Hz to be an integer multiple"
    ) as error:
        testbed.replay([], ["kalman", "self_calibrating"], map=said)
    assert len(error.value.problems) == 1


def test_an_offset_that_is_put_right_moves_the_stamps(tmp_path, rng, monkeypatch):
    """20 ms late by the verdict: the readings are taken where they belong, between the steps of the other sensor."""
    said, readings, _ = record(tmp_path, 20_123_456 + 500_000 * np.arange(600), rng)
    late = Finding("offset", "mems_gyro", 0.020123456, 0.0200, 0.0202, "s", "time.offset: -20.1 ms in the map")
    monkeypatch.setattr("testbed.playback.judged.verdict", lambda *_: Verdict((late,)))
    fixed = testbed.replay([], ["kalman"], map=said, fix=True)
    assert fixed.metrics.findings[0].fixed
    # Put back to its own grid, the clocks are in a whole ratio again: the integer path.
    assert not fixed.fusion["kalman"].stamped
    there = readings["mems_gyro"].size
    np.testing.assert_array_equal(fixed.sensors["mems_gyro"].rate[:there], readings["mems_gyro"])
    assert np.isnan(fixed.sensors["mems_gyro"].rate[there:]).all()
