"""The parts of one's own: short, and used as plug-ins as they stand."""

from __future__ import annotations

import pytest

import testbed
from testbed.scenario.loader import load_scenario
from tests.examples.programs import EXAMPLES
from tests.scenes import SHORT

PARTS = ["own_filter", "own_sensor", "own_motion"]


@pytest.mark.parametrize("name", PARTS)
def test_a_part_is_one_file_of_at_most_60_lines(name):
    lines = (EXAMPLES / f"{name}.py").read_text(encoding="utf-8").splitlines()
    assert len(lines) <= 60


def test_a_new_sensor_is_fused_at_once_under_a_new_motion_by_a_new_filter(tmp_path):
    """No preset, no belief written: `belief: exact` is enough for every filter."""
    text = SHORT
    for old, new in (
        ("mhd_ars: {preset: sx300}", "fast: {type: 'own_sensor:BandPass', sample_rate: 20 kHz}"),
        ("{preset: adis16505_filtered}", "{preset: adis16505}"),
        ("sine: {frequency: 10 Hz, rate: 1 deg/s}", "'own_motion:RingDown': {frequency: 25 Hz, rate: 1 deg/s}"),
        ("kalman: {}", "kalman: {belief: exact}\n  own: {type: 'own_filter:Blend', belief: exact}"),
        ("arw_shakf: {}", "wideband: {belief: exact}"),
    ):
        assert old in text
        text = text.replace(old, new)
    (tmp_path / "own.yaml").write_text(text, encoding="utf-8")
    scenario = load_scenario(tmp_path / "own.yaml", plugins=[str(EXAMPLES / f"{name}.py") for name in PARTS])
    metrics = testbed.run(scenario).metrics
    assert {row["belief"] for row in metrics["fusion"].values()} == {"exact"}
    # The ringing has 0.2 deg/s rms; a filter that was told another sensor's response would be off by that much.
    assert all(row["rmse_deg_s"] < 0.02 for row in metrics["fusion"].values()), metrics["fusion"]
