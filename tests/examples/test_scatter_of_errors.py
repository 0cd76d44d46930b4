"""The scatter of errors: quantiles in order, and a noisier sensor errs more."""

from __future__ import annotations

from testbed.scenario.loader import load_scenario
from tests.examples.programs import example


def test_a_noisier_sensor_errs_more():
    program = example("scatter_of_errors")
    scenario = load_scenario(program.SCENARIO).with_(
        duration="1 s", settle="0.5 s", expect=None, **{"turntable.engine": "modal", "fusion": {"kalman": {}}}
    )
    found = program.quantiles(scenario, 4)
    low, median, high = found["as it is"]["kalman"]
    assert low < median < high
    assert found["a noisy MHD ARS"]["kalman"][1] > high
