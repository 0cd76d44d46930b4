"""The shipped scenarios meet their expectations."""

from __future__ import annotations

import pytest

import testbed
from tests.scenario.test_loader import SCENARIOS


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
