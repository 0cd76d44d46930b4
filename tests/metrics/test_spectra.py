"""Densities against closed forms (white noise, a sine, Parseval) and against scipy on short records."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.signal import get_window, welch
from scipy.stats import chi2

from testbed.metrics.spectra import (
    BLACKMAN_HARRIS,
    HANN,
    LONGEST_SEGMENT,
    WelchDensity,
    cosine_window,
    log_average,
    segment_length,
)


def density_of(x: np.ndarray, sample_rate_hz: float, n_segment: int) -> WelchDensity:
    spectrum = WelchDensity(sample_rate_hz, n_segment)
    spectrum.process(x)
    return spectrum


@pytest.mark.oracle
@pytest.mark.parametrize("n_segment", [8, 255, 256, 1000])
def test_welch_equals_scipy(n_segment: int):
    x = np.random.default_rng(1).standard_normal(3001) + 0.3
    ours = density_of(x, 2000.0, n_segment)
    # scipy's default overlap is n // 2 as ours; its negative half mirrors ours.
    _, theirs = welch(x, 2000.0, "hann", n_segment, detrend=False, return_onesided=False)
    # Rounding of two FFTs: eps times log2(n), relative to the largest term.
    assert_allclose(ours.density, theirs[: n_segment // 2 + 1], rtol=1e-12, atol=1e-13 * theirs.max())
    assert_allclose(ours.freq_hz, np.arange(n_segment // 2 + 1) * 2000.0 / n_segment, rtol=1e-15)


@pytest.mark.oracle
@pytest.mark.parametrize(("name", "weights"), [("hann", HANN), ("blackmanharris", BLACKMAN_HARRIS)])
@pytest.mark.parametrize("n", [8, 255, 65536])
def test_a_window_is_scipys(name: str, weights: tuple[float, ...], n: int):
    # A cosine and a sum of four terms, each rounded.
    assert_allclose(cosine_window(weights, n), get_window(name, n), rtol=0.0, atol=1e-15)


@pytest.mark.property
@pytest.mark.parametrize("block", [1, 7, 64, 129, 5000])
def test_welch_any_division_gives_the_same_bits(block: int):
    x = np.random.default_rng(2).standard_normal(1500)
    blocks = WelchDensity(100.0, 129)
    for first in range(0, x.size, block):
        blocks.process(x[first : first + block])
    whole = density_of(x, 100.0, 129)
    assert np.array_equal(blocks.density, whole.density)
    assert blocks.n_segments == whole.n_segments == (1500 - 129) // 65 + 1


def test_welch_white_noise_has_density_variance_over_rate():
    """Two-sided density of white noise is sigma^2 / fs at every frequency."""
    sigma, sample_rate_hz, n_segment = 0.7, 20000.0, 256
    spectrum = density_of(sigma * np.random.default_rng(3).standard_normal(200_000), sample_rate_hz, n_segment)
    # Half-overlapped Hann segments are worth K / (1 + 2 / 36) independent ones (Welch 1967, correlation 1/6); the mean
    # over every 4th frequency (a Hann window ties neighbours up to 2 bins) of chi-square with 2 degrees each stays in
    # its 6 sigma bounds.
    inner = spectrum.density[4:-4:4]
    freedom = 2.0 * inner.size * spectrum.n_segments / (1.0 + 2.0 / 36.0)
    low, high = chi2.ppf([1e-9, 1.0 - 1e-9], freedom) / freedom
    assert low < inner.mean() / (sigma**2 / sample_rate_hz) < high
    assert low > 0.95  # the bounds are tight: a factor of two cannot hide
    assert high < 1.05


def test_welch_sine_keeps_its_power():
    """Parseval: the two sides of the line at +f and -f integrate to A^2 / 2; half of it is on the positive side."""
    n, sample_rate_hz, amplitude = 4000, 2000.0, 1.7
    t = np.arange(n) / sample_rate_hz
    spectrum = density_of(amplitude * np.sin(2 * np.pi * 50.0 * t + 0.4), sample_rate_hz, 1000)
    step = spectrum.freq_hz[1]
    # 50 Hz is bin 25: the Hann main lobe ends at bins 23 and 27, nothing else is left but rounding.
    assert_allclose(2 * step * spectrum.density[23:28].sum(), amplitude**2 / 2, rtol=1e-12)
    assert_allclose(2 * step * spectrum.density.sum(), amplitude**2 / 2, rtol=1e-12)


def test_welch_constant_stays_in_the_first_two_bins():
    density = density_of(np.full(2000, 3.0), 100.0, 500).density
    assert density[:2].min() > 0.1
    assert density[2:].max() < 1e-25  # (eps * 3)^2


def test_welch_leaves_out_segments_with_nan():
    x = np.random.default_rng(4).standard_normal(400)
    broken = x.copy()
    broken[:150] = np.nan
    # Segments of 100 start at 0, 50, ..., 300; those from 150 on are whole.
    spectrum = density_of(broken, 10.0, 100)
    assert spectrum.n_segments == 4
    assert np.array_equal(spectrum.density, density_of(x[150:], 10.0, 100).density)
    assert np.all(np.isnan(density_of(np.full(400, np.nan), 10.0, 100).density))


def test_welch_too_short_segment_is_refused():
    with pytest.raises(ValueError, match="n_segment: expected at least 8 samples, got 7"):
        WelchDensity(100.0, 7)


def test_welch_does_not_change_its_input():
    x = np.random.default_rng(5).standard_normal(300)
    before = x.copy()
    density_of(x, 10.0, 64)
    assert np.array_equal(x, before)


def test_welch_memory_does_not_grow_with_the_record():
    def peak(n_blocks: int) -> int:
        rng = np.random.default_rng(6)
        tracemalloc.start()
        spectrum = WelchDensity(20000.0, 2**14)
        for _ in range(n_blocks):
            spectrum.process(rng.standard_normal(2**14))
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return peak

    assert peak(64) < 1.05 * peak(4)


def test_segment_length_gives_three_segments_and_is_capped():
    assert segment_length(200_000) == 100_000
    assert segment_length(10**9) == LONGEST_SEGMENT


@pytest.mark.property
def test_log_average_conserves_power_and_keeps_slow_lines():
    freq_hz = np.arange(2, 5001) * 0.2
    density = np.random.default_rng(7).chisquare(2, freq_hz.size)
    centre, mean = log_average(freq_hz, density, 40)
    # Independent count: sort every frequency into bins counted from the top, one by one.
    expected: dict[int, list[float]] = {}
    for f, s in zip(freq_hz, density, strict=True):
        expected.setdefault(int(np.floor(np.log10(freq_hz[-1] / f) * 40)), []).append(s)
    counts = np.array([len(group) for group in expected.values()])
    assert_allclose(mean, [np.mean(group) for group in expected.values()], rtol=1e-12)
    assert_allclose(np.sum(mean * counts), density.sum(), rtol=1e-12)
    # A bin of 1/40 decade is 5.9 % wide: below 0.2 Hz / 0.059 = 3.4 Hz every frequency has a bin of its own.
    assert_allclose(centre[:14], freq_hz[:14], rtol=1e-15)
    assert counts[-1] > 200
    assert np.all(np.diff(centre) > 0)


def test_log_average_of_nothing_is_nothing():
    freq_hz, density = log_average(np.empty(0), np.empty(0))
    assert freq_hz.size == density.size == 0
