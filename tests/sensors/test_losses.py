"""Readings lost in bursts."""

from __future__ import annotations

import numpy as np

from testbed.sensors import load_preset
from testbed.sensors.losses import Bursts, Losses, LossStage
from testbed.signals import random_stream

LOSSES = Losses(bursts=Bursts(every=0.2, length=0.05))


def stage(seed=1):
    return LossStage(LOSSES, 1000.0, random_stream(seed, "lost"))


def test_the_share_and_the_lengths_are_those_asked_for():
    """About 2400 bursts: a mean of exponentials is known to 1 / sqrt(2400), four of which are 8 %."""
    lost = np.isnan(stage().process(np.zeros(600_000)))
    begins = np.count_nonzero(lost[1:] & ~lost[:-1])
    assert abs(lost.mean() / 0.2 - 1.0) < 0.1
    assert abs(600.0 / begins / 0.25 - 1.0) < 0.08
    # A whole number of readings, one at least, adds half of one at the most.
    assert abs(lost.sum() / begins / 50.0 - 1.0) < 0.08 + 0.01


def test_any_division_loses_the_same_readings():
    readings = random_stream(2, "r").standard_normal(5000)
    parts = stage()
    found = np.concatenate([parts.process(readings[a:b]) for a, b in ((0, 1), (1, 1), (1, 700), (700, 5000))])
    whole = stage().process(readings)
    assert np.array_equal(found, whole, equal_nan=True)
    there = np.isfinite(whole)
    assert np.array_equal(whole[there], readings[there])
    assert np.all(np.isfinite(readings))


def test_nothing_is_lost_where_noise_is_off_or_nothing_asked_for():
    gyro = load_preset("adis16505").model_copy(update={"lost": LOSSES})
    assert np.isnan(gyro.sample(np.zeros(20_000), 20e3)).any()
    for quiet in (gyro.model_copy(update={"noise": False}), gyro.model_copy(update={"lost": None})):
        assert np.all(np.isfinite(quiet.sample(np.zeros(20_000), 20e3)))
