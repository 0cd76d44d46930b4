"""The fluid of a channel at a few instants: no slip at the walls, and the reading is minus the mean over the height."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.polynomial import chebyshev
from numpy.testing import assert_allclose

import testbed
from testbed.runs.block import POSE_STRIDE

RUN = {
    "name": "profiles",
    "duration": "0.8 s",
    "settle": "0.2 s",
    "turntable": {"engine": "modal"},
    "motion": [{"sine": {"frequency": "4 Hz", "rate": "1 deg/s"}}],
    "sensors": {"mhd_ars": {"preset": "sx300"}},
}


@pytest.fixture(scope="module")
def run():
    return testbed.run(RUN)


def test_instants_are_poses_from_settle_on_over_a_period_of_the_slowest_line(run):
    profile = run.metrics.profiles["mhd_ars"]
    index = np.array(profile.time_s) * run.truth.sample_rate_hz
    assert_allclose(index % POSE_STRIDE, 0.0, atol=1e-6)
    assert profile.time_s[0] == pytest.approx(0.2)
    assert len(profile.time_s) == 6
    # Six instants at whole poses: a period of 0.25 s in steps of 0.04 s.
    assert np.ptp(profile.time_s) == pytest.approx(5 * 0.04)
    assert_allclose(profile.wall_deg_s, np.degrees(run.truth.mhd_ars_rate[index.round().astype(int)]), rtol=1e-5)


@pytest.mark.oracle
def test_the_fluid_sticks_to_the_walls_and_its_mean_is_minus_the_reading_of_the_channel(run):
    profile = run.metrics.profiles["mhd_ars"]
    height, slip = np.array(profile.height_m), np.array(profile.slip_deg_s)
    assert_allclose(slip[:, [0, -1]], 0.0, atol=1e-12)
    channel = testbed.load_preset("sx300").warm_channel
    out = np.degrees(channel.simulate(run.truth.mhd_ars_rate, run.truth.sample_rate_hz))
    x = 2.0 * height / height[-1] - 1.0
    for time, values in zip(profile.time_s, slip, strict=True):
        whole = chebyshev.chebint(chebyshev.chebfit(x, values, x.size - 1))
        mean = (chebyshev.chebval(1.0, whole) - chebyshev.chebval(-1.0, whole)) / 2.0
        # Six digits are kept, and 81 of the heights; half of the heights leave 1e-5 of a layer of this thickness.
        assert -mean == pytest.approx(out[round(time * run.truth.sample_rate_hz)], abs=2e-5)


def test_a_run_without_a_channel_or_without_a_pose_after_settle_has_none():
    gyro = {**RUN, "duration": "0.1 s", "settle": "0.05 s", "sensors": {"g": {"preset": "adis16505_filtered"}}}
    assert "profiles" not in testbed.run(gyro).metrics
    late = {**RUN, "duration": "0.03 s", "settle": "0.025 s"}
    assert "profiles" not in testbed.run(late).metrics
