"""A clock of a sensor's own: when it reads, what it reads then, and what the logger writes."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from pydantic import ValidationError
from scipy.stats import chi2

from testbed.sensors import load_preset
from testbed.sensors.clock import OwnClock, Ticks, TickSampler, stamps_ns, ticks_of
from testbed.sensors.mems_gyro import MemsGyro
from testbed.signals import random_stream

DEG = np.pi / 180.0


def gyro(**changes):
    return load_preset("adis16505").model_copy(update={"noise": False, **changes})


def test_a_clock_that_is_fast_ticks_early():
    times = ticks_of(OwnClock(error=1852e-6), 2000.0, 1, "gyro").until(2.0)
    np.testing.assert_allclose(times, np.arange(times.size) / 2003.704, rtol=1e-15)
    assert times.size == 4008


def test_the_walk_has_its_size_after_a_second():
    """Two hundred clocks: the sum of squares is chi-squared."""
    clock = OwnClock(walk=1e-5)
    ends = np.array([ticks_of(clock, 100.0, seed, "gyro").until(1.05)[100] - 1.0 for seed in range(200)])
    low, high = chi2.ppf([1e-4, 1.0 - 1e-4], 200)
    assert low < np.sum((ends / 1e-5) ** 2) < high
    assert np.all(np.diff(ticks_of(OwnClock(walk=2e-3), 2000.0, 1, "gyro").until(2.0)) > 0.0)


def test_ticks_are_the_same_whatever_they_are_asked_for_in():
    whole = ticks_of(OwnClock(error=1e-4, walk=1e-5), 2000.0, 3, "gyro").until(5.0)
    parts = ticks_of(OwnClock(error=1e-4, walk=1e-5), 2000.0, 3, "gyro")
    assert np.array_equal(np.concatenate([parts.until(t) for t in (0.0, 0.3, 0.3001, 2.5, 5.0)]), whole)


@pytest.mark.oracle
def test_a_parabola_is_taken_exactly_and_a_sine_as_closely_as_said():
    t = np.arange(4000) / 20e3
    sampler = TickSampler(Ticks(OwnClock(), 2003.704, random_stream(1, "a")), 20e3)
    taken = sampler.process(1.0 + 3.0 * t + 50.0 * t * t)
    at = sampler.times
    np.testing.assert_allclose(taken[1:], (1.0 + 3.0 * at + 50.0 * at * at)[1:], rtol=1e-12)
    sampler = TickSampler(Ticks(OwnClock(), 2003.704, random_stream(1, "a")), 20e3)
    turn = 2.0 * np.pi * 200.0
    error = sampler.process(np.sin(turn * t)) - np.sin(turn * at)
    assert np.abs(error[1:]).max() < 0.0642 * (turn / 20e3) ** 3


def test_any_division_gives_the_same_bits_and_every_tick_once():
    w = random_stream(2, "w").standard_normal(5000)

    def sampler():
        return TickSampler(ticks_of(OwnClock(error=2e-5, walk=1e-6), 2000.0, 1, "gyro"), 20e3)

    whole, parts, times = sampler(), sampler(), []
    expected, found = whole.process(w), []
    for a, b in pairwise([0, 1, 2, 3, 40, 41, 1999, 2000, 5000]):
        found.append(parts.process(w[a:b]))
        times.append(parts.times)
    assert np.array_equal(np.concatenate(found), expected)
    assert np.array_equal(np.concatenate(times), whole.times)
    assert parts.process(w[:0]).size == parts.times.size == 0


def test_stamps_are_late_by_the_offset():
    assert stamps_ns(OwnClock(offset=1e-3), np.array([0.0, 1.0])).tolist() == [1_000_000, 1_001_000_000]
    assert stamps_ns(None, np.array([1.0 / 3.0])).tolist() == [333_333_333]


@pytest.mark.oracle
@pytest.mark.parametrize("changes", [{"sample_rate": 2003.704}, {"clock": OwnClock(error=1852e-6)}])
def test_a_gyro_reads_its_response_at_its_own_instants(changes):
    """Once settled, a sine of 40 Hz: what is left is that of the parabola and of the hold of the low-pass."""
    t = np.arange(20_000) / 20e3
    sensor, turn = gyro(**changes), 2.0 * np.pi * 40.0
    readings = sensor.start(20e3, 1, "g").process(DEG * np.sin(turn * t))
    at = sensor.ticks(1, "g").until(t[-1])
    expected = DEG * np.imag(sensor.response([40.0])[0] * np.exp(1j * turn * at))
    late = at > 0.5
    assert readings.size == at.size
    assert np.abs(readings - expected)[late].max() < 1e-4 * DEG


def test_a_clock_stays_where_noise_is_off_and_one_of_nothing_is_the_runs():
    """So that a noise-free twin reads at the same instants."""
    walking = gyro(clock=OwnClock(walk=1e-3))
    noisy = walking.model_copy(update={"noise": True})
    assert np.array_equal(walking.ticks(1, "g").until(0.1), noisy.ticks(1, "g").until(0.1))
    assert not gyro().clocked(20e3)
    assert gyro(sample_rate=6664.0).clocked(20e3)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"clock": {"walk": "5 ms"}}, "clock.walk: expected at most 0.00224 s at 2000 Hz"),
        ({"clock": {"error": "20 %"}}, "clock.error"),
        ({"clock": {"offset": "-1 ms"}}, "clock.offset"),
        ({"clock": {"error": "20 ppm"}, "jitter": "0.1 ms"}, "jitter: expected none beside a clock"),
    ],
)
def test_a_clock_that_is_none_is_refused(changes, message):
    given = {"sample_rate": "2 kHz", "corner": "300 Hz", "range": "100 deg/s"}
    with pytest.raises(ValidationError, match=message):
        MemsGyro.model_validate(given | changes, context={"border": True})
