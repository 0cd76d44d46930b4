"""Errors over windows: closed forms for a sine, an independent loop over windows, spectra, and any blocks."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from testbed.pointing.windows import (
    Periodogram,
    WindowErrors,
    drift_weight,
    mpe_weight,
    rpe_weight,
    weighted_rms,
)

FS = 2000.0


def of(error, length, separation=None, cuts=()):
    errors = WindowErrors(length, separation, FS)
    for part in np.split(error, cuts):
        errors.process(part)
    return errors


def by_hand(error, length, separation):
    """Every window by itself, with numpy's own mean and variance."""
    m, apart = round(length * FS), round(separation * FS)
    windows = np.lib.stride_tricks.sliding_window_view(error, m)
    mean = windows.mean(axis=1)
    return math.sqrt(np.mean(mean**2)), math.sqrt(np.mean(windows.var(axis=1))), np.std(mean[apart:] - mean[:-apart])


@pytest.mark.oracle
def test_errors_are_those_of_every_window_by_itself(rng):
    error = rng.standard_normal(3000).cumsum()
    error -= error.mean()
    found = of(error, 0.05, 0.2)
    mpe, rpe, _ = by_hand(error, 0.05, 0.2)
    m = round(0.05 * FS)
    mean = np.convolve(error, np.full(m, 1.0 / m), "valid")
    apart = mean[round(0.2 * FS) :] - mean[: -round(0.2 * FS)]
    assert_allclose([found.mpe, found.rpe, found.pde], [mpe, rpe, math.sqrt(np.mean(apart**2))], rtol=1e-9)


@pytest.mark.property
@settings(max_examples=30, deadline=None)
@given(cuts=st.lists(st.integers(0, 900), max_size=6).map(sorted))
def test_any_blocks_give_the_same(cuts):
    error = np.random.default_rng(3).standard_normal(900)
    whole, parts = of(error, 0.02, 0.1), of(error, 0.02, 0.1, cuts)
    assert_allclose([parts.mpe, parts.rpe, parts.pde], [whole.mpe, whole.rpe, whole.pde], rtol=1e-10)


@pytest.mark.oracle
@pytest.mark.parametrize("frequency", [3.0, 11.0, 40.0])
def test_a_sine_has_the_errors_of_the_weights(frequency):
    """Amplitude A: APE^2 = A^2/2, of which each weight at f takes its part; whole periods, so that the mean over places
    is that over the phase; m samples instead of an integral are off by 1/m^2 (m = 400).
    """
    T, Ts = 0.2, 0.5
    t = np.arange(round((10.0 + T + Ts) * FS)) / FS
    found = of(np.sin(2.0 * np.pi * frequency * t), T, Ts)
    freq = np.array([frequency])
    weights = mpe_weight(freq, T), rpe_weight(freq, T), drift_weight(freq, T, Ts)
    expected = [math.sqrt(0.5 * float(one[0])) for one in weights]
    assert_allclose([found.mpe, found.rpe, found.pde], expected, rtol=2e-3, atol=2e-3)


def test_weights_split_the_square_and_the_small_one_does_not_round_away():
    freq = np.geomspace(1e-6, 1e3, 200)
    assert_allclose(mpe_weight(freq, 0.1) + rpe_weight(freq, 0.1), 1.0, rtol=1e-12)
    turn = 2.0 * np.pi * freq[:40] * 0.1
    assert_allclose(rpe_weight(freq[:40], 0.1), turn**2 / 12.0, rtol=1e-6)
    turn = 2.0 * np.pi * freq[120:] * 0.1
    assert_allclose(rpe_weight(freq[120:], 0.1), 1.0 - 2.0 * (1.0 - np.cos(turn)) / turn**2, atol=1e-9)


@pytest.mark.parametrize("colour", ["white", "walk"])
def test_spectrum_and_samples_agree_within_two_percent(rng, colour):
    """As the issue asks: APE and RPE always, MPE and PDE for windows under a hundredth of the record."""
    from scipy.signal import lfilter

    n = 200_000
    error = rng.standard_normal(n)
    if colour == "walk":
        error = lfilter([1.0], [1.0, -0.999], error)
    spectrum = Periodogram(FS, n)
    spectrum.process(error)
    power, freq = spectrum.power, spectrum.freq_hz
    assert_allclose(weighted_rms(power), np.sqrt(np.mean(error**2)), rtol=1e-9)
    for T in (0.05, 0.5):
        found = of(error, T, 2.0 * T)
        assert_allclose(weighted_rms(power, rpe_weight(freq, T)), found.rpe, rtol=0.02)
        assert_allclose(weighted_rms(power, mpe_weight(freq, T)), found.mpe, rtol=0.02)
        assert_allclose(weighted_rms(power, drift_weight(freq, T, 2.0 * T)), found.pde, rtol=0.02)


def test_a_long_record_is_cut_into_equal_parts_and_keeps_its_square(rng):
    x = rng.standard_normal(10_001)
    spectrum = Periodogram(FS, x.size, longest=3000)
    for part in np.array_split(x, 7):
        spectrum.process(part)
    assert spectrum.n_parts == 4
    assert_allclose(spectrum.power.sum(), np.mean(x[:10_000] ** 2), rtol=1e-12)
    assert spectrum.freq_hz[-1] == FS / 2


def test_what_is_too_short_is_undefined():
    found = of(np.zeros(10), 1.0, 2.0)
    assert (found.mpe, found.rpe, found.pde) == (None, None, None)
    assert of(np.zeros(3000), 1.0).pde is None
