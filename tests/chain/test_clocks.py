"""Runs whose sensors have clocks of their own, from the table to the run folder."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from testbed import ScenarioError, evaluate, run
from testbed.runs.results import RunRecord
from testbed.scenario.loader import load_scenario
from testbed.scenario.model import Scenario

SHORT = {
    "name": "own_clock",
    "seed": 7,
    "duration": "0.6 s",
    "settle": "0.2 s",
    "turntable": {"mode": "ideal"},
    "motion": [{"sine": {"frequency": "4 Hz", "rate": "1 deg/s"}}],
    "sensors": {
        "mhd_ars": {"preset": "sx300"},
        "mems_gyro": {
            "preset": "adis16505",
            "clock": {"error": "1852 ppm", "walk": "1 us", "offset": "1 ms"},
            "lost": {"bursts": {"every": "0.1 s", "length": "10 ms"}},
        },
    },
    "fusion": {"kalman": {}, "arw_shakf": {}},
}


def changed(**changes: Any) -> Scenario:
    return Scenario.from_dict(SHORT).with_(**changes)


def test_a_run_does_not_depend_on_its_blocks() -> None:
    whole, parts = run(SHORT), run(SHORT, block=0.0137)
    for group, signals in whole.groups.items():
        assert set(signals) == set(parts.groups[group])
        assert all(np.array_equal(signals[name], parts.groups[group][name], equal_nan=True) for name in signals), group
    assert whole.fusion["kalman"].rate.size == 12_000
    assert whole.fusion["kalman"]["late_mems_gyro"][-1] == whole.fusion["kalman"]["late_mhd_ars"][-1] == 0.0


def test_the_time_of_a_sensor_is_its_stamps_and_its_error_that_of_its_instants(tmp_path: Any) -> None:
    """A perfect clock that is 1 ms late: the time shows it, the readings are those of the true instants."""
    quiet = {"preset": "adis16505", "noise": False}
    plain = run(changed(**{"sensors.mems_gyro": quiet}))
    late = run(changed(**{"sensors.mems_gyro": quiet | {"clock": {"offset": "1 ms"}}}), out=tmp_path / "late")
    gyro = RunRecord.open(tmp_path / "late").sensors["mems_gyro"]
    assert gyro.stamped
    n = gyro.n_time
    assert n in {1199, 1200}
    np.testing.assert_allclose(gyro.time, 1e-3 + np.arange(n) / 2000.0, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(gyro.rate, plain.sensors["mems_gyro"].rate[:n], rtol=0.0, atol=1e-12)
    there, here = (one.metrics.sensors["mems_gyro"] for one in (plain, late))
    assert here.rmse_deg_s == pytest.approx(there.rmse_deg_s, rel=2e-3)
    assert here.lines[0].gain == pytest.approx(there.lines[0].gain, rel=1e-3)
    # A filter that believes the stamps takes the gyro for 1 ms faster than it is.
    assert late.metrics.fusion["kalman"].rmse_deg_s > plain.metrics.fusion["kalman"].rmse_deg_s


def test_stamps_that_tell_the_truth_cost_no_accuracy() -> None:
    """Noise off, so that only the way of computing differs: 20000/2003.704 against 20000/2000."""
    quiet = {"preset": "adis16505", "noise": False}
    errors = [
        run(changed(**{"sensors.mems_gyro": quiet | more, "sensors.mhd_ars.noise": False})).metrics.fusion["kalman"]
        for more in ({}, {"sample_rate": "2003.704 Hz"}, {"clock": {"error": "1852 ppm", "walk": "1 us"}})
    ]
    assert [one.rmse_deg_s for one in errors] == pytest.approx([errors[0].rmse_deg_s] * 3, rel=0.01)


def test_evaluate_gives_the_metrics_of_the_runs() -> None:
    found = evaluate(Scenario.from_dict(SHORT), [7, 8])
    for one, seed in zip(found, (7, 8), strict=True):
        alone = run(SHORT, seed=seed).metrics
        assert one.fusion["kalman"].rmse_deg_s == alone.fusion["kalman"].rmse_deg_s
        assert one.sensors["mems_gyro"].missing == alone.sensors["mems_gyro"].missing > 0


def test_losses_are_those_of_evaluate_on_the_runs_clock_too() -> None:
    case = changed(**{"sensors.mems_gyro.clock": None})
    found = evaluate(case, [7])[0]
    assert found.sensors["mems_gyro"].missing == run(case).metrics.sensors["mems_gyro"].missing > 0


def test_bounds_of_nearly_whole_clocks_are_those_of_the_whole() -> None:
    assert run(SHORT).metrics.fusion["kalman"].optimum_rmse_deg_s is not None
    odd = run(changed(**{"sensors.mems_gyro.sample_rate": "6 kHz"})).metrics
    assert odd.fusion["kalman"].optimum_rmse_deg_s is None


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"sensors.mhd_ars.clock": {"error": "1 ppm"}}, "expected the fastest sensor"),
        ({"sensors.mhd_ars.sample_rate": "3 kHz"}, "expected the fastest sensor"),
        ({"fusion.own": {"type": "self_calibrating"}}, "SelfCalibrating takes readings at regular steps only"),
        ({"fusion_from": "0.1 s"}, "fusion_from: expected sensors on the clock of the run"),
        ({"pointing": {}}, "pointing: expected sensors on the clock of the run"),
        ({"sensors.fog": {"preset": "fog_paper3", "clock": {}}}, "fog reads at samples of the run only"),
    ],
)
def test_what_does_not_go_with_such_clocks_is_refused_by_name(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        changed(**changes)


def test_the_shipped_scenario_is_one(pytestconfig: pytest.Config) -> None:
    sensor = load_scenario(pytestconfig.rootpath / "scenarios/two_clocks.yaml").sensors["mems_gyro"]
    assert sensor.clocked(20e3)
    assert sensor.lost is not None
