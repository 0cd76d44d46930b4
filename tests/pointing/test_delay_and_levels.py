"""The delay that a record shows, and levels with their intervals."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.stats import norm

from testbed.pointing.blend import butterworth_gains
from testbed.pointing.delay import DelayRegression
from testbed.pointing.levels import Levels
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
