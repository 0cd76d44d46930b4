"""Filters that see a run from a moment on, and sensors with faults, in whole runs."""

from __future__ import annotations

import json

import numpy as np
import pytest

import testbed
from testbed.errors import ScenarioError
from testbed.fusion import estimate
from testbed.fusion.analysis.bounds import run_bounds
from testbed.scenario.beliefs import believed
from tests.campaigns.test_evaluate import agrees, differences
from tests.scenes import SHORT, short

FAULTS = {
    "sensors.mhd_ars.faults": [{"kind": "stuck", "at": "0.25 s", "length": "50 ms"}],
    "sensors.mems_gyro.faults": [
        {"kind": "lost", "at": "0.1 s", "length": "30 ms"},
        {"kind": "rail", "at": "0.4 s", "length": "10 ms"},
    ],
}
OWN = """
import numpy as np
from testbed.fusion.base import EstimateBlock

class Last:
    def __init__(self, belief, sample_rate_hz, parameters):
        self.seen = 0
    def process(self, readings):
        z = readings["mhd_ars"]
        self.seen += z.size
        return EstimateBlock(0.0 * z, 0.0 * z + 1.0, {"seen": np.full(z.size, float(self.seen))})
"""


def late(tmp_path, **changes):
    return short(tmp_path).with_(fusion_from="0.15 s", **changes)


def test_the_estimate_is_that_of_the_readings_from_there_on(tmp_path):
    run = testbed.run(late(tmp_path))
    rates = {"mhd_ars": 20_000.0, "mems_gyro": 2000.0}
    seen = {name: run.sensors[name].rate[round(0.15 * fs) :] for name, fs in rates.items()}
    for name in run.fusion:
        found = run.fusion[name]
        assert np.isnan(found.rate[:3000]).all()
        assert np.isnan(found.std[:3000]).all()
        alone = estimate(name, seen, sample_rate_hz=rates, belief="eq39", start="unknown")
        assert np.array_equal(found.rate[3000:], alone.rate)
        assert np.array_equal(found.std[3000:], alone.std)
        metrics = run.metrics.fusion[name]
        assert (metrics.start, metrics.gated) == ("unknown", {"mhd_ars": 0, "mems_gyro": 0})
        error = (found.rate - run.truth.rate)[4000:]
        assert np.deg2rad(metrics.rmse_deg_s) == pytest.approx(np.sqrt(np.mean(error**2)), rel=1e-9)
    json.dumps(run.metrics.to_dict(), allow_nan=False)


@pytest.mark.parametrize("block", [0.01, 0.0333, 0.15, 0.2])
def test_any_block_length_gives_the_same_bits(tmp_path, block):
    scenario = late(tmp_path, **FAULTS)
    whole, cut = testbed.run(scenario), testbed.run(scenario, block=block)
    for name in whole.sensors:
        assert np.array_equal(whole.sensors[name].rate, cut.sensors[name].rate, equal_nan=True)
    for name in whole.fusion:
        for signal in ("rate", "std"):
            pair = getattr(whole.fusion[name], signal), getattr(cut.fusion[name], signal)
            assert np.array_equal(*pair, equal_nan=True)
    assert list(differences(cut.metrics.to_dict(), whole.metrics.to_dict())) == []


def test_evaluate_gives_the_metrics_of_a_run(tmp_path):
    scenario = late(tmp_path, fusion={"kalman": {}, "arw_shakf": {}, "wideband": {"start": "rest"}}, expect=None)
    agrees(scenario)
    agrees(scenario.with_(**FAULTS))


def test_cases_that_differ_in_the_onset_alone_do_not_share_a_filter(tmp_path):
    early, other = testbed.evaluate(short(tmp_path), [1], [{"fusion_from": "0.1 s"}, {"fusion_from": "0.2 s"}])
    assert early[0].fusion["kalman"].rmse_deg_s < other[0].fusion["kalman"].rmse_deg_s


