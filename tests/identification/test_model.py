"""The parametric fit: what made the response comes back, as closely as its covariance says."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from testbed.identification.fitting import zeros_on_the_right
from testbed.identification.matching import OutputClock
from testbed.identification.model import fit_model
from testbed.identification.response import FrequencyResponse, measure_response
from testbed.signals import transfer
from tests.identification.records import DENOMINATOR, EXCITATIONS, LINES_HZ, NUMERATOR, STEPS_HZ, record

FREQ = np.geomspace(0.3, 300.0, 40)
SAME_CLOCK = OutputClock(0.0, 0.0)


def measured(true, rng, std=1e-3, *, freq=FREQ, freedom=5000, clock=SAME_CLOCK, slope=0.0):
    """Return a response with white errors, of a variance that is known to some degrees of freedom, and one of the
    clock.
    """
    error = std * (rng.standard_normal(true.size) + 1j * rng.standard_normal(true.size)) / np.sqrt(2.0)
    error = error + slope * clock.std * rng.standard_normal()
    variance = std**2 * rng.chisquare(2 * freedom, freq.size) / (2 * freedom)
    return FrequencyResponse(
        freq, true + error, variance, np.full(freq.size, freedom), slope * np.ones(freq.size, complex),
        np.ones(freq.size), clock, 60.0,
    )  # fmt: skip


def sensor(freq):
    return transfer(NUMERATOR, DENOMINATOR, freq) * np.exp(-2j * np.pi * freq * 0.35e-3)


@pytest.mark.oracle
@pytest.mark.parametrize("clock_std", [0.0, 1e-6])
def test_coefficients_and_delay_scatter_as_their_covariance_says(clock_std):
    """Sum over the fits of the squared error over the covariance: chi-square, once in 10 000 outside.

    The clock's error turns each frequency by the time at which it was there: ten times its own noise at the upper end.
    """
    b, a = np.array(NUMERATOR) / DENOMINATOR[0], np.array(DENOMINATOR) / DENOMINATOR[0]
    true = sensor(FREQ)
    clock = {
        "clock": OutputClock(0.0, clock_std),
        "slope": -2j * np.pi * FREQ * np.linspace(0.0, 10.0, FREQ.size) * true,
    }
    total, n = 0.0, 0
    for seed in range(6):
        fit = fit_model(measured(true, np.random.default_rng(seed), **clock))
        if fit.denominator.size != 3 or fit.free != 1 or not fit.delayed:
            continue
        off = np.array([*fit.numerator[:1] - b[:1], *fit.denominator[1:] - a[1:], fit.delay - 0.35e-3])
        total += off @ np.linalg.solve(fit.covariance, off)
        n += off.size
    # Bayes' criterion takes one coefficient too many in about one fit of twenty, for each that it may.
    assert n >= 4 * 4
    assert chi2.ppf(5e-5, n) < total < chi2.isf(5e-5, n)


@pytest.mark.oracle
@pytest.mark.parametrize("name", EXCITATIONS)
def test_the_dead_time_is_found_to_10_us(name):
    one = record(EXCITATIONS[name], 7, length=30.0)
    fit = fit_model(measure_response(one.reference, one.output).response)
    assert abs(fit.delay - one.delay) < 10e-6
    assert fit.delay_std < 10e-6


@pytest.mark.oracle
@pytest.mark.parametrize(("freq", "seeds"), [(STEPS_HZ, (1, 17, 22)), (LINES_HZ, (3,))])
def test_few_frequencies_tell_the_dead_time_too(freq, seeds):
    """Poles and a zero on the right would be as good a fit to them, or an output that is early with one pole more: in
    the last two draws of the first and in the other Bayes' criterion over the frequencies alone takes such a one.
    """
    freq = np.array(freq)
    true = sensor(freq)
    clock = {"clock": OutputClock(0.0, 6e-8), "slope": -2j * np.pi * freq * np.linspace(3.0, 37.0, freq.size) * true}
    for seed in seeds:
        fit = fit_model(measured(true, np.random.default_rng(seed), 7e-5, freq=freq, freedom=13, **clock))
        assert abs(fit.delay - 0.35e-3) < 10e-6
        # Four standard deviations: once in 16 000.
        assert abs(fit.delay - 0.35e-3) < 4.0 * fit.delay_std
        assert fit.delay_span[0] <= fit.delay <= fit.delay_span[1]


@pytest.mark.oracle
def test_a_low_pass_without_zeros_keeps_its_dead_time(rng):
    """A zero far off, a pole and the dead time are one phase: with all three nothing is known of any of them."""
    freq = np.array([0.31, 0.9, 2.3, 7.1, 13.7, 27.1, 44.9, 61.3])
    w = 2.0 * np.pi * np.array([40.0, 540.0])
    true = transfer([w.prod()], [1.0, w.sum(), w.prod()], freq) * np.exp(-2j * np.pi * freq * 1.7e-3)
    fit = fit_model(measured(true, rng, 1e-4, freq=freq, freedom=13))
    assert (fit.numerator.size, fit.denominator.size) == (1, 3)
    assert fit.delay_std < 10e-6
    assert abs(fit.delay - 1.7e-3) < 4.0 * fit.delay_std


def test_a_dead_time_that_three_frequencies_do_not_tell_from_a_pole_is_open():
    """Below a tenth of its corner a pole is a dead time."""
    freq = np.array([1.0, 2.0, 4.0])
    true = transfer([1000.0], [1.0, 1000.0], freq)
    fit = fit_model(measured(true, np.random.default_rng(1), freq=freq))
    assert fit.delay_is_open
    assert fit.delay_span[0] <= 0.0
    assert fit.delay_span[1] > 1e-3


@pytest.mark.oracle
def test_a_zero_on_the_right_turns_the_phase_by_twice_its_arc():
    s = 2j * np.pi * np.array([1.0, 3.0])
    place = 100.0
    once = zeros_on_the_right(np.array([-1.0, place]), s, np.ones(2))
    assert once == pytest.approx(2.0 * np.arctan(6.0 * np.pi / place), rel=1e-12, abs=0.0)
    assert zeros_on_the_right(np.array([1.0, place]), s, np.ones(2)) == 0.0
    # Far below the band it turns nothing, but for the sign.
    slow = zeros_on_the_right(np.array([1.0, -1e-3]), s, np.ones(2))
    assert slow == pytest.approx(2.0 * np.arctan(1e-3 / (2.0 * np.pi)), rel=1e-9, abs=0.0)


def test_a_static_sensor_has_no_pole(rng):
    fit = fit_model(measured(0.93 * np.exp(-2j * np.pi * FREQ * 1e-3), rng))
    assert fit.denominator.tolist() == [1.0]
    assert fit.numerator[0] == pytest.approx(0.93, rel=1e-3, abs=0.0)
    # sigma / (sqrt(2) 2 pi f_rms) of phase over 40 points is 0.4 us.
    assert fit.delay == pytest.approx(1e-3, rel=0.0, abs=2e-6)


def test_an_output_that_is_early_has_a_dead_time_below_zero(rng):
    fit = fit_model(measured(np.exp(2j * np.pi * FREQ * 0.2e-3), rng))
    assert fit.delay == pytest.approx(-0.2e-3, rel=0.0, abs=2e-6)


def test_a_sensor_that_sees_a_constant_is_not_made_blind(rng):
    """Its slow pole and zero, far below the band, would be met as well by a zero at s = 0."""
    true = transfer([154.537, 15.626], [5.2175, 148.0, 15.444], FREQ)
    assert fit_model(measured(true, rng, std=1e-2)).numerator[-1] != 0.0


BLIND = np.array([2200.0, 0.0]) / 0.255, np.array([0.255, 2178.0, 33900.0]) / 0.255


def constant_std(b, a, std):
    r"""Return the standard deviation of the numerator's constant term by the Cramer-Rao bound: all coefficients free,
    :math:`\partial G / \partial b_j = s^j / D`, :math:`\partial G / \partial a_j = -G s^j / D`, in points of two parts
    each of variance std^2 / 2.
    """
    s = 2j * np.pi * FREQ
    D = np.polyval(a, s)
    G = np.polyval(b, s) / D
    jacobian = np.stack([s / D, 1.0 / D, -G * s / D, -G / D], axis=1)
    rows = np.concatenate([jacobian.real, jacobian.imag]) * np.sqrt(2.0) / std
    size = np.linalg.norm(rows, axis=0)
    return float(np.sqrt(np.linalg.inv(rows.T @ rows / np.outer(size, size))[1, 1]) / size[1])


@pytest.mark.oracle
@pytest.mark.parametrize(("deviations", "counts"), [(3.9, False), (4.1, True)])
def test_a_constant_term_counts_from_four_standard_deviations_on(rng, deviations, counts):
    """Without an error in the response the estimate is the true one. Bayes' criterion alone takes it from two on."""
    (b, a), std = BLIND, 1e-3
    seen = deviations * constant_std(b, a, std)
    true = transfer(b + np.array([0.0, seen]), a, FREQ)
    found = fit_model(replace(measured(true, rng, std), response=true)).numerator[-1]
    assert found == (pytest.approx(seen, rel=1e-3, abs=0.0) if counts else 0.0)


def test_one_frequency_is_too_few():
    one = FrequencyResponse(*(np.ones(1) for _ in range(6)), OutputClock(0.0, 0.0), 1.0)
    with pytest.raises(ValueError, match="two frequencies or more"):
        fit_model(one)
