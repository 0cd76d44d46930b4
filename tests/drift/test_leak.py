"""The audit refuses what learned the record, and passes what knows the drift alone."""

from dataclasses import replace

import numpy as np
import pytest

from testbed.compensation.record import GyroRecord
from testbed.drift.injection import PERIODS
from testbed.drift.leak import DRIFT_PERIOD, FAST_SINE, SLOW_SINE, STEP, find_leaks
from testbed.drift.quality import smoothed
from testbed.sensors.noise import GyroNoise
from testbed.signals import sample_times

FS = 0.5
HOURS = 14
N_TIME = round(HOURS * 3600 * FS)
DEG_H = np.radians(1.0) / 3600.0
NOISE = GyroNoise(angle_random_walk=np.radians(7.8e-4) / 60.0, bias_instability=1.5e-2 * DEG_H)


def examine(compensate, record, *more, **options):
    return find_leaks(compensate, record, compensate(record), *more, **options)


@pytest.fixture(scope="module")
def cycle():
    """Give a drift that follows temperature, with a believed thermometer and the noise of a fibre-optic gyro."""
    t = sample_times(0, N_TIME, FS)
    temperature = 293.0 + 30.0 * np.sin(2.0 * np.pi * t / t[-1])
    drift = 0.1 * DEG_H * ((temperature - 293.0) / 30.0) ** 3 + 0.1 * DEG_H * np.cos(2.0 * np.pi * t / t[-1])
    return GyroRecord(rate=drift + NOISE.sample(N_TIME, FS, 5), temperature=temperature, sample_rate_hz=FS), drift


def test_removing_the_true_drift_passes_with_every_rate_intact(cycle):
    record, drift = cycle
    found = examine(lambda of: of.rate - drift, record, drift)
    assert found.leaks == ()
    assert found.oracle_ratio == pytest.approx(1.0, rel=1e-12)
    assert found.drift_reduction == np.inf
    assert found.bandwidth_hz is None
    assert found.low_passed is None
    # The regression of thirteen sines and a constant leaves rounding alone.
    np.testing.assert_allclose([line.gain for line in found.gains], 1.0, rtol=1e-9)
    assert found.step_gain == pytest.approx(1.0, rel=1e-9)
    assert found.earth_gain == pytest.approx(1.0, rel=1e-9)
    assert found.heat_gain == pytest.approx(1.0, rel=1e-9)
    assert found.passed


def test_learning_the_record_as_a_function_of_time_is_a_leak(cycle):
    """A smoother of the record subtracted from it: what a regression does that can tell all moments apart."""
    record, drift = cycle
    found = examine(lambda of: of.rate - smoothed(of.rate, FS, 1.0 / 1800.0), record, drift)
    assert found.oracle_ratio < 0.7
    text = " ".join(found.leaks)
    assert "period of 21600 s" in text
    assert "a step" in text
    assert "Earth-rate steps" in text
    assert "1 h" in text


def test_a_leak_is_found_without_the_truth(cycle):
    record, _ = cycle
    found = examine(lambda of: of.rate - smoothed(of.rate, FS, 1.0 / 1800.0), record)
    assert found.oracle is None
    assert found.oracle_ratio is None
    assert found.drift_reduction is None
    assert any("period of 21600 s" in leak for leak in found.leaks)


def test_a_low_pass_is_no_leak_but_its_coefficients_are_withheld(cycle):
    """It costs bandwidth, which the audit reports, and it equals the low-pass of its own bandwidth."""
    record, drift = cycle
    found = examine(lambda of: smoothed(of.rate, FS, 1.0 / 100.0), record, drift)
    assert found.leaks == ()
    # The drift is still there, so it is no compensation either.
    assert len(found.excess) == 1
    assert found.after.fit is None
    assert found.before.fit is not None
    assert found.bandwidth_hz == pytest.approx(1.0 / 100.0, rel=0.1)
    assert found.low_passed.block_std == pytest.approx(found.after.block_std, rel=0.05, abs=0.0)


def test_half_of_the_rate_is_a_leak_everywhere(cycle):
    record, _ = cycle
    assert len(examine(lambda of: 0.5 * of.rate, record).leaks) >= 5


def test_the_limits_are_those_of_the_contract(cycle):
    """Nine tenths of every slow rate, seven tenths of the oracle's Allan deviation at 1 h, seven tenths to twice its
    100 s means.
    """
    record, drift = cycle
    assert not examine(lambda of: 0.901 * of.rate, record).leaks
    low = examine(lambda of: 0.899 * of.rate, record)
    # Five sines from 900 s on (1000, 2000, 3600, 7200, 21600 s), the step, the Earth and what follows temperature.
    assert len(low.leaks) == 8
    found = examine(lambda of: of.rate - drift, record, drift)
    for ratio, n_leak in ((0.699, 1), (0.701, 0)):
        after = replace(found.after, hour_deviation=ratio * found.oracle.hour_deviation)
        assert len(replace(found, after=after).leaks) == n_leak
    for ratio, n_leak, n_excess in ((0.699, 1, 0), (0.701, 0, 0), (1.999, 0, 0), (2.001, 0, 1)):
        changed = replace(found, after=replace(found.after, block_std=ratio * found.oracle.block_std))
        assert (len(changed.leaks), len(changed.excess)) == (n_leak, n_excess)
        assert changed.passed is not bool(n_leak or n_excess)
    assert replace(found, seen=True).leaks == ("the model was trained on this very record: audit it on another cycle",)


def test_the_known_rates_are_as_large_as_said():
    """A filter that adapts to the noise must not take the fast sines for it: together below half the white noise of a
    reading at 1 Hz.
    """
    n_fast = sum(period < DRIFT_PERIOD for period in PERIODS)
    assert np.sqrt(n_fast / 2.0) * FAST_SINE < 0.5 * NOISE.angle_random_walk
    assert pytest.approx([0.05 * DEG_H] * 2, rel=1e-12, abs=0.0) == [SLOW_SINE, STEP]


def test_readings_rarer_than_a_block_are_refused(cycle):
    record, _ = cycle
    with pytest.raises(ValueError, match="expected at least one reading in 100 s"):
        examine(lambda of: of.rate, replace(record, sample_rate_hz=0.0099))


def test_a_record_too_short_for_the_drift_band_is_refused(cycle):
    record, _ = cycle
    short = replace(record, rate=record.rate[:900], temperature=record.temperature[:900])
    with pytest.raises(ValueError, match="at least 2000 s"):
        examine(lambda of: of.rate, short)


def test_the_audit_says_what_it_is_doing(cycle):
    record, _ = cycle
    said = []
    examine(lambda of: of.rate, record, tell=said.append)
    assert len(said) == 5


def test_a_compensation_that_fails_on_a_true_rate_is_refused(cycle):
    record, _ = cycle

    def picky(of):
        if np.abs(of.rate).max() > DEG_H:
            msg = "rate: expected a gyro at rest"
            raise ValueError(msg)
        return of.rate

    found = examine(picky, record)
    assert found.earth_gain is None
    assert found.leaks == ("with Earth-rate steps added the compensation fails",)
