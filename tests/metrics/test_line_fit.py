"""Intervals of gain and phase: they cover the true value as often as they say, whatever the colour of the error."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from testbed.metrics.line_fit import LineFit, Waves

FS, LENGTH, SEEDS = 200.0, 10.0, 600
T = np.arange(round(FS * LENGTH)) / FS
# 95 % of 600 trials scatters by 0.9 %: 4 sigma.
SCATTER = 4 * np.sqrt(0.95 * 0.05 / SEEDS)


def white(rng):
    return rng.standard_normal(T.size)


def low_passed(rng):
    """Return noise behind a pole at 3 Hz, as that of a filter that follows the slow part only."""
    return lfilter([1.0], [1.0, -np.exp(-2 * np.pi * 3.0 / FS)], rng.standard_normal(T.size + 500))[500:]


def flicker(rng):
    """Return 1/f noise by Kasdin's recursion: power falls tenfold per decade across the line."""
    weights = np.cumprod([1.0, *((k - 0.5) / k for k in range(1, T.size))])
    return np.convolve(rng.standard_normal(T.size), weights)[: T.size]


def fit(error, truth, lines, t=T, span=(0.0, LENGTH), n_block=None):
    found = LineFit(Waves(lines), span)
    for start in range(0, t.size, n_block or t.size):
        part = slice(start, start + (n_block or t.size))
        found.add(t[part], error[part], truth[part])
    return found.result()


@pytest.mark.parametrize("noise", [white, low_passed, flicker], ids=lambda noise: noise.__name__)
@pytest.mark.parametrize("freq", [0.73, 5.0, 31.7])
def test_the_interval_covers_the_true_gain_as_often_as_it_says(noise, freq):
    """A real part, an imaginary part: the error holds a known phasor and noise of which the fit knows nothing."""
    truth, gain, inside = 2.0 * np.cos(2 * np.pi * freq * T + 0.4), 0.8 * np.exp(-0.3j), []
    wanted = np.real(2.0 * gain * np.exp(1j * (2 * np.pi * freq * T + 0.4))) - truth
    for seed in range(SEEDS):
        (line,) = fit(wanted + 0.3 * noise(np.random.default_rng(seed)), truth, (freq,))
        off = line.gain - gain
        inside += [abs(off.real) <= line.half_width, abs(off.imag) <= line.half_width]
    covered = np.mean(inside)
    assert covered >= 0.95 - SCATTER
    # Where the density curves over the six neighbours their mean is above it, and the interval wider than it need be.
    assert covered <= (0.99 if noise is flicker and freq < 1.0 else 0.95 + SCATTER)


def test_a_white_assumption_would_fail_where_this_does_not(rng):
    """The oracle of the coloured case: the interval is that of the density at the line, not of the mean density."""
    freq, ratios = 31.7, []
    truth = np.cos(2 * np.pi * freq * T)
    for _ in range(50):
        error = low_passed(rng)
        (line,) = fit(error, truth, (freq,))
        a_white = 1.96 * np.sqrt(2.0 * np.mean(error**2) / T.size)
        ratios.append(line.half_width / a_white)
    # Density of the first-order process over its mean, and Student's t of 12 over Gauss; 50 estimates of 12 degrees of
    # freedom scatter by 3 %.
    pole = np.exp(-2 * np.pi * 3.0 / FS)
    density = (1 - pole**2) / abs(1 - pole * np.exp(-2j * np.pi * freq / FS)) ** 2
    assert np.median(ratios) == pytest.approx(np.sqrt(density) * 2.179 / 1.96, rel=0.12)


def test_the_interval_of_the_phase_follows(rng):
    (line,) = fit(0.1 * white(rng), np.cos(2 * np.pi * 5.0 * T), (5.0,))
    assert line.phase_half_width() == pytest.approx(np.rad2deg(np.arcsin(line.half_width / abs(line.gain))))
    (lost,) = fit(white(rng) - np.cos(2 * np.pi * 5.0 * T), np.cos(2 * np.pi * 5.0 * T), (5.0,))
    assert lost.phase_half_width() == 180.0


def test_another_division_into_blocks_changes_the_last_digits_only(rng):
    error, truth = white(rng), np.cos(2 * np.pi * 5.0 * T) + np.cos(2 * np.pi * 5.9 * T)
    whole, cut = (fit(error, truth, (5.0, 5.9), n_block=n) for n in (None, 77))
    for one, other in zip(whole, cut, strict=True):
        assert one.gain == pytest.approx(other.gain, rel=1e-9)
        assert one.half_width == pytest.approx(other.half_width, rel=1e-9)


def test_a_neighbouring_line_is_no_noise(rng):
    """Two lines two periods of the record apart: the other one, however large, does not widen the interval."""
    small = 1e-3 * white(rng)
    truth = np.cos(2 * np.pi * 5.0 * T) + np.cos(2 * np.pi * 5.2 * T)
    first, second = fit(small + 0.5 * np.sin(2 * np.pi * 5.2 * T), truth, (5.0, 5.2))
    # 1e-3 sqrt(2 / 2000) = 3.2e-5, times Student's t, and what an estimate of so few neighbours scatters by.
    assert first.half_width < 3e-4
    assert second.half_width < 3e-4


def test_lost_readings_leave_the_interval_honest(rng):
    keep = rng.random(T.size) > 0.3
    truth, inside = np.cos(2 * np.pi * 5.0 * T), []
    for seed in range(300):
        error = white(np.random.default_rng(seed))
        (line,) = fit(error[keep], truth[keep], (5.0,), t=T[keep])
        inside += [abs((line.gain - 1).real) <= line.half_width, abs((line.gain - 1).imag) <= line.half_width]
    assert np.mean(inside) == pytest.approx(0.95, abs=4 * np.sqrt(0.95 * 0.05 / 300))


def test_there_is_no_interval_where_none_can_be_known(rng):
    """Without the span, without the line in the truth, and where all neighbours meet zero or other lines."""
    truth = np.cos(2 * np.pi * 5.0 * T)
    assert fit(white(rng), truth, (5.0,), span=None)[0].half_width is None
    assert fit(white(rng), np.zeros(T.size), (5.0,))[0].half_width is None
    crowd = tuple(5.0 + k / LENGTH for k in range(-4, 5))
    assert fit(white(rng), truth, crowd)[4].half_width is None
