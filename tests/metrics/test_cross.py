"""Two records of one rate: what they share, and how large and how late the second is."""

from __future__ import annotations

import numpy as np
import pytest

from testbed.metrics.cross import at_slower, cross_bands

FS, N = 1000.0, 64_000


def plain(freq):
    return np.ones(freq.size, complex)


def test_a_record_against_itself_scaled_and_turned_is_that(rng):
    rate = rng.standard_normal(N)
    for band in cross_bands(rate, -1.25 * rate, FS, plain):
        # At the ends of the band the skirts of what lies beyond are in one of them only.
        assert band.coherence == pytest.approx(1.0, abs=3e-3)
        assert band.ratio == pytest.approx(-1.25, rel=3e-3)


def test_the_skirt_of_a_line_keeps_the_ratio_of_the_line():
    """A tone off the bins of a segment, through a response that falls by ten times in a decade."""
    t = np.arange(N) / FS
    first, second = np.sin(2.0 * np.pi * 3.3 * t), np.sin(2.0 * np.pi * 3.3 * t) / 3.3
    band = next(band for band in cross_bands(first, second, FS, lambda freq: 1.0 / freq + 0j) if band.high_hz == 10.0)
    assert band.ratio == pytest.approx(1.0, abs=1e-3)


def test_equal_noise_on_the_second_halves_the_coherence_and_leaves_the_gain(rng):
    """gamma^2 = S / (S + N); over 30 000 degrees of freedom each share has a standard deviation below a per cent in the
    widest band, which is looked at.
    """
    rate, noise = rng.standard_normal((2, N))
    band = cross_bands(rate, rate + noise, FS, plain)[-1]
    assert band.high_hz == 400.0
    assert band.coherence == pytest.approx(0.5, abs=0.03)
    assert band.ratio == pytest.approx(1.0, abs=0.03)
    other = cross_bands(rate + noise, rate, FS, plain)[-1]
    assert other.ratio == pytest.approx(0.5, abs=0.03)


def test_a_delay_is_a_phase_unless_it_is_expected(rng):
    rate = rng.standard_normal(N + 3)
    late = cross_bands(rate[3:], rate[:-3], FS, lambda freq: np.exp(-2j * np.pi * freq * 3.0 / FS))
    assert [abs(np.angle(band.ratio, deg=True)) < 0.5 for band in late] == [True] * len(late)
    unexpected = cross_bands(rate[3:], rate[:-3], FS, plain)[0]
    middle = 0.5 * (unexpected.low_hz + unexpected.high_hz)
    assert np.angle(unexpected.ratio, deg=True) == pytest.approx(-360.0 * middle * 3.0 / FS, abs=1.0)


def test_independent_records_share_nothing(rng):
    one, other = rng.standard_normal((2, N))
    assert cross_bands(one, other, FS, plain)[-1].coherence < 0.01


def test_means_over_a_slow_step_are_what_their_response_says():
    """A sine of 60 Hz at 20 kHz, at a clock of 333.3 Hz: sinc(0.18), to the width of a fast step, (pi 0.003)^2 / 6."""
    times = np.arange(40_000) / 20_000.0
    wanted = 0.05 + np.arange(600) / 333.3
    mean, response = at_slower(np.sin(120.0 * np.pi * times), times, wanted)
    np.testing.assert_allclose(mean, response(np.array([60.0])).real * np.sin(120.0 * np.pi * wanted), atol=2e-4)


def test_a_short_record_says_nothing():
    assert cross_bands(np.zeros(100), np.zeros(100), FS, plain) == []
