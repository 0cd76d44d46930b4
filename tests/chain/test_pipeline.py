"""The whole chain: blocks, seeds, clocks, what depends on what."""

from __future__ import annotations

import hashlib

import numpy as np
import pytest

import testbed
from testbed.errors import RunError
from tests.scenes import short


def signals(run):
    groups = {"commanded": run.commanded, "truth": run.truth}
    groups |= {f"sensors/{name}": group for name, group in run.sensors.items()}
    groups |= {f"fusion/{name}": group for name, group in run.fusion.items()}
    return {f"{group}/{name}": values[name] for group, values in groups.items() for name in values}


@pytest.mark.property
@pytest.mark.parametrize("block", [0.5, 0.1, 0.00735, 7.0])
def test_any_block_length_gives_the_same_bits(tmp_path, block):
    scenario = short(tmp_path)
    whole, parts = signals(testbed.run(scenario)), signals(testbed.run(scenario, block=block))
    assert whole.keys() == parts.keys()
    for name, values in whole.items():
        assert np.array_equal(values, parts[name], equal_nan=True), name


def test_one_sample_blocks_give_the_same_bits(tmp_path):
    scenario = short(tmp_path, ("duration: 0.5 s", "duration: 0.02 s"), ("settle: 0.2 s", "settle: 0.01 s"))
    whole, parts = signals(testbed.run(scenario)), signals(testbed.run(scenario, block=5e-5))
    assert all(np.array_equal(values, parts[name], equal_nan=True) for name, values in whole.items())


def test_the_seed_moves_the_noise_and_nothing_else(tmp_path):
    scenario = short(tmp_path)
    first, again, other = (
        signals(testbed.run(scenario)),
        signals(testbed.run(scenario)),
        signals(testbed.run(scenario, seed=12)),
    )
    assert all(np.array_equal(values, again[name], equal_nan=True) for name, values in first.items())
    assert np.array_equal(first["truth/rate"], other["truth/rate"])
    for name in ("mhd_ars", "mems_gyro"):
        assert not np.array_equal(first[f"sensors/{name}/rate"], other[f"sensors/{name}/rate"])


def test_another_sensor_or_filter_leaves_the_first_ones_as_they_were(tmp_path):
    """Streams belong to names: adding a gyro does not touch the noise of the other sensors."""
    alone = testbed.run(short(tmp_path, ("  arw_shakf: {}\n", "")))
    more = testbed.run(
        short(
            tmp_path,
            ("fusion:\n  kalman: {}\n  arw_shakf: {}\n", "  second: {preset: adis16505}\n"),
            ('expect:\n  kalman: {rmse_deg_s: "< 1"}\n', ""),
        )
    )
    for name in ("mhd_ars", "mems_gyro"):
        assert np.array_equal(alone.sensors[name].rate, more.sensors[name].rate)


def test_time_is_an_exact_multiple_of_the_step(tmp_path):
    run = testbed.run(short(tmp_path))
    assert np.array_equal(run.truth.time, np.arange(10_000) / 20_000.0)
    assert np.array_equal(run.sensors["mems_gyro"].time, np.arange(1_000) / 2_000.0)
    assert run.fusion["kalman"].rate.size == 10_000


def test_filters_know_readings_and_belief_only(tmp_path):
    """The same readings through `estimate` give what the chain gave: nothing else reached the filter."""
    from testbed.fusion import estimate

    run = testbed.run(short(tmp_path))
    est = estimate(
        "kalman",
        {name: group.rate for name, group in run.sensors.items()},
        sample_rate_hz={"mhd_ars": 20_000.0, "mems_gyro": 2_000.0},
        start="rest",
    )
    assert np.array_equal(est.rate, run.fusion["kalman"].rate)


