from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING

import numpy as np
import pytest
from pydantic import ValidationError
from scipy.signal import lfilter, welch

from testbed.sensors.noise import ElectronicTerms, GyroNoise
from testbed.sensors.noise_terms import (
    FirstOrderBank,
    NoiseStage,
    _one_over_f,
    _stationary_root,
    bank_response,
    flicker,
)
from testbed.signals import random_stream

if TYPE_CHECKING:
    from testbed.signals import FloatArray

FULL = GyroNoise(
    quantization=1e-6,
    angle_random_walk=4e-5,
    bias_instability=1e-5,
    rate_random_walk=1e-6,
    rate_ramp=1e-8,
    markov_bias=1e-5,
)


@pytest.mark.oracle
@pytest.mark.parametrize(("low", "fs"), [(1e-4, 20000.0), (1e-6, 20000.0), (1e-4, 2000.0), (1e-3, 100.0), (0.5, 100.0)])
def test_flicker_filter_is_one_over_f_within_a_twentieth_of_a_decibel(low: float, fs: float) -> None:
    decay, gain = _one_over_f(low / fs)
    freq = np.geomspace(low, fs / 2, 20_000)
    # S = T |H|^2 fs with w of unit variance: level^2 |H|^2 T; against level^2 / (2 pi f).
    density = np.abs(bank_response(decay, gain, freq / fs)) ** 2 / fs
    deviation = 10.0 * np.log10(density * 2.0 * np.pi * freq)
    assert np.abs(deviation).max() < 0.05


@pytest.mark.oracle
def test_flicker_filter_is_flat_below_its_band() -> None:
    decay, gain = _one_over_f(1e-7)
    below = np.abs(bank_response(decay, gain, np.array([1e-10, 1e-11]))) ** 2
    edge = 1.0 / (2.0 * np.pi * 1e-7)
    # From the edge on the density rises by no more than the two poles next to it allow, here under 3 dB, and stays.
    assert below[0] == pytest.approx(below[1], rel=1e-3)
    assert 1.0 < below[0] / edge < 2.5


@pytest.mark.oracle
def test_bank_equals_scipy_sections() -> None:
    decay, gain = _one_over_f(1e-6)
    n = 5000
    got = FirstOrderBank(decay, gain, np.random.default_rng(3)).process(n)
    stream = np.random.default_rng(3)
    state = _stationary_root(decay, gain) @ stream.standard_normal(decay.size)
    w = stream.standard_normal(n)
    wanted = np.zeros(n)
    for d, g, v in zip(decay, gain, state, strict=True):
        p = 1.0 - d
        section, _ = lfilter([g], [1.0, -p], w, zi=[p * v])
        wanted += section
    # Sums of 20 sections of alternating sign, each rounded in every one of n steps: n eps of the largest section.
    np.testing.assert_allclose(got, wanted, rtol=0, atol=n * 2.3e-16 * np.abs(wanted).max() * 10)


@pytest.mark.oracle
def test_bank_starts_stationary() -> None:
    decay, gain = _one_over_f(1e-6)
    root = _stationary_root(decay, gain)
    p = 1.0 - decay
    covariance = root @ root.T
    # P = Phi P Phi' + g g', the definition; slow poles lose digits as eps / (1 - p^2).
    step = p[:, None] * covariance * p + np.outer(gain, gain)
    np.testing.assert_allclose(covariance, step, rtol=0, atol=1e-9 * np.abs(covariance).max())
    # Its variance is the integral of the density: flat to the band's edge, then ln of the band.
    first = np.array([FirstOrderBank(decay, gain, np.random.default_rng(s)).process(1)[0] for s in range(2000)])
    cycles = np.geomspace(1e-12, 0.5, 20_000)
    density = np.abs(bank_response(decay, gain, cycles)) ** 2
    variance = 2.0 * np.trapezoid(density * cycles, np.log(cycles))
    assert abs(np.mean(first**2) / variance - 1.0) < 5.0 * math.sqrt(2.0 / first.size)


@pytest.mark.parametrize("cuts", [[1], [1, 2, 3, 5000], [16_384, 16_385], list(range(100, 40_000, 977))])
def test_any_division_into_blocks_gives_the_same_bits(cuts: list[int]) -> None:
    n = 40_000
    whole = FULL.sample(n, 2000.0, 5)
    stage = FULL.start(2000.0, 5)
    parts = [stage.process(b - a) for a, b in zip([0, *cuts], [*cuts, n], strict=True)]
    assert np.array_equal(np.concatenate(parts), whole)


