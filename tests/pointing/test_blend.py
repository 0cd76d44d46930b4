"""The tracker's blend against closed forms, the Riccati equation and the margins of a known loop."""

from __future__ import annotations

import itertools
import math

import control
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.linalg import solve_continuous_are
from scipy.signal import butter

from testbed.pointing.actuator import butterworth_mirror
from testbed.pointing.blend import Gains, best_gains, butterworth_gains, loop_margins

FREQ = np.geomspace(0.1, 1000.0, 41)


@pytest.mark.oracle
def test_without_noise_the_sensitivity_is_the_second_order_butterworth_high_pass():
    b, a = butter(2, 2.0 * np.pi * 7.0, "high", analog=True)
    expected = np.polyval(b, 2j * np.pi * FREQ) / np.polyval(a, 2j * np.pi * FREQ)
    assert_allclose(butterworth_gains(7.0).sensitivity(FREQ), expected, rtol=1e-12)
    assert best_gains(np.ones_like, 0.0, 7.0) == butterworth_gains(7.0)


def test_sensitivity_is_that_of_the_loop():
    """S = 1 / (1 + L) with L = (sqrt(2) w s + w^2) / s^2."""
    s, w = 2j * np.pi * FREQ, 2.0 * np.pi * 10.0
    L = (math.sqrt(2.0) * w * s + w**2) / s**2
    assert_allclose(butterworth_gains(10.0).sensitivity(FREQ), 1.0 / (1.0 + L), rtol=1e-12)


@pytest.mark.oracle
@pytest.mark.parametrize(("white", "walk"), [(1e-6, 1e-6), (3e-6, 2e-5), (1e-7, 1e-4)])
def test_with_noise_the_blend_is_the_settled_kalman_filter(white, walk):
    """The state is angle error and bias: the gains are P H' / r^2 of the Riccati equation, found without it."""
    r = 1e-7
    A, C = np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[1.0, 0.0]])
    P = solve_continuous_are(A.T, C.T, np.diag([white**2, walk**2]), np.array([[r**2]]))
    found = best_gains(lambda f: white**2 + (walk / (2.0 * np.pi * f)) ** 2, r, 100.0)
    # The minimum is flat: gains to a percent leave the least error to 1e-5 of itself.
    assert_allclose(found, P[:, 0] / r**2, rtol=1e-2)
    assert_allclose(P[:, 0] / r**2, [math.sqrt((white / r) ** 2 + 2.0 * walk / r), walk / r], rtol=1e-9)
    left = (white**2 + r**2 * (found.angle**2 + found.rate) + walk**2 / found.rate) / (2.0 * found.angle)
    assert P[0, 0] * (1.0 - 1e-9) <= left <= P[0, 0] * (1.0 + 1e-5)


def test_no_blend_trusts_the_tracker_above_its_bandwidth():
    """A rate that is all noise leaves the tracker's own gains, a better one less: in both ways continuous."""
    most = butterworth_gains(10.0)
    assert_allclose(best_gains(lambda f: 1.0 + 1.0 / f**2, 1e-9, 10.0), most, rtol=1e-6)
    gains = [best_gains(lambda f, N=N: N**2 + (N / f) ** 2, 1e-7, 10.0) for N in (1e-8, 1e-7, 1e-6, 1e-5)]
    assert all(low.rate < high.rate for low, high in itertools.pairwise(gains))
    assert all(one.angle <= most.angle and one.rate <= most.rate for one in gains)


def test_noise_bandwidth_is_the_integral_of_the_closed_loop():
    gains = Gains(30.0, 500.0)
    freq = np.geomspace(1e-5, 1e6, 40_001)
    T = 1.0 - gains.sensitivity(freq)
    # Below 1e-5 Hz 2e-5 Hz are missing, above 1e6 Hz k_1^2 / (2 pi^2 f) = 5e-5 Hz.
    assert_allclose(2.0 * np.trapezoid(np.abs(T) ** 2, freq), gains.noise_bandwidth_hz, rtol=1e-4)


@pytest.mark.oracle
@pytest.mark.parametrize("delay", [0.0, 1e-3, 8e-3])
def test_margins_are_those_of_the_rational_loop(delay):
    gains, mirror = butterworth_gains(10.0), butterworth_mirror(200.0)
    s = control.tf("s")
    loop = (gains.angle * s + gains.rate) / s**2 * control.tf(mirror.numerator, mirror.denominator)
    loop *= control.tf(*control.pade(delay, 8))
    gain, phase, _, crossed = control.margin(loop)
    found = loop_margins(gains, mirror.response, delay)
    assert_allclose(found.gain_db, 20.0 * math.log10(gain), atol=0.02)
    assert_allclose(found.phase_deg, phase, atol=0.05)
    assert_allclose(found.crossover_hz, crossed / (2.0 * math.pi), rtol=1e-3)
    assert found.stable == bool(np.all(control.poles(control.feedback(loop, 1)).real < 0.0))


def test_too_much_delay_is_unstable_and_says_by_how_much():
    found = loop_margins(butterworth_gains(10.0), butterworth_mirror(1000.0).response, 20e-3)
    assert not found.stable
    assert found.phase_deg < 0.0
    assert found.gain_db < 0.0
