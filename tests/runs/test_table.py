"""One unit for every rate that is shown of a run, and nothing below what its arithmetic resolves."""

from __future__ import annotations

import pytest

from testbed.runs.metrics import RunMetrics
from testbed.runs.table import error_unit, rate_text


@pytest.mark.parametrize("unit", ["deg/s", "deg/h"])
def test_the_unit_is_that_of_the_run(unit):
    metrics = RunMetrics(scenario="a", seed=1, duration_s=1.0, settle_s=0.0, sensors={}, fusion={}, rate_unit=unit)
    assert error_unit(metrics) == (unit, {"deg/s": 1.0, "deg/h": 3600.0}[unit])


def test_a_run_of_before_is_in_deg_s():
    assert (
        error_unit(RunMetrics(scenario="a", seed=1, duration_s=1.0, settle_s=0.0, sensors={}, fusion={}))[0] == "deg/s"
    )


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (4.073e-87, ("deg/s", 1.0), "below 1e-12 deg/s"),
        (0.0, ("deg/s", 1.0), "below 1e-12 deg/s"),
        (4e-87, ("deg/h", 3600.0), "below 3.6e-09 deg/h"),
        (2.5e-12, ("deg/s", 1.0), "2.5e-12 deg/s"),
        (0.001, ("deg/h", 3600.0), "3.6 deg/h"),
        (None, ("deg/s", 1.0), "- deg/s"),
    ],
)
def test_what_is_below_the_resolution_is_said_to_be(value, unit, text):
    assert rate_text(value, unit) == text
