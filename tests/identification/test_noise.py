"""Noise of two sensors is that of both; of three it is each one's own."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

from testbed.identification.matching import OutputClock
from testbed.identification.noise import Heard, fit_noise, three_floors
from testbed.identification.response import NoiseFloor, measure_response
from testbed.identification.spectrum import Series
from tests.identification.records import REFERENCE_HZ, noise

STD = 1e-3


def three_alike(seed, length=30.0):
    """Return three sensors of one noise on one motion."""
    rng = np.random.default_rng(seed)
    t = np.arange(round(length * 20_000)) / 20_000.0
    rate = noise(t, rng)[:: round(20_000 / REFERENCE_HZ)]
    return [Series(rate + STD * rng.standard_normal(rate.size), 0.0, REFERENCE_HZ) for _ in range(3)]


@pytest.mark.oracle
def test_two_alike_look_twice_as_noisy_and_three_do_not():
    """The two-channel estimate counts the reference's noise as the sensor's: 100 % too much, as the literature has it
    (80 to 100 %); the three-channel one is not biased.
    """
    reference, first, second = three_alike(1)
    true = STD**2 / REFERENCE_HZ
    same = OutputClock(0.0, 0.0)
    two = measure_response(reference, first, one_clock=True).noise
    three = three_floors(reference, Heard(first, same, 0.0), Heard(second, same, 0.0))
    below = two.freq_hz < 100.0
    ratio = np.average(two.density[below], weights=two.freedom[below]) / true
    assert 1.8 < ratio < 2.2
    for floor in (three.reference, three.first, three.second):
        low = floor.freq_hz < 100.0
        # Some 1000 degrees of freedom, and twice the variance of one that is known: 7 % for one standard deviation.
        assert np.average(floor.density[low], weights=floor.freedom[low]) == pytest.approx(true, rel=0.25, abs=0.0)
    assert min(three.evidence) > 5.0


def test_a_reference_without_noise_shows_none():
    _, first, second = three_alike(2)
    rng = np.random.default_rng(2)
    t = np.arange(round(30.0 * 20_000)) / 20_000.0
    clean = Series(noise(t, rng)[:: round(20_000 / REFERENCE_HZ)], 0.0, REFERENCE_HZ)
    same = OutputClock(0.0, 0.0)
    found = three_floors(clean, Heard(first, same, 0.0), Heard(second, same, 0.0))
    assert abs(found.evidence[0]) < 3.5
    assert min(found.evidence[1:]) > 5.0


def test_an_output_without_noise_shows_none():
    """Beside a reference and another output that have some: once in 2000 beyond."""
    reference, _, second = three_alike(3)
    t = np.arange(round(30.0 * 20_000)) / 20_000.0
    clean = Series(noise(t, np.random.default_rng(3))[:: round(20_000 / REFERENCE_HZ)], 0.0, REFERENCE_HZ)
    same = OutputClock(0.0, 0.0)
    found = three_floors(reference, Heard(clean, same, 0.0), Heard(second, same, 0.0))
    assert abs(found.evidence[1]) < 3.5
    assert min(found.evidence[0], found.evidence[2]) > 5.0


FREQ = np.geomspace(0.1, 700.0, 60)
GAIN = 1.0 / np.hypot(1.0, FREQ / 5.0)


@pytest.mark.oracle
@pytest.mark.parametrize("before", [True, False])
def test_white_and_slow_noise_come_back(before):
    """Values of a density scatter by one in the square root of half their freedom; exact ones give exact levels."""
    white, behind, slow = (3e-5) ** 2, (2e-6) ** 2, 1e-10
    density = GAIN**2 * white + behind + (GAIN**2 if before else 1.0) * slow / FREQ
    found = fit_noise(NoiseFloor(FREQ, density, np.full(60, 20.0)), GAIN, slow_before=before)
    assert found.inner == pytest.approx(3e-5, rel=1e-6, abs=0.0)
    assert found.outer == pytest.approx(2e-6, rel=1e-6, abs=0.0)
    if before:
        assert found.instability == pytest.approx(np.sqrt(2.0 * np.pi * slow), rel=1e-6, abs=0.0)
    else:
        assert found.knee == pytest.approx(slow / behind, rel=1e-6, abs=0.0)
    np.testing.assert_allclose(found.density(FREQ, GAIN), density, rtol=1e-9)


FREEDOM, DRAWS = 20.0, 60
LEVELS = np.array([(3e-5) ** 2, (2e-6) ** 2, 1e-10])


def terms(*, before):
    """Return what white noise before and behind the dynamics and slow noise add to a density, each of level one."""
    return np.stack([GAIN**2, np.ones(FREQ.size), (GAIN**2 if before else 1.0) / FREQ], axis=1)


def levels(found, *, before):
    slow = found.instability**2 / (2.0 * np.pi) if before else (found.knee or 0.0) * found.outer**2
    return np.array([found.inner**2, found.outer**2, slow])


@pytest.mark.oracle
@pytest.mark.parametrize("before", [True, False])
def test_levels_of_noise_scatter_as_fishers_information_says(before):
    r"""A density of nu complex degrees of freedom is a sum of nu exponential values, so that :math:`I_{ij} = \sum_k \nu
    t_i t_j / S^2`. Squared errors over its inverse are chi-square, once in 10 000 outside; and levels are not biased: a
    fit weighted by the values themselves would find 1/20 too little, here six standard deviations.
    """
    t = terms(before=before)
    true = t @ LEVELS
    information = (FREEDOM * t / true[:, None] ** 2).T @ t
    rng = np.random.default_rng(5)
    off = []
    for _ in range(DRAWS):
        density = true * rng.gamma(FREEDOM, 1.0 / FREEDOM, FREQ.size)
        fit = fit_noise(NoiseFloor(FREQ, density, np.full(FREQ.size, FREEDOM)), GAIN, slow_before=before)
        off.append(levels(fit, before=before) - LEVELS)
    errors = np.array(off)
    total = float(np.einsum("ki,ij,kj", errors, information, errors))
    assert chi2.ppf(5e-5, errors.size) < total < chi2.isf(5e-5, errors.size)
    std = np.sqrt(np.diag(np.linalg.inv(information)) / DRAWS)
    assert np.all(np.abs(errors.mean(axis=0)) < 4.0 * std)


@pytest.mark.oracle
@pytest.mark.parametrize("spread", [1.0 / np.sqrt(FREEDOM), 1.5])
def test_what_is_likeliest_is_right_on_average(rng, spread):
    r"""The sum of the likelihood's derivatives, each times its level, is :math:`\sum \nu (D / S - 1)`: it is zero, and
    with it the mean of D / S one, whatever the levels; for values below zero too, as a difference of noises has.
    """
    density = (terms(before=True) @ LEVELS) * (1.0 + spread * rng.standard_normal(FREQ.size))
    freedom = rng.uniform(10.0, 100.0, FREQ.size)
    assert (density < 0.0).any() == (spread > 1.0)
    found = fit_noise(NoiseFloor(FREQ, density, freedom), GAIN, slow_before=True)
    assert np.average(density / found.density(FREQ, GAIN), weights=freedom) == pytest.approx(1.0, rel=0.0, abs=1e-4)


def test_a_level_that_would_be_below_zero_is_zero():
    """Less at low frequencies than at high ones: no slow noise, and none before dynamics that fall."""
    density = 1e-10 * FREQ**0.1
    found = fit_noise(NoiseFloor(FREQ, density, np.full(FREQ.size, FREEDOM)), GAIN, slow_before=False)
    assert (found.inner, found.knee) == (0.0, None)
    # The mean of D / S is one.
    assert found.outer**2 == pytest.approx(density.mean(), rel=1e-6, abs=0.0)


@pytest.mark.parametrize("zero", [slice(None), slice(0, 30), slice(30, None)])
def test_densities_of_zero_are_finite_levels(zero):
    """Outputs that repeat each other have such."""
    density = np.full(FREQ.size, 2.0)
    density[zero] = 0.0
    fit = fit_noise(NoiseFloor(FREQ, density, np.full(FREQ.size, FREEDOM)), GAIN, slow_before=False)
    found = fit.density(FREQ, GAIN)
    assert np.all(np.isfinite(found))
    assert found.any() == density.any()
