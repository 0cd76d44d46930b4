"""The shipped scenarios meet their expectations, and paper 1's Table II holds over seeds."""

from __future__ import annotations

import statistics
from dataclasses import replace

import numpy as np
import pytest

import testbed
from testbed.fusion import estimate
from testbed.scenario import BASE_RATE_HZ
from tests.test_loader import SCENARIOS

# Table II of paper 1 (doi 10.1109/TIM.2024.3375962), column "proposed" [deg/s]; the mixed signal from its text.
TABLE_II = {"single_0p5hz": 0.0098, "single_4hz": 0.0071, "single_10hz": 0.0039, "mixed_0p5hz_10hz": 0.0143}
SEEDS = range(1, 11)


@pytest.mark.slow
@pytest.mark.parametrize("path", SCENARIOS, ids=lambda p: p.stem)
def test_scenario_meets_its_expectations_with_margin(path):
    """At the scenario's seed every upper bound holds with 20 % to spare, every lower bound with 20 % above."""
    scenario = testbed.load_scenario(path)
    metrics = testbed.run(scenario).metrics
    assert scenario.expect
    for bound, row in zip(scenario.expect, metrics["expectations"], strict=True):
        margin = 0.8 if bound.relation.startswith("<") else 1.25
        assert row["met"], row
        assert bound.met(row["value"] / margin), f"no margin: {row}"


@pytest.fixture(scope="module")
def truths():
    """Return the truth of each judged signal, on the turntable: it does not depend on the seed, so it is computed once."""
    runs = {}
    for name in TABLE_II:
        scenario = testbed.load_scenario(next(path for path in SCENARIOS if path.stem == name))
        runs[name] = scenario, testbed.run(replace(scenario, fusion={}, expect=())).truth
    return runs


def rmse_over_seeds(truths, signal, method):
    """Return the RMSE [deg/s], phase included, after settle, of one filter with its default parameters for every seed."""
    scenario, truth = truths[signal]
    rates = {name: sensor.sample_rate for name, sensor in scenario.sensors.items()}
    late = truth.time >= scenario.frame.settle
    values = []
    for seed in SEEDS:
        readings = {
            name: sensor.start(BASE_RATE_HZ, seed, name).process(truth[f"{name}_rate"])
            for name, sensor in scenario.sensors.items()
        }
        error = estimate(method, readings, sample_rate_hz=rates).rate - truth.rate
        values.append(float(np.rad2deg(np.sqrt(np.mean(error[late] ** 2)))))
    return values


@pytest.mark.slow
@pytest.mark.parametrize("method", ["kalman", "arw_shakf", "arw_shakf_literal"])
def test_one_parameter_set_meets_table_ii_on_all_four_signals(truths, method):
    """Paper 1's own column, against the physics of table and sensors: median over ten seeds, and no seed beyond it by half."""
    for signal, limit in TABLE_II.items():
        values = rmse_over_seeds(truths, signal, method)
        print(
            f"{method} {signal}: median {statistics.median(values):.4f}, worst {max(values):.4f} deg/s, paper {limit}"
        )
        assert statistics.median(values) <= limit
        assert max(values) <= 1.5 * limit


@pytest.mark.slow
def test_shakf_tuned_at_0p5hz_fails_at_4_and_10_hz(truths):
    """The failure that the paper reports: more than ten times its own error at 0.5 Hz."""
    medians = {signal: statistics.median(rmse_over_seeds(truths, signal, "shakf")) for signal in TABLE_II}
    print("shakf", medians)
    assert medians["single_0p5hz"] <= 0.0108  # Table II, column "SHAKF"
    assert medians["single_4hz"] >= 10 * medians["single_0p5hz"]
    assert medians["single_10hz"] >= 10 * medians["single_0p5hz"]