def test_sample_takes_a_seed_or_a_generator() -> None:
    assert np.array_equal(FULL.sample(10, 100.0, 1), FULL.sample(10, 100.0, 1))
    generator = np.random.default_rng(1)
    first, second = FULL.sample(10, 100.0, generator), FULL.sample(10, 100.0, generator)
    assert not np.array_equal(first, second)
    assert np.array_equal(first, FULL.sample(10, 100.0, np.random.default_rng(1)))


def test_no_terms_is_silence() -> None:
    assert not GyroNoise().sample(100, 100.0, 1).any()
    assert GyroNoise().sample(0, 100.0, 1).shape == (0,)


@pytest.mark.parametrize(
    ("keys", "arguments", "message"),
    [
        ({}, (-1, 100.0, 0), "n: expected at least 0, got -1"),
        ({}, (1, 0.0, 0), "sample_rate_hz: expected a positive number, got 0.0"),
        ({}, (1, math.inf, 0), "sample_rate_hz: expected a positive number, got inf"),
        (
            {"bias_instability": 1e-5, "lowest_frequency": 1.0},
            (1, 100.0, 0),
            "lowest_frequency: expected at most 1/200",
        ),
    ],
)
def test_sample_refuses(keys: dict[str, float], arguments: tuple[int, float, int], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        GyroNoise(**keys).sample(*arguments)


@pytest.mark.parametrize("value", [-1e-5, math.nan, math.inf])
def test_coefficients_refuse_what_is_no_density(value: float) -> None:
    with pytest.raises(ValidationError):
        GyroNoise(angle_random_walk=value)


def periodogram(record: FloatArray, fs: float) -> tuple[FloatArray, FloatArray]:
    """Two-sided density in octaves from 1/64 to 1/4 of the band, each the mean of many independent values."""
    freq, one_sided = welch(record, fs, nperseg=4096, window="hann", detrend=False)
    edges = fs / 2 * np.array([1 / 64, 1 / 32, 1 / 16, 1 / 8, 1 / 4])
    pairs = list(itertools.pairwise(edges))
    mids = np.array([freq[(freq >= a) & (freq < b)].mean() for a, b in pairs])
    level = np.array([(one_sided / 2 * freq)[(freq >= a) & (freq < b)].mean() for a, b in pairs])
    return mids, level / mids


@pytest.mark.oracle
@pytest.mark.parametrize("fs", [100.0, 20000.0])
def test_density_of_the_sum_is_the_closed_form(fs: float) -> None:
    noise = GyroNoise(angle_random_walk=1e-5, bias_instability=3e-5 * math.sqrt(fs), quantization=2e-5 / fs)
    freq, got = periodogram(noise.sample(2**21, fs, 8), fs)
    ratio = got / noise.noise_psd(freq, fs)
    # 512 segments and at least 32 lines: 16384 values, of which the window and the overlap leave half: 5 / sqrt(8192) =
    # 6 %; a sloping density averaged over an octave against its middle: f S is linear in 1 and f, and quadratic only in
    # the quantisation (3 %).
    assert np.abs(ratio - 1.0).max() < 0.09


@pytest.mark.oracle
def test_electronic_noise_has_its_density_and_its_knee() -> None:
    terms = ElectronicTerms(noise_density=1e-7, noise_knee=1000.0, lowest_frequency=0.01)
    record = NoiseStage(terms.noise_terms(20000.0, 1, "mhd_ars")).process(2**20)
    freq, got = periodogram(record, 20000.0)
    wanted = 1e-14 * (1.0 + 1000.0 / freq)
    np.testing.assert_allclose(terms.noise_psd(freq), wanted, rtol=1e-12)
    # 256 segments: half the values of the test above.
    assert np.abs(got / wanted - 1.0).max() < 0.09


def test_electronic_noise_without_knee_is_white() -> None:
    assert list(ElectronicTerms(noise_density=1e-7).noise_terms(100.0, 1)) == ["white"]
    assert ElectronicTerms().noise_terms(100.0, 1) == {}


def test_flicker_refuses_a_band_under_two_decades() -> None:
    with pytest.raises(ValueError, match="lowest_frequency"):
        flicker(1.0, 1.0, 199.0, random_stream(1, "x"))
