"""What nothing gets below, and the reason where there is nothing."""

from __future__ import annotations

import numpy as np
import pytest

import testbed
from testbed.judging.bounds import Bounds, sees_constant
from testbed.sensors import load_preset
from tests.scenes import short_file

DEG = np.pi / 180.0
SENSORS = {"mems_gyro": load_preset("adis16505_filtered"), "mhd_ars": load_preset("sx300")}
RATES = {"base": 20000.0, "mems_gyro": 2000.0, "mhd_ars": 20000.0}
LINES = [(0.5, DEG), (10.0, DEG)]


@pytest.mark.parametrize("name", ["adis16505", "crs03", "fog_paper3"])
def test_a_gyro_sees_a_constant_rate(name):
    assert sees_constant(load_preset(name))


@pytest.mark.parametrize("name", ["sx300", "mhd03"])
def test_an_mhd_sensor_does_not(name):
    assert not sees_constant(load_preset(name))


def test_the_settled_optimum_is_not_below_the_floor_for_any_line():
    """The floor is what even a filter that sees the future leaves."""
    bounds = Bounds(SENSORS, RATES)
    floor = bounds.floor(1000.0)
    for lines in (LINES, [(0.1, DEG)], [(100.0, 0.01 * DEG)], [(500.0, DEG)]):
        (best,), why = bounds.settled([lines])
        assert why is None
        assert best.rmse >= floor


@pytest.mark.oracle
@pytest.mark.parametrize(("lowest", "expected"), [(0.01, 0.00048), (0.1, 0.00029)])
def test_a_prior_lowers_the_floor(lowest, expected):
    """Wiener's formula above that frequency, by an independent code: two digits."""
    floor = Bounds(SENSORS, RATES).prior_floor(1000.0, lowest)
    print(f"no rate below {lowest:g} Hz: {floor / DEG:.5f} deg/s")
    assert floor / DEG == pytest.approx(expected, rel=0.02, abs=0.0)
    assert floor < Bounds(SENSORS, RATES).floor(1000.0)
    assert Bounds(SENSORS, RATES).prior_floor(1000.0, None) is None


def test_without_a_constant_rate_there_is_a_reason_instead():
    alone = Bounds({"mhd_ars": SENSORS["mhd_ars"]}, RATES)
    assert "no sensor sees a constant rate" in alone.reason
    assert alone.floor(1000.0) is None
    assert alone.settled([LINES]) == alone.of_run([LINES], "rest", (1.0, 2.0)) == (None, alone.reason)
    assert alone.prior_floor(1000.0, 0.1) > 0.0


def test_a_noise_that_is_off_is_named():
    quiet = {**SENSORS, "mhd_ars": SENSORS["mhd_ars"].model_copy(update={"noise": False})}
    assert Bounds(quiet, RATES).reason == "the noise of mhd_ars is off"


@pytest.mark.parametrize(
    ("edits", "reason"),
    [
        ([("  mems_gyro: {preset: adis16505_filtered}\n", "")], "no sensor sees a constant rate"),
        ([("{preset: sx300}", "{preset: sx300, noise: off}")], "the noise of mhd_ars is off"),
        ([("sine: {frequency: 10 Hz, rate: 1 deg/s}", "static: {}")], "the signal has no lines"),
    ],
)
def test_a_run_says_why_it_has_no_bounds(edits, reason, tmp_path, capsys):
    from testbed.cli.terminal import print_metrics

    run = testbed.run(short_file(tmp_path, *edits))
    kalman = run.metrics.fusion["kalman"]
    assert reason in run.metrics.bounds_reason
    assert kalman.optimum_rmse_deg_s is None
    assert kalman.optimum_settled_deg_s is None
    print_metrics(run.metrics, tmp_path)
    assert reason in capsys.readouterr().out


def test_a_run_has_bounds_of_its_own_start_and_window(tmp_path):
    run = testbed.run(short_file(tmp_path, ("ramp_in: 0.1 s", "ramp_in: 0.1 s\nno_rate_below: 1 Hz")))
    kalman = run.metrics.fusion["kalman"]
    assert run.metrics.bounds_reason is None
    assert kalman.optimum_rmse_deg_s < kalman.optimum_settled_deg_s
    assert kalman.prior_floor_rmse_deg_s < kalman.floor_rmse_deg_s <= kalman.optimum_settled_deg_s
    assert kalman.lines[0].optimum_deg_s == pytest.approx(kalman.optimum_rmse_deg_s, rel=1e-9, abs=0.0)
