"""A sensor that is slow beside another, in its readings or its band: refused by name at check, or a run with figures.

Designs and bounds go over the cycle in which the readings repeat: 20 000 steps for 1 Hz beside 20 kHz, which once took
minutes and gigabytes at `check`.
"""

from __future__ import annotations

import time

import numpy as np
import pytest

import testbed
from testbed.chain.forecast import forecast
from testbed.errors import ScenarioError
from testbed.fusion import FILTERS
from testbed.fusion.schedule import MOST_STEPS
from testbed.scenario.model import Scenario

# What `check` may take [s], of this process.
PATIENCE = 5.0


def slow(rate, bandwidth, fusion):
    return {
        "name": "slow",
        "duration": "1.2 s",
        "settle": "0.2 s",
        "turntable": {"mode": "ideal"},
        "motion": [{"sine": {"frequency": "0.2 Hz", "rate": "1 deg/s"}}],
        "sensors": {
            "mhd_ars": {"preset": "sx300"},
            "mems_gyro": {"preset": "adis16505", "sample_rate": rate, "bandwidth": bandwidth},
        },
        "fusion": fusion,
    }


@pytest.mark.parametrize("rate", ["1 Hz", "10 Hz", "40 Hz", "100 Hz"])
@pytest.mark.parametrize("name", FILTERS)
def test_every_filter_is_built_beside_a_slow_sensor_or_refuses_in_seconds(name, rate):
    begin = time.process_time()
    try:
        forecast(Scenario.from_dict(slow(rate, "0.4 Hz", {name: {}})))
        refused = ""
    except ScenarioError as error:
        refused = str(error)
    if refused:
        assert f"fusion.{name}" in refused
        assert "`kalman` takes them" in refused
        assert 20_000 / float(rate.split()[0]) > MOST_STEPS
    assert time.process_time() - begin < PATIENCE


@pytest.mark.parametrize("rate", ["1 Hz", "200 Hz"])
@pytest.mark.parametrize("bandwidth", ["1e-300 Hz", "1e-29 Hz", "1e-3 Hz", "1e29 Hz"])
@pytest.mark.parametrize("belief", [{}, {"belief": "exact"}], ids=["data sheet", "exact"])
def test_a_slow_band_is_refused_or_runs_to_its_figures(rate, bandwidth, belief):
    """A bandwidth of 1e-300 Hz once ended in a LinAlgError of the optimum."""
    try:
        scenario = Scenario.from_dict(slow(rate, bandwidth, {"kalman": belief}))
    except ScenarioError:
        return
    begin = time.process_time()
    found = testbed.run(scenario).metrics.fusion["kalman"]
    # What hung took minutes; a filter of a new size compiles for up to 25 s.
    assert time.process_time() - begin < 40.0
    assert np.isfinite(found.rmse_deg_s)
    if rate == "1 Hz":
        assert found.optimum_settled_deg_s is None
