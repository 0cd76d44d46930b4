"""The broadband platform spectrum against its own density and its closed-form variance."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.signal import periodogram

from testbed.models.motions.platform_psd import PlatformPsd, SpectrumPoint
from testbed.models.motions.random import Random

POINTS = (
    SpectrumPoint(frequency=2.0, psd=1e-8),
    SpectrumPoint(frequency=8.0, psd=1e-6),
    SpectrumPoint(frequency=40.0, psd=4e-8),
)


def rate_of(motion, duration, seed=1):
    return motion.start(duration, np.random.default_rng(seed))


def test_density_is_straight_in_log_log_between_the_points():
    motion = PlatformPsd(points=POINTS)
    assert_allclose(motion.density(np.array([2.0, 8.0, 40.0])), [1e-8, 1e-6, 4e-8], rtol=1e-12)
    # Half way in log f the density is the geometric mean.
    assert_allclose(motion.density(np.array([4.0, np.sqrt(320.0)])), [1e-7, 2e-7], rtol=1e-12)
    assert motion.top_frequency() == 40.0


def test_platform_has_the_stated_two_sided_spectrum_and_nothing_outside():
    fs, duration = 500.0, 1000.0
    motion = PlatformPsd(points=POINTS)
    t = np.arange(int(fs * duration)) / fs
    freq, one_sided = periodogram(rate_of(motion, duration)(t), fs, window="hann", detrend=False)
    for low, high in [(2.1, 3.0), (3.0, 6.0), (7.0, 9.0), (10.0, 20.0), (20.0, 39.9)]:
        inside = (freq > low) & (freq < high)
        ratio = one_sided[inside] / 2.0 / motion.density(freq[inside])
        # n periodogram bins spread by 1/sqrt(n); the hann window correlates neighbours (factor 2).
        assert np.mean(ratio) == pytest.approx(1.0, abs=4 * np.sqrt(2.0 / ratio.size))
    outside = (freq > 40.1) | ((freq < 1.9) & (freq > 0))
    assert np.max(one_sided[outside]) < 1e-6 * 4e-8


def test_variance_is_twice_the_integral_of_the_density():
    """A power law S = S1 (f/f1)^p has the integral S1 f1/(p+1) ((f2/f1)^(p+1) - 1)."""
    motion = PlatformPsd(points=POINTS[1:])
    p = np.log(4e-8 / 1e-6) / np.log(5.0)
    expected = 2 * 1e-6 * 8.0 / (p + 1) * (5.0 ** (p + 1) - 1)
    t = np.arange(0.0, 400.0, 0.005)
    variance = np.mean([np.mean(rate_of(motion, 400.0, seed)(t) ** 2) for seed in range(5)])
    # Lines fade out by 1/f^2, so an effective 10 Hz * 2000 s of chi-square cells with two degrees: 1/sqrt(20 000).
    assert variance == pytest.approx(expected, rel=4 / np.sqrt(20_000))


def test_olympus_is_the_rate_of_the_angle_spectrum():
    motion = PlatformPsd(spectrum="olympus", low=0.1, high=100.0)
    freq = np.logspace(-3, 5, 100_001)
    one_sided_angle = 2 * motion.density(freq) / (2 * np.pi * freq) ** 2
    assert_allclose(motion.density(np.array([1.0])), (2 * np.pi) ** 2 * 40e-12, rtol=1e-12)
    # 160 urad^2 * pi / 2: 15.9 urad rms, cut off at both ends by 1e-3 and 1e-5.
    assert np.sqrt(np.trapezoid(one_sided_angle, freq)) == pytest.approx(np.sqrt(80 * np.pi) * 1e-6, rel=1e-3)


def test_flat_spectrum_is_that_of_random():
    flat = (SpectrumPoint(frequency=1.0, psd=1e-6), SpectrumPoint(frequency=10.0, psd=1e-6))
    t = np.linspace(0.0, 2.0, 1001)
    # exp(log) of the density costs a few roundings.
    assert_allclose(
        rate_of(PlatformPsd(points=flat), 2.0)(t), rate_of(Random(psd=1e-6, low=1.0, high=10.0), 2.0)(t), rtol=1e-12
    )


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({}, "exactly one of points"),
        ({"points": POINTS, "spectrum": "olympus"}, "exactly one of points"),
        ({"points": POINTS, "low": 1.0, "high": 2.0}, "neither with points"),
        ({"spectrum": "olympus"}, "low and high with a named spectrum"),
        ({"spectrum": "olympus", "low": 1.0}, "low and high with a named spectrum"),
        ({"spectrum": "olympus", "low": 10.0, "high": 1.0}, "rising frequencies, got 10 Hz, 1 Hz"),
        ({"points": POINTS[::-1]}, "rising frequencies"),
        ({"points": POINTS[:1]}, "at least 2 items"),
        ({"points": ({"frequency": 1.0, "psd": 0.0}, {"frequency": 2.0, "psd": 1.0})}, "more than 0"),
    ],
)
def test_platform_refuses_what_makes_no_spectrum(values, message):
    with pytest.raises(ValueError, match=message):
        PlatformPsd(**values)


def test_every_number_of_a_point_changes_the_motion():
    t = np.linspace(0.0, 2.0, 777)
    base = rate_of(PlatformPsd(points=POINTS), 2.0)(t)
    for change in ({"frequency": 7.0}, {"psd": 2e-6}):
        points = (POINTS[0], POINTS[1].model_copy(update=change), POINTS[2])
        assert not np.array_equal(rate_of(PlatformPsd(points=points), 2.0)(t), base)