def test_without_noise_the_truth_is_read_through_the_response(tmp_path):
    """Mode ideal, noise off: the indicated sine is `response` times the commanded one."""
    edits = [
        ("{preset: air_bearing}", "{mode: ideal}"),
        ("{preset: sx300}", "{preset: sx300, noise: off}"),
        ("duration: 0.5 s", "duration: 2 s"),
        ("settle: 0.2 s", "settle: 1 s"),
    ]
    scenario = short(tmp_path, *edits)
    line = testbed.run(scenario).metrics["sensors"]["mhd_ars"]["lines"][0]
    expected = scenario.sensors["mhd_ars"].response(np.array([10.0]))[0]
    # The ramp's transient decays with the corner of 2.5 Hz: exp(-15.6 * 0.9) = 1e-6 at the start of the metrics.
    assert line["gain"] == pytest.approx(abs(expected), rel=2e-5)
    assert line["phase_deg"] == pytest.approx(np.angle(expected, deg=True), abs=2e-3)


def test_a_block_of_no_length_is_refused(tmp_path):
    with pytest.raises(ValueError, match="block: expected more than 0 s"):
        testbed.run(short(tmp_path), block=0.0)


def test_a_run_without_sensors_or_filters_has_truth_only(tmp_path):
    head = (
        "sensors:\n  mhd_ars: {preset: sx300}\n  mems_gyro: {preset: adis16505_filtered}\nfusion:\n  kalman: {}\n "
        ' arw_shakf: {}\nexpect:\n  kalman: {rmse_deg_s: "< 1"}\n'
    )
    run = testbed.run(short(tmp_path, (head, "")))
    assert run.truth.rate.size == 10_000
    assert not run.sensors
    assert not run.fusion


OWN_FILTER = """
import numpy as np
from testbed.fusion import EstimateBlock

class Mine:
    def __init__(self, belief, sample_rate_hz, parameters):
        self.gain, self.lost = parameters["gain"], parameters.get("lost", 0)

    def process(self, readings):
        rate = self.gain * readings["mhd_ars"]
        return EstimateBlock(rate[: rate.size - self.lost], np.ones(rate.size), {})
"""


def test_a_users_own_filter_runs_from_yaml_and_its_shapes_are_checked(tmp_path):
    own = tmp_path / "own_pipeline_filter.py"
    own.write_text(OWN_FILTER)
    entry = "  arw_shakf: {type: own_pipeline_filter:Mine, gain: 2.0}"
    plugins = [str(own)]
    run = testbed.run(short(tmp_path, ("  arw_shakf: {}", entry), plugins=plugins))
    assert np.array_equal(run.fusion["arw_shakf"].rate, 2.0 * run.sensors["mhd_ars"].rate)
    (plugin,) = run.metrics["plugins"]
    assert plugin == {
        "name": "own_pipeline_filter",
        "version": None,
        "sha256": hashlib.sha256(OWN_FILTER.encode()).hexdigest(),
    }
    with pytest.raises(
        RunError, match=r"filter arw_shakf, block 1 .*: expected rate of shape \(10000,\), got \(9999,\)"
    ):
        testbed.run(short(tmp_path, ("  arw_shakf: {}", entry.replace("2.0", "2.0, lost: 1")), plugins=plugins))


FLOOR = "{floor: {bands: [{axis: rz, low: 2 Hz, high: 80 Hz, angular_acceleration_psd: 1e-6 (rad/s^2)^2/Hz}]}}"


def test_the_seed_moves_the_floor_and_blocks_do_not(tmp_path):
    scenario = short(tmp_path, ("{preset: air_bearing}", FLOOR))
    first, parts = testbed.run(scenario).truth.rate, testbed.run(scenario, block=0.0371).truth.rate
    other, quiet = testbed.run(scenario, seed=12).truth.rate, testbed.run(short(tmp_path)).truth.rate
    assert np.array_equal(first, parts)
    assert not np.array_equal(first, other)
    assert np.std(first - quiet) == pytest.approx(np.std(other - quiet), rel=0.9)
    assert 1e-6 < np.std(first - quiet) < 1e-3
