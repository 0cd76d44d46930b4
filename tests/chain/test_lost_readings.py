"""A gyro with all its errors in a whole run: lost readings, temperature, keys from YAML, what `check` prints."""

from __future__ import annotations

import json

import numpy as np
import pytest

import testbed
from testbed.chain.instruments import _sense
from testbed.cli.terminal import print_metrics
from testbed.cli.understood import print_scenario
from testbed.errors import ScenarioError
from testbed.judging.table_facts import table_facts
from testbed.report.digest import _bridged
from testbed.sensors import load_preset
from testbed.sensors.stages import Surroundings
from tests.scenes import short

GYRO = "  mems_gyro: {preset: adis16505_filtered}"


def gyro(keys):
    return GYRO, f"  mems_gyro: {{preset: adis16505_filtered, {keys}}}"


def test_filters_predict_over_lost_readings_and_every_number_is_defined(tmp_path, capsys):
    scenario = short(tmp_path, gyro("dropped: 20 %"))
    run = testbed.run(scenario, out=tmp_path / "run")
    readings = run.sensors["mems_gyro"].rate
    lost = np.isnan(readings)
    # 1000 readings: 5 sqrt(p (1 - p) / n).
    assert lost.mean() == pytest.approx(0.2, abs=5 * np.sqrt(0.16 / 1000))
    row = run.metrics["sensors"]["mems_gyro"]
    assert row["missing"] == np.count_nonzero(lost[400:])
    error = (readings - run.truth.rate[::10])[400:]
    assert np.deg2rad(row["rmse_deg_s"]) == pytest.approx(np.sqrt(np.nanmean(error**2)), rel=1e-12)
    assert None not in (row["rmse_aligned_deg_s"], row["peak_error_deg_s"], row["lines"][0]["gain"])
    assert run.metrics["sensors"]["mhd_ars"]["missing"] == 0
    json.dumps(run.metrics.to_dict(), allow_nan=False)
    whole = testbed.run(short(tmp_path))
    for name in run.fusion:
        assert np.isfinite(run.fusion[name].rate).all()
        innovation = run.fusion[name].innovation_mems_gyro[::10]
        assert np.array_equal(np.isnan(innovation), lost)
        # The MHD ARS carries this signal; the lost readings of the gyro cost little.
        ratio = run.metrics["fusion"][name]["rmse_deg_s"] / whole.metrics["fusion"][name]["rmse_deg_s"]
        assert 0.5 < ratio < 2.0
    print_metrics(run.metrics, tmp_path / "run")
    assert f"mems_gyro: {row['missing']} readings lost" in capsys.readouterr().out
    assert (tmp_path / "run" / "report.html").stat().st_size > 10_000


def test_a_sensor_that_loses_everything_is_undefined_not_wrong(tmp_path):
    run = testbed.run(short(tmp_path, gyro("dropped: 100 %")))
    assert run.metrics["sensors"]["mems_gyro"]["rmse_deg_s"] is None
    assert np.isfinite(run.fusion["kalman"].rate).all()


def test_short_gaps_are_bridged_for_the_spectrum_and_long_ones_are_not():
    line = np.arange(100.0)
    gappy = line.copy()
    gappy[[0, 20, 21, 99]] = np.nan
    gappy[40:51] = np.nan
    got = _bridged(gappy)
    expected = line.copy()
    expected[0], expected[99], expected[40:51] = 1.0, 98.0, np.nan
    np.testing.assert_array_equal(got, expected)
    assert _bridged(line) is line
    assert np.isnan(_bridged(np.full(3, np.nan))).all()


def test_temperature_reaches_the_gyro_and_survives_the_round_trip(tmp_path):
    cold = gyro("noise: off, bias_temperature: 0.01 deg/s/K, scale_factor_temperature: 1 %/K")
    ramp = ("settle: 0.2 s", "settle: 0.2 s\ntemperature: {start: 25 degC, stop: 35 degC, over: 0.5 s}")
    still = ("sine: {frequency: 10 Hz, rate: 1 deg/s}", "static: {}")
    edits = [cold, still, ("preset: air_bearing", "mode: fixed"), ("  kalman: {}\n  arw_shakf: {}", "  kalman: {}")]
    scenario = short(tmp_path, *edits, ramp)
    run = testbed.run(scenario)
    assert np.array_equal(testbed.run(scenario, block=0.07).sensors["mems_gyro"].rate, run.sensors["mems_gyro"].rate)
    readings = np.rad2deg(run.sensors["mems_gyro"].rate)
    t = np.arange(1000) / 2000.0
    # A ramp of 0.2 deg/s per second through (154.537 s + 15.626) / (5.2175 s^2 + 148 s + 15.444): behind the pole at
    # 28.3 rad/s it lags by 1/28.3 s, the slow pole and zero at 0.1 rad/s nearly cancel: within 1 % of the final value.
    lagged = 0.2 * (t - (1.0 - np.exp(-28.26 * t)) / 28.26) * 154.537 / (5.2175 * 28.26)
    np.testing.assert_allclose(readings, lagged, rtol=0, atol=0.002)
    assert scenario.resolved()["temperature"] == {"start": "298.15 K", "stop": "308.15 K", "over": "0.5 s"}
    assert short(tmp_path, *edits).resolved()["temperature"] == "298.15 K"
    assert not testbed.run(short(tmp_path, *edits)).sensors["mems_gyro"].rate.any()


