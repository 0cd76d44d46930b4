"""Sifting: spline and modes against independent implementations, closed cases, and what is not a record."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline

from testbed.compensation.emd import emd, envelope, find_extrema
from tests.compensation.records import noisy_tone, peer_modes

EPS = np.finfo(float).eps


@pytest.mark.oracle
@pytest.mark.parametrize("n_knot", [3, 4, 5, 40])
def test_envelope_is_scipys_spline(n_knot):
    rng = np.random.default_rng(n_knot)
    knots = np.append(-2, np.cumsum(rng.integers(1, 9, n_knot - 1)) - 1)
    values, last = rng.standard_normal(n_knot), max(0, int(knots[-1]) - 2)
    out = np.empty(last + 1)
    envelope(knots, values, np.empty(n_knot), np.empty(n_knot), out)
    # Slopes of order one over intervals of at most eight samples.
    expected = CubicSpline(knots, values, bc_type="natural" if n_knot == 3 else "not-a-knot")(np.arange(last + 1))
    assert np.allclose(out, expected, rtol=0.0, atol=1e4 * EPS)


@pytest.mark.oracle
@pytest.mark.parametrize("n_time", [12, 20, 30, 50, 80, 300, 3000])
def test_modes_are_those_of_the_peer(n_time):
    """Short records meet every case of the mirror at the ends; ten sifts of ten modes amplify rounding a little."""
    for seed in range(20 if n_time < 100 else 2):
        signal = noisy_tone(n_time, seed)
        ours, theirs = emd(signal), peer_modes(signal)
        assert ours.shape == theirs.shape
        assert np.allclose(ours, theirs, rtol=0.0, atol=1e-9 * np.ptp(signal))


def test_two_tones_come_apart():
    """Frequencies 1:20 are far beyond what sifting cannot tell apart (Rilling and Flandrin 2008: 1:1.5 at equal
    amplitude).
    """
    t = np.arange(4000)
    fast, slow = np.sin(2.0 * np.pi * t / 10.3), np.sin(2.0 * np.pi * t / 206.0)
    modes = emd(fast + slow)
    inner = slice(400, -400)
    # A cubic spline through the crests of the fast tone, every 10.3 samples, follows the slow one to (2 pi
    # 10.3/206)^4/384 = 3e-5; its crests are met at samples only, at worst half a sample off: 1 - cos(pi/10.3) = 5 %,
    # which ten sifts spread and mostly average out.
    assert np.std(modes[0][inner] - fast[inner]) < 0.05 * np.std(fast)
    assert np.std(modes[1:].sum(axis=0)[inner] - slow[inner]) < 0.05 * np.std(slow)


def test_modes_add_up_to_the_signal():
    signal = noisy_tone(5000, 3)
    modes = emd(signal)
    assert np.allclose(modes.sum(axis=0), signal, rtol=0.0, atol=len(modes) * 4.0 * EPS * np.abs(signal).max())


@pytest.mark.property
def test_modes_scale_with_the_signal():
    """No absolute threshold hides in SI units: 1e-9 rad/s decomposes as 1 rad/s, bit for bit for a power of two."""
    signal = noisy_tone(700, 4)
    assert np.array_equal(emd(2.0**-30 * signal), 2.0**-30 * emd(signal))


@pytest.mark.property
def test_modes_of_the_reversed_record_are_reversed():
    """Both ends are treated alike."""
    signal = noisy_tone(700, 5)
    assert np.allclose(emd(signal[::-1]), emd(signal)[:, ::-1], rtol=0.0, atol=1e-9 * np.ptp(signal))


def test_extremum_of_a_flat_top_is_its_middle():
    x = np.array([0.0, 1.0, 2.0, 2.0, 2.0, 1.0, 0.0, 0.0, 3.0, 3.0])
    maxima, minima = np.empty(10, np.int64), np.empty(10, np.int64)
    assert find_extrema(x, maxima, minima) == (1, 1)
    assert maxima[0] == 3
    # Samples 6 and 7: the middle is rounded down. The flat end is no extremum.
    assert minima[0] == 6


@pytest.mark.parametrize(
    "signal",
    [
        np.full(50, 3.0),
        np.arange(50.0),
        -(np.arange(50.0) ** 2),
        np.array([1.0]),
        np.array([1.0, 2.0]),
        np.array([0.0, 1.0, 0.0]),
    ],
    ids=["constant", "rising", "falling", "one sample", "two samples", "one extremum"],
)
def test_a_record_without_three_extrema_is_all_residual(signal):
    assert np.array_equal(emd(signal), signal[None])


@pytest.mark.property
@settings(deadline=None, max_examples=200)
@given(st.lists(st.integers(-3, 3), min_size=1, max_size=40))
def test_coarsely_quantised_records_decompose(samples):
    """Flat tops everywhere, at the ends too: whatever comes out is finite and adds up."""
    signal = np.array(samples, dtype=float)
    modes = emd(signal)
    # Mirrored splines may overshoot ten times over in each of ten sifts; nothing here measures more than 1e3.
    assert np.abs(modes).max() < 1e3
    assert np.allclose(modes.sum(axis=0), signal, rtol=0.0, atol=1e-9)


def test_input_is_unchanged():
    signal = noisy_tone(300, 7)
    signal.setflags(write=False)
    emd(signal)


@pytest.mark.parametrize(
    "signal", [[], [[1.0, 2.0]], [1.0, np.nan, 2.0], [1.0, np.inf]], ids=["empty", "2-D", "NaN", "inf"]
)
def test_what_is_no_record_is_refused(signal):
    with pytest.raises(ValueError, match="signal: expected"):
        emd(np.array(signal))
    with pytest.raises(ValueError, match="sifts: expected"):
        emd(np.arange(3.0), sifts=0)
