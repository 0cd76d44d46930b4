"""One unit for every rate that is shown of a run, and nothing below what its arithmetic resolves."""

from __future__ import annotations

import pytest

from testbed.runs.metrics import RunMetrics
from testbed.runs.table import error_unit, rate_text


def metrics(*errors):
    sources = {f"f{i}": {"rmse_deg_s": error} for i, error in enumerate(errors)}
    return RunMetrics(scenario="a", seed=1, duration_s=1.0, settle_s=0.0, sensors={}, fusion=sources)


@pytest.mark.parametrize(
    ("errors", "unit"),
    [((1e-5, 1e-4), "deg/h"), ((1e-5, 1e-3), "deg/s"), ((), "deg/s"), ((None,), "deg/s"), ((0.0,), "deg/s")],
    ids=["slow", "one fast", "none", "undefined", "exact"],
)
def test_the_unit_is_that_of_all_errors_together(errors, unit):
    assert error_unit(metrics(*errors))[0] == unit


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
