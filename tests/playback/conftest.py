"""A run of a second, on disk and in memory, with lost readings in it."""

from __future__ import annotations

import pytest

import testbed

BENCH = {
    "name": "bench",
    "seed": 5,
    "duration": "1 s",
    "settle": "0.25 s",
    "ramp_in": "0.1 s",
    "turntable": {"engine": "modal"},
    "motion": [{"sine": {"frequency": "10 Hz", "rate": "1 deg/s"}}],
    # Not in the order of the alphabet, which files sort their groups by: the sums of a filter follow the order.
    "sensors": {
        "mhd_ars": {"preset": "sx300"},
        "mems_gyro": {"preset": "adis16505_filtered", "dropped": 0.05},
    },
    "fusion": {"kalman": {}, "arw_shakf": {}, "wideband": {}},
}
SETTLE, LINES = 0.25, [10.0]


@pytest.fixture(scope="session")
def bench(tmp_path_factory):
    """Return the run in memory, in which the diagnostics have all their digits, and its folder."""
    folder = tmp_path_factory.mktemp("bench") / "bench"
    testbed.run(BENCH, out=folder, outputs=["netcdf"])
    return testbed.run(BENCH), folder


@pytest.fixture(scope="session")
def scenario_file(bench):
    """Return the resolved scenario, whose filters have the beliefs and parameters of the run."""
    return bench[1] / "scenario.yaml"
