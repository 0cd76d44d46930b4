"""The delay that a record shows, and levels with their intervals."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.signal import butter, freqz
from scipy.stats import norm

from testbed.pointing.blend import butterworth_gains
from testbed.pointing.delay import BAND_HZ, DelayRegression
from testbed.pointing.levels import Levels
from testbed.pointing.line_of_sight import LineOfSight
from testbed.pointing.parameters import PointingParameters
from testbed.pointing.tracking import Correction

FS = 20_000.0


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("planted", [100e-6, -50e-6])
def test_a_planted_delay_is_found(planted, seed):
    """Of a broad motion up to 100 Hz, beside as much noise again, within the 20 us of the issue; here within 2."""
    rng = np.random.default_rng(seed)
    n = 200_000
    t, gains = np.arange(n) / FS, butterworth_gains(10.0)
    freq, phase, size = rng.uniform(1.0, 100.0, 60), rng.uniform(0.0, 7.0, 60), 1e-6 * rng.random(60)

    def angle(at):
        return sum(a * np.sin(2 * np.pi * f * at + p) for a, f, p in zip(size, freq, phase, strict=True))

    rate = sum(a * 2 * np.pi * f * np.cos(2 * np.pi * f * t + p) for a, f, p in zip(size, freq, phase, strict=True))
    late = angle(t) - angle(t - planted)
    left = Correction(gains, FS, 1).process(late[None], np.ones(n, dtype=bool))[0]
    found = DelayRegression(gains, FS)
    for a, b in ((0, 7), (7, 90_000), (90_000, n)):
        found.process(left[a:b], rate[a:b], max(min(40_000 - a, b - a), 0))
    assert_allclose(found.delay, planted, atol=2e-6)


@pytest.mark.oracle
@pytest.mark.parametrize(("assumed", "planted"), [("600 us", 0.0), ("500 us", 100.0)])
def test_what_the_lead_leaves_at_third_order_is_found_as_delay(assumed, planted, rng):
    r"""The command leads by one derivative: 1 - M e^{-s tau} (1 + t s), of which the part along the rate grows with
    frequency. So it is no bias of the regression that finds more than the 100 us that were planted.
    """
    mirror = {"bandwidth": "1 kHz", "latency": "600 us", "lead": True, "assumed_latency": assumed}
    parameters = PointingParameters.model_validate({"mirror": mirror})
    n, gains = 160_000, butterworth_gains(10.0)
    t = np.arange(n) / FS
    freq, phase, rates = rng.uniform(1.0, 100.0, 60), rng.uniform(0.0, 7.0, 60), 1e-4 * rng.random(60)
    turns = 2.0 * np.pi * freq[:, None] * t + phase[:, None]
    rate = rates @ np.cos(turns)
    truth = (rates / (2.0 * np.pi * freq)) @ np.sin(turns), rate
    nothing, seen = np.zeros(n), np.ones(n, dtype=bool)
    sight = LineOfSight(parameters, gains, [], FS).process(truth, truth, {}, nothing, seen)
    found = DelayRegression(gains, FS)
    found.process(sight.residual, rate, 40_000)
    s = 2j * np.pi * freq
    left = 1.0 - parameters.mirror.dynamics.response(freq) * np.exp(-s * 600e-6) * (
        1.0 + sum(parameters.mirror.lead_times) * s
    )
    # Weighed as the regression does: by S and the band.
    b, a = butter(2, BAND_HZ, "bandpass", fs=FS)
    band = freqz(b, a, freq, fs=FS)[1]
    weight = np.abs(gains.sensitivity(freq) * band * rates) ** 2
    whole = np.sum(weight * (left / s).real) / np.sum(weight)
    print(f"assumed {assumed}: {1e6 * found.delay:.1f} us, by the transfer functions {1e6 * whole:.1f} us")
    assert_allclose(found.delay, whole, atol=1e-6)
    # (t D^2 / 2 - D^3 / 6 of the delay D and the lead t) w^2: 3 us at 20 Hz, 14 us at 45 Hz.
    assert planted + 3.0 < 1e6 * whole < planted + 20.0


def test_without_a_rate_there_is_no_delay():
    found = DelayRegression(butterworth_gains(10.0), FS)
    found.process(np.ones(100), np.zeros(100), 0)
    assert found.delay is None


def test_levels_of_white_noise_lie_in_their_intervals(rng):
    """Bins are 0.7 % wide; each interval of 95 % holds the truth in 95 of 100 records."""
    n, sigma, hit = 20_000, 3e-6, 0
    for _ in range(40):
        levels = Levels(n)
        error = sigma * rng.standard_normal(n)
        levels.process(error[:123])
        levels.process(error[123:])
        for row in levels.result():
            true = sigma * norm.ppf(0.5 + row["share"] / 2.0)
            hit += row["lower"] <= true <= row["upper"]
            assert_allclose(row["level"], true, rtol=0.1)
    # Binomial, 120 of 0.95: six standard deviations are 14.
    assert hit >= 100