def test_a_plug_in_begins_there_too_and_waits_undefined(tmp_path):
    (tmp_path / "own_late.py").write_text(OWN)
    text = SHORT.replace("  arw_shakf: {}", "  mine: {type: 'own_late:Last'}").replace("settle: 0.2 s", "settle: 0.3 s")
    (tmp_path / "s.yaml").write_text(text.replace("seed: 11", "seed: 11\nfusion_from: 0.15 s"))
    scenario = testbed.load_scenario(tmp_path / "s.yaml", plugins=[str(tmp_path / "own_late.py")])
    run = testbed.run(scenario, block=0.1, out=tmp_path / "run")
    seen = run.fusion["mine"].seen
    assert np.isnan(seen[:3000]).all()
    # Blocks end at 0.2, 0.3, ... s: it has seen what came since 0.15 s.
    assert [seen[k] for k in (3000, 4000, 9999)] == [1000.0, 3000.0, 7000.0]
    agrees(scenario, [3])


def test_the_optimum_begins_with_the_filters(tmp_path):
    scenario = late(tmp_path)
    run = testbed.run(scenario)
    belief = {name: believed(sensor) for name, sensor in scenario.sensors.items()}
    rates = {name: sensor.sample_rate for name, sensor in scenario.sensors.items()}
    amplitude = np.deg2rad(run.metrics.fusion["kalman"].optimum_rmse_deg_s)
    turned = run.truth.rate[4000:]
    t = np.arange(4000, 10_000) / 20_000.0
    line = 2.0 * abs(np.mean(turned * np.exp(-20j * np.pi * t)))
    found = run_bounds(belief, rates, [[(10.0, line)]], start="unknown", window=(0.05, 0.35))[0]
    assert amplitude == pytest.approx(found.rmse, rel=1e-4)


def test_metrics_begin_with_the_filters_unless_told_otherwise(tmp_path):
    text = SHORT.replace("settle: 0.2 s\n", "fusion_from: 0.15 s\n")
    path = tmp_path / "later.yaml"
    path.write_text(text)
    assert testbed.load_scenario(path).frame.settle == 0.15
    told = short(tmp_path).with_(fusion_from="0.15 s", **{"fusion.kalman.start": "rest"})
    assert [spec.parameters.start for spec in told.fusion.values()] == ["rest", "unknown"]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"fusion_from": "0.3 s"}, r"settle: expected at least 0\.3 s, where the filters begin"),
        ({"fusion_from": "0.5 s"}, r"fusion_from: expected less than the duration 0\.5 s"),
        ({"fusion_from": "50 us"}, "a time at which mems_gyro has a reading"),
        ({"sensors.mhd_ars.faults": [{"kind": "lost", "at": "0.5 s", "length": "1 s"}]}, r"within the run of 0\.5 s"),
        ({"sensors.mhd_ars.faults": [{"kind": "gone", "at": "0 s", "length": "1 s"}]}, "'lost', 'stuck' or 'rail'"),
        ({"sensors.mhd_ars.faults": [{"kind": "lost", "at": "0 s"}]}, "length"),
    ],
)
def test_what_does_not_fit_is_said_with_its_place(tmp_path, changes, message):
    with pytest.raises(ScenarioError, match=message):
        short(tmp_path).with_(**changes)


def test_a_mirror_is_fed_from_the_beginning(tmp_path):
    with pytest.raises(ScenarioError, match="expected none beside pointing"):
        late(tmp_path, pointing={"feed_forward": ["kalman"], "windows": ["10 ms"]}, expect=None)


def test_schema_and_resolved_scenario_know_both(tmp_path):
    from testbed.scenario.schema import schema

    properties = schema()["properties"]
    assert "fusion_from" in properties
    scenario = late(tmp_path, **FAULTS)
    assert testbed.Scenario.from_dict(scenario.resolved()).sensors == scenario.sensors
    assert testbed.Scenario.from_dict(scenario.resolved()).frame == scenario.frame