class Thermometer:
    """A stage with a fluid inside that reads the temperature: what an MHD sensor with temperature terms looks like."""

    def __init__(self):
        self.heights, self.last = np.zeros(1), np.nan

    def process(self, true_rate):
        raise NotImplementedError

    def process_in(self, true_rate, surroundings):
        if true_rate.size:
            self.last = surroundings.temperature[-1]
        return surroundings.temperature - surroundings.cross_rate[:, 0] + surroundings.specific_force[:, 2]

    def profile(self):
        return np.array([self.last])


def test_surroundings_are_cut_with_the_block():
    k = np.arange(1000.0)
    around = Surroundings(np.outer(k, [1, 0]), np.outer(k, [0, 0, 2]), 300 + k)
    readings, profile = _sense(Thermometer(), k, 100, around)
    assert np.array_equal(readings, 300 + 2 * k)
    # Pose samples of a block that starts at 100 are at 400, 800: its samples 300 and 700.
    assert profile is not None
    assert np.array_equal(profile[1][:, 0], [600.0, 1000.0])


def test_temperature_is_checked_with_its_line(tmp_path):
    with pytest.raises(ScenarioError, match=r"temperature.over.*expected more than 0"):
        short(tmp_path, ("settle: 0.2 s", "temperature: {start: 25 degC, stop: 35 degC, over: 0 s}"))
    with pytest.raises(ScenarioError, match=r"temperature.*unit is missing"):
        short(tmp_path, ("settle: 0.2 s", "temperature: 25"))


def test_a_tilted_gyro_feels_gravity_and_the_cross_axis_undoes_its_tilt(tmp_path):
    """Mode fixed: rate w about the vertical seen by an axis at (a, b) = (0, b): w cos b, and about its x -w sin b."""
    edits = [("preset: air_bearing", "mode: fixed"), ("  kalman: {}\n  arw_shakf: {}", "  kalman: {}")]

    def rate(keys):
        run = testbed.run(
            short(tmp_path, *edits, gyro(f"noise: off, mounting: {{misalignment: [0 mrad, 50 mrad]}}, {keys}"))
        )
        return run.sensors["mems_gyro"].rate

    plain, coupled = rate("dead_band: 0 deg/s"), rate("cross_axis: [10 %, 0]")
    np.testing.assert_allclose(coupled, plain * (1.0 - 0.1 * np.tan(0.05)), rtol=1e-9, atol=1e-15)
    # Gravity along the tilted x is -g sin b: a constant, which the low-pass raises to 154.537 / (5.2175 * 28.26) =
    # 1.048 of itself for the first seconds, before its slow pole lets go.
    leaning = (rate("g_sensitivity: [1 deg/s/g0, 0 deg/s/g0, 0 deg/s/g0]") - plain)[600:]
    np.testing.assert_allclose(np.rad2deg(leaning), -np.sin(0.05), rtol=0.06)


def test_a_gyro_off_the_axis_feels_the_turning_in_its_g_sensitivity(tmp_path):
    """Mode fixed, 0.1 m off along x: the tangential acceleration r dw/dt along y, here 10 Hz times 1 deg/s."""
    edits = [("preset: air_bearing", "mode: fixed"), ("  kalman: {}\n  arw_shakf: {}", "  kalman: {}")]
    keys = "g_sensitivity: [0 deg/s/g0, 1 deg/s/g0, 0 deg/s/g0], noise: off"

    def rate(x):
        scenario = short(tmp_path, *edits, gyro(f"mounting: {{position: [{x}, 0 m, 0 m]}}, {keys}"))
        return testbed.run(scenario).sensors["mems_gyro"].rate[400:]

    felt = rate("0.1 m") - rate("0 m")
    # 300 ms of 10 Hz are whole periods of a steady tone; what is left of the start decays within 2 %.
    gain = abs(load_preset("adis16505_filtered").response([10.0])[0])
    expected = np.deg2rad(1.0) / 9.80665 * 0.1 * 2 * np.pi * 10.0 * np.deg2rad(1.0) * gain / np.sqrt(2.0)
    assert np.sqrt(np.mean(felt**2)) == pytest.approx(expected, rel=0.02, abs=0)


def test_the_markov_bias_of_paper_1_is_a_key_of_its_own(tmp_path):
    markov = gyro("markov_bias: 2.7 deg/h, markov_time: 100 s, bias_instability: 0 deg/h")
    sensor = short(tmp_path, markov).sensors["mems_gyro"]
    assert sensor.markov_bias == pytest.approx(np.deg2rad(2.7 / 3600), rel=1e-12)
    assert set(sensor.noise_terms(20_000.0, 1, "g")) == {"angle_random_walk", "rate_random_walk", "markov_bias"}


def test_check_prints_the_data_sheet_of_the_gyro(tmp_path, capsys):
    scenario = short(tmp_path)
    print_scenario(scenario, table_facts(scenario))
    out = capsys.readouterr().out
    for text in (
        "0.15 deg/sqrt(h)",
        "0.0025 deg/s/sqrt(Hz)",
        "0.00353553 deg/s/sqrt(Hz)",
        "1.79356 deg/h",
        "0.1 deg/h/sqrt(h)",
    ):
        assert text in out
    assert "Allan deviation at 100 s" in out
