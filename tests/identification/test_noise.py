"""Noise of two sensors is that of both; of three it is each one's own."""

from __future__ import annotations

import numpy as np
import pytest

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
    assert three.evidence > 5.0


def test_a_reference_without_noise_shows_none():
    _, first, second = three_alike(2)
    rng = np.random.default_rng(2)
    t = np.arange(round(30.0 * 20_000)) / 20_000.0
    clean = Series(noise(t, rng)[:: round(20_000 / REFERENCE_HZ)], 0.0, REFERENCE_HZ)
    same = OutputClock(0.0, 0.0)
    found = three_floors(clean, Heard(first, same, 0.0), Heard(second, same, 0.0))
    assert abs(found.evidence) < 3.5


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
