"""Figures of a record: against closed forms of white noise and of a known low-pass."""

import numpy as np
import pytest

from testbed.allan import allan_deviation
from testbed.allan.fit import judge_fit
from testbed.drift.quality import assess, block_std, described_to, smoothed
from testbed.sensors.noise import GyroNoise
from testbed.signals import sample_times

FS = 1.0
HOURS = 12
N_TIME = HOURS * 3600
N = np.radians(7.8034e-4) / 60.0  # rad/sqrt(s)


def white(seed):
    return GyroNoise(angle_random_walk=N).sample(N_TIME, FS, seed)


def test_block_means_of_white_noise_have_its_variance_over_their_length():
    """Std N / sqrt(block); chi-square of 431 degrees of freedom, 4.5 standard deviations of it."""
    n_block = N_TIME // 100
    assert block_std(white(1), FS) == pytest.approx(N / 10.0, rel=4.5 / np.sqrt(2.0 * n_block), abs=0.0)


def test_an_incomplete_block_is_left_out():
    rate = np.concatenate([np.zeros(200), np.full(99, 1.0)])
    assert block_std(rate, FS) == 0.0


def test_hour_deviation_needs_four_hours():
    assert assess(white(2), FS, 1000.0).hour_deviation is not None
    assert assess(white(2)[: 4 * 3600 - 1], FS, 1000.0).hour_deviation is None


def test_noise_is_described_to_the_end_and_drift_cuts_the_range():
    """The thermal drift of a day, here a cubic, is none of the five terms but at long averaging times."""
    t = np.linspace(-1.0, 1.0, N_TIME)
    drift = np.radians(0.5) / 3600.0 * np.sin(60.0 * t**3)
    curve, bent = (allan_deviation(rate, FS) for rate in (white(3), white(3) + drift))
    assert described_to(curve) > 0.9 * curve.tau[-1]
    assert described_to(bent) < 0.3 * curve.tau[-1]


def test_the_range_stops_three_averaging_times_before_the_longest_that_fits():
    """Where the departure only begins to drown in the spread it still bends the coefficients."""
    t = np.linspace(-1.0, 1.0, N_TIME)
    curve = allan_deviation(white(3) + np.radians(0.5) / 3600.0 * np.sin(60.0 * t**3), FS)
    fitting = [k for k in range(8, curve.tau.size) if judge_fit(curve.between(0.0, curve.tau[k])).p_value >= 0.05]
    assert max(fitting) < curve.tau.size - 1
    assert described_to(curve) == pytest.approx(curve.tau[max(fitting) - 3], rel=0.002)


def test_low_pass_is_3_db_down_at_its_bandwidth_and_has_no_phase():
    bandwidth, t = 1.0 / 300.0, sample_times(0, N_TIME, FS)
    rate = np.sin(2.0 * np.pi * bandwidth * t)
    middle = slice(N_TIME // 4, -N_TIME // 4)
    np.testing.assert_allclose(smoothed(rate, FS, bandwidth)[middle], np.sqrt(0.5) * rate[middle], atol=1e-3)


def test_coefficients_are_withheld_where_the_noise_model_does_not_hold():
    """A low-pass leaves no white noise at short averaging times: the five terms cannot describe that."""
    smooth = assess(smoothed(white(4), FS, 0.02), FS, 2000.0)
    assert smooth.fit is None
    plain = assess(white(4), FS, 2000.0)
    assert plain.fit is not None
    assert plain.fit.angle_random_walk.lower < N < plain.fit.angle_random_walk.upper
