"""Gain, offset and rate of one sensor against another: known ones come back, within their covariance."""

from __future__ import annotations

import math

import numpy as np
import pytest

from testbed.fusion.analysis.agreement import Pair
from testbed.fusion.analysis.paths import Grid, Trace
from testbed.fusion.belief import SensorBelief

FS, DURATION = 200.0, 20.0
# A low-pass of 3 Hz and one of 40 Hz, noise far apart.
SLOW = SensorBelief(numerator=(20.0,), denominator=(1.0, 20.0), output_noise=1e-3)
FAST = SensorBelief(numerator=(250.0,), denominator=(1.0, 250.0), output_noise=1e-5)
# Rates [rad/s] of a motion that is not one line.
LINES = ((0.7, 0.05, 0.3), (2.3, 0.04, 1.1), (6.1, 0.03, 2.0))


def read(belief, t, rng, lines=LINES):
    """Return readings [rad/s] at any times [s]: lines through the sensor in closed form, and white noise."""
    value = np.zeros(t.size)
    for freq, rate, phase in lines:
        G = complex(belief.realisation().response(np.array([freq]))[0])
        value += rate * np.imag(G * np.exp(1j * (2.0 * math.pi * freq * t + phase)))
    return value + belief.output_noise * math.sqrt(FS) * rng.normal(size=t.size)


def pair(seed, gain=1.0, offset=0.0, rate=0.0, lines=LINES, jitter=0.0):
    """Return the two sensors, the noisy one's stamps late by offset + rate t, its readings too large by the gain."""
    rng = np.random.default_rng(seed)
    t = np.arange(round(DURATION * FS)) / FS
    at = t + jitter * rng.normal(size=t.size)
    noisy = Trace(at + offset + rate * at, gain * read(SLOW, at, rng, lines), SLOW)
    return Pair(noisy, Trace(t, read(FAST, t, rng, lines), FAST))


@pytest.mark.oracle
@pytest.mark.parametrize(
    ("gain", "offset", "rate", "jitter"),
    [(1.0, 0.0, 0.0, 0.0), (-1.3, 0.02, 1852e-6, 0.0), (1.0, -0.05, -3e-3, 3e-4)],
)
def test_known_ones_come_back_with_their_covariance(gain, offset, rate, jitter):
    """Of 100 records the squares of the normed errors, 3 each, are chi-squared of 300: 99.9 % lie in (226, 387)."""
    total = 0.0
    for seed in range(100):
        found = pair(seed, gain, offset, rate, jitter=jitter).agreement()
        assert found.common
        # In stamps: t = t_true + offset + rate t_true.
        true = np.array([gain, offset + rate * (found.middle - offset) / (1.0 + rate), rate / (1.0 + rate)])
        error = np.array([found.gain, found.offset, found.rate]) - true
        total += float(error @ np.linalg.solve(found.covariance, error))
    assert 226.0 < total < 387.0


def test_noise_that_is_not_as_believed_widens_the_interval_by_itself():
    one = pair(1)
    wrong = Pair(one.noisy, one.clean)
    loud = Trace(one.noisy.t, one.noisy.z, SLOW.model_copy(update={"output_noise": 1e-4}))
    found, believed = Pair(loud, one.clean).agreement(), wrong.agreement()
    # The median of an octave scatters by some per cent, and weights change little.
    np.testing.assert_allclose(np.diag(found.covariance), np.diag(believed.covariance), rtol=0.2)


def test_small_common_motion_keeps_its_gain():
    """A line of the spectrum with a hundred times the noise's power, which over all frequencies is a fraction of it:
    regressed on the noisy path the gain would read far below one.
    """
    small = ((6.1, 1e-2, 2.0),)
    found = [pair(seed, lines=small).agreement() for seed in range(20)]
    gains = np.array([one.gain for one in found])
    std = math.sqrt(np.mean([one.covariance[0, 0] for one in found]) / len(found))
    assert abs(gains.mean() - 1.0) < 4.0 * std
    assert std < 0.02


def test_without_motion_nothing_is_common():
    assert [seed for seed in range(20) if pair(seed, lines=()).agreement().common] == []


def test_a_line_tells_no_shift_from_another_half_a_period_on():
    found = pair(3, lines=((2.3, 0.04, 1.1),)).agreement()
    half = 0.5 / 2.3
    # A tie of 3 % reaches 14 degrees to either side.
    assert half * (1.0 - 2.0 * 14.1 / 180.0) - 2.0 / FS <= found.ambiguity <= half
    assert pair(3).agreement().ambiguity > half


def test_a_response_that_is_another_departs():
    """A first order of 3 Hz believed to be of 5 Hz: at 6.1 Hz, against the rest."""
    one = pair(4)
    wrong = SensorBelief(numerator=(33.0,), denominator=(1.0, 33.0), output_noise=1e-3)
    found = Pair(Trace(one.noisy.t, one.noisy.z, wrong), one.clean).agreement()
    assert found.departure > 0.05
    assert one.agreement().departure < 0.05


@pytest.mark.parametrize("fs", [200.0, 1000.0, 20_000.0])
def test_a_path_is_the_reading_through_the_other_sensor(fs):
    """Lines in closed form, a second away from the ends; the spline errs by (pi f / fs)^4 at the most."""
    t = np.arange(round(8.0 * fs)) / fs
    rng = np.random.default_rng(0)
    silent = SLOW.model_copy(update={"output_noise": 0.0})
    trace = Trace(t, read(silent, t, rng), silent)
    grid = Grid(trace, trace)
    inside = (grid.t > 1.5) & (grid.t < 6.5)
    wanted = np.zeros(grid.t.size)
    for freq, rate, phase in LINES:
        G = SLOW.realisation().response(np.array([freq]))[0] * FAST.realisation().response(np.array([freq]))[0]
        wanted += rate * np.imag(G * np.exp(1j * (2.0 * math.pi * freq * grid.t + phase)))
    error = np.abs(grid.through(trace, FAST) - wanted)[inside]
    # What FAST remembers of the end of the record, e^-250, is nothing; the spline at the slowest rate is the rest.
    assert error.max() < 0.12 * (math.pi * 6.1 / 200.0) ** 4


def test_the_weight_leaves_out_ends_and_gaps():
    one = pair(5)
    z = one.noisy.z.copy()
    z[2000:2100] = np.nan
    z[3000] = np.nan
    trace = Trace(one.noisy.t, z, SLOW)
    w = Pair(trace, one.clean).grid.weight(trace, one.clean)
    t = np.arange(w.size) / FS
    assert not w[(t < 1.0) | (t > DURATION - 1.01) | (np.abs(t - 10.25) < 1.2)].any()
    # A single lost reading is filled in.
    assert (w[(t > 13.0) & (t < 17.0)] == 1.0).all()
