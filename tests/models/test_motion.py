"""The motion profile: ramp-in, integral, blocks."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from testbed.models.motion import MotionProfile, ramp
from testbed.models.motions.chirp import Chirp
from testbed.models.motions.random import Random
from testbed.models.motions.sine import Sine

FS = 20_000.0


def profile(ramp_in=0.5):
    rng = np.random.default_rng(5)
    parts = (
        Sine(frequency=7.0, rate=0.3),
        Chirp(start_frequency=1.0, stop_frequency=90.0, rate=0.1),
        Random(psd=1e-6, low=1.0, high=50.0),
    )
    return MotionProfile([part.start(2.0, rng) for part in parts], ramp_in, FS)


def test_ramp_is_smooth_to_the_second_derivative():
    h = 1e-4
    x = np.arange(-0.2, 1.2, h)
    value = ramp(x, 1.0)
    assert value[x <= 0].max() == 0.0
    assert value[x >= 1].min() == 1.0
    assert np.all(np.diff(value) >= 0)
    # The second derivative is continuous: it changes by at most h times the third (60 at the ends) from sample to
    # sample, plus rounding.
    assert np.max(np.abs(np.diff(value, 3))) / h**2 < 61 * h + 4e-16 * 8 / h**2


def test_ramp_of_no_length_is_one():
    assert np.array_equal(ramp(np.zeros(3), 0.0), np.ones(3))


def test_process_starts_at_rest_and_reaches_the_full_amplitude():
    block = MotionProfile([Sine(frequency=5.0, rate=0.2).start(2.0, np.random.default_rng())], 0.5, FS).process(40_000)
    assert block.rate[0] == 0.0
    t = np.arange(20_000, 40_001) / FS
    assert_allclose(block.rate[20_000:], 0.2 * np.sin(2 * np.pi * 5.0 * t), atol=1e-15)


def test_process_integrates_the_angle():
    """Constant rate 0.1 rad/s with a symmetric ramp of 0.5 s: angle = 0.1 (t - 0.25) afterwards."""
    block = MotionProfile([lambda t: np.full_like(t, 0.1)], 0.5, FS).process(40_000)
    t = np.arange(40_001) / FS
    # Simpson's rule over a polynomial of degree 5: h^4 / 2880 times the fourth derivative (720 / 0.5^4), far below
    # rounding of the sum.
    assert_allclose(block.angle[10_000:], 0.1 * (t[10_000:] - 0.25), rtol=1e-12)
    assert_allclose(block.angle_mid[10_000:], 0.1 * (t[10_000:-1] + 0.5 / FS - 0.25), rtol=1e-12)


@pytest.mark.property
@pytest.mark.parametrize("sizes", [[20_000, 20_000], [1, 7, 39_992], [777] * 51 + [373]])
def test_process_gives_the_same_bits_for_any_blocks(sizes):
    whole, parts = profile().process(40_000), profile()
    blocks = [parts.process(n) for n in sizes]
    for name in ("rate", "angle"):
        assert np.array_equal(np.concatenate([getattr(b, name)[:-1] for b in blocks]), getattr(whole, name)[:-1])
    for name in ("rate_mid", "angle_mid"):
        assert np.array_equal(np.concatenate([getattr(b, name) for b in blocks]), getattr(whole, name))
    assert [b.start for b in blocks] == np.cumsum([0, *sizes[:-1]]).tolist()
