"""Paper 3's pipeline with modes of known content: what its steps do, and that training on the record itself removes
true rate.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import uniform_filter1d

from testbed.compensation.fading import fading_memory
from testbed.compensation.features import Features
from testbed.compensation.paper3 import PaperOptions, compensate
from testbed.compensation.record import GyroRecord
from testbed.compensation.training import block_means
from tests.compensation.thermal_record import DEG_H, cycle

GROUPS = (range(1), range(1, 2), range(2, 3))
QUICK = {"wolves": 12, "iterations": 8, "rows": 150}
TEMPERATURE, SLOPE = PaperOptions(**QUICK), PaperOptions(**QUICK, features=Features(degree=1, lags=()))


def split(rate):
    """Return noise, mixed and drift by moving means over 21 s and 900 s; they add up to the rate."""
    fast = uniform_filter1d(rate, 21, mode="nearest")
    slow = uniform_filter1d(uniform_filter1d(fast, 900, mode="nearest"), 900, mode="nearest")
    return np.stack([rate - fast, fast - slow, slow])


@pytest.fixture(scope="module")
def unseen():
    return cycle("up", 3)


def run(record, options):
    return compensate(record, options, modes=split(record.rate), groups=GROUPS)


def test_parts_add_up(unseen):
    result = run(unseen.record, TEMPERATURE)
    slow = split(unseen.record.rate)[2]
    assert np.array_equal(result.rate, result.filtered + slow - result.drift)
    assert result.sizes == (1, 1, 1)
    assert result.factor == 0.583
    assert result.search.evaluations == 12 * 8
    # Earth rate, the constant of 10 deg/h, is kept to the size of the drift itself.
    assert result.rate.mean() == pytest.approx(unseen.record.rate.mean(), abs=0.05 * DEG_H)


def test_noise_modes_are_filtered_or_left_out(unseen):
    kept, dropped = (
        run(unseen.record, PaperOptions(**QUICK, ratio=0.01, noise_modes=mode)) for mode in ("filter", "drop")
    )
    noise, mixed, _ = split(unseen.record.rate)
    assert np.array_equal(kept.filtered, fading_memory(mixed + noise, 0.583, 0.01)[0])
    assert np.array_equal(dropped.filtered, fading_memory(mixed, 0.583, 0.01)[0])
    assert np.array_equal(kept.drift, dropped.drift)


def test_training_on_the_record_removes_true_rate_and_so_fails_any_audit(unseen):
    """A sine of 6 h and 0.05 deg/h: with slope beside temperature the machine learns time, and less than a tenth
    survives.
    """
    t = np.arange(unseen.record.rate.size)
    rate = 0.05 * DEG_H * np.sin(2.0 * np.pi * t / 21_600.0)
    moved = GyroRecord(unseen.record.rate + rate, unseen.record.temperature, 1.0)
    gain = ((run(moved, SLOPE).rate - run(unseen.record, SLOPE).rate) @ rate) / (rate @ rate)
    assert gain < 0.1


def test_fitness_on_the_training_rows_drives_the_wolves_to_the_corner(unseen):
    """The largest gamma and a kernel far narrower than the features: least training error, not least error."""
    by_training, by_blocks = (
        run(unseen.record, PaperOptions(**QUICK, features=SLOPE.features, fitness=fitness)).search.point
        for fitness in ("training", "blocked")
    )
    assert by_training[0] > 9e4
    assert by_training[1] < 0.01
    assert by_blocks[1] > 1.0


def test_factor_and_ratio_can_be_given_or_chosen(unseen):
    given = run(unseen.record, PaperOptions(**QUICK, factor=None, ratio=1e-3))
    assert given.ratio == 1e-3
    assert given.factor != 0.583


def test_a_record_without_fast_part_has_nothing_to_filter(unseen):
    modes = np.stack([0.0 * unseen.record.rate, 0.0 * unseen.record.rate, unseen.record.rate])
    result = compensate(unseen.record, TEMPERATURE, modes=modes, groups=GROUPS)
    assert not result.filtered.any()
    left = block_means(result.rate, 100).std()
    assert left < block_means(unseen.record.rate, 100).std()


def test_modes_of_another_record_are_refused(unseen):
    with pytest.raises(ValueError, match="modes"):
        compensate(unseen.record, modes=np.zeros((3, 10)), groups=GROUPS)
