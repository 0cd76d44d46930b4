"""Identification gives back what made the response."""

from __future__ import annotations

import numpy as np
import pytest

from testbed.fusion.analysis.identify import identify, sine_response
from testbed.fusion.belief import default_belief
from testbed.signals import LinearFilter, random_stream, transfer

FREQ = np.logspace(-2, 3, 121)


@pytest.mark.oracle
@pytest.mark.parametrize("name", ["mems_gyro", "mhd_ars"])
def test_the_transfer_function_behind_the_samples_is_found(name: str) -> None:
    one = default_belief()[name]
    b, a = np.array(one.numerator), np.array(one.denominator)
    fit = identify(FREQ, transfer(b, a, FREQ), real_poles=2, blind_at_dc=name == "mhd_ars")
    # Steps of the search end at 1e-14 of the residual's change; poles follow to its square root times their
    # sensitivity.
    np.testing.assert_allclose(fit.denominator, a / a[0], rtol=1e-6)
    np.testing.assert_allclose(fit.numerator, b / a[0], rtol=1e-6, atol=1e-6)
    assert fit.worst < 1e-9
    assert fit.belief(output_noise=1e-7).output_noise == pytest.approx(1e-7, rel=1e-12, abs=0.0)


@pytest.mark.oracle
def test_a_resonance_is_found_by_a_pole_pair() -> None:
    w = 2.0 * np.pi * 80.0
    b, a = np.array([w**2]), np.array([1.0, 0.3 * w, w**2])
    fit = identify(FREQ, transfer(b, a, FREQ), real_poles=0, pole_pairs=1)
    np.testing.assert_allclose(fit.denominator, a, rtol=1e-6)
    np.testing.assert_allclose(fit.belief().realisation().response(FREQ), transfer(b, a, FREQ), rtol=1e-6)


@pytest.mark.parametrize(("real", "pairs"), [(1, 0), (5, 0), (4, 2), (3, 2), (5, 1), (0, 3)])
@pytest.mark.parametrize("blind", [True, False])
def test_more_poles_than_there_are_do_no_harm(real: int, pairs: int, blind: bool) -> None:
    """Poles without a task wander to infinity or to zero; the fit stays, no worse than that of two poles."""
    name = "mhd_ars" if blind else "mems_gyro"
    b, a = (np.array(part) for part in (default_belief()[name].numerator, default_belief()[name].denominator))
    # A wall's layer on top, which no rational model meets: half-order, 1 % of it.
    H = transfer(b, a, FREQ) * (1.0 + 0.01 * np.sqrt(2j * np.pi * FREQ / 1e4))
    two = identify(FREQ, H, real_poles=2, blind_at_dc=blind)
    fit = identify(FREQ, H, real_poles=real, pole_pairs=pairs, blind_at_dc=blind)
    assert np.isfinite([*fit.numerator, *fit.denominator]).all()
    if real + 2 * pairs > 1:
        assert fit.worst <= 1.001 * two.worst


def test_no_zero_is_made_of_rounding() -> None:
    """A low-pass of two poles has no zero; one at 1e18 rad/s would spoil its inverse."""
    w = 2.0 * np.pi * 480.0
    H = transfer(np.array([w**2]), np.array([1.0, 2.0**0.5 * w, w**2]), FREQ)
    np.testing.assert_array_equal(identify(FREQ, H, real_poles=0, pole_pairs=1).numerator[:-1], 0.0)


def test_a_numerator_of_a_lower_degree_may_be_asked_for() -> None:
    w = 2.0 * np.pi * np.array([3.0, 480.0])
    H = transfer(np.array([w.prod()]), np.array([1.0, w.sum(), w.prod()]), FREQ)
    fit = identify(FREQ, H, real_poles=2, n_zero=0)
    np.testing.assert_allclose(fit.numerator, [w.prod()], rtol=1e-9)
    np.testing.assert_allclose(fit.denominator, [1.0, w.sum(), w.prod()], rtol=1e-9)
    with pytest.raises(ValueError, match="n_zero: expected 1 to 1, got 0"):
        identify(FREQ, H, real_poles=2, blind_at_dc=True, n_zero=0)


def test_weight_decides_where_the_fit_is_good() -> None:
    """Two poles cannot carry three; weighting the upper half makes the upper half better and the lower worse."""
    w = 2.0 * np.pi * np.array([1.0, 20.0, 300.0])
    H = np.prod([1.0 / (1.0 + 2j * np.pi * FREQ / one) for one in w], axis=0)
    upper = FREQ > 3.0
    errors = []
    for weight in (np.where(upper, 10.0, 1.0), np.where(upper, 1.0, 10.0)):
        fit = identify(FREQ, H, real_poles=2, weight=weight)
        error = np.abs(fit.belief().realisation().response(FREQ) / H - 1.0)
        errors.append((np.max(error[upper]), np.max(error[~upper])))
    assert errors[0][0] < errors[1][0]
    assert errors[0][1] > errors[1][1]


def test_a_sensor_blind_at_dc_stays_blind() -> None:
    H = 2j * np.pi * FREQ / (2j * np.pi * FREQ + 15.0) / (1.0 + 1j * FREQ / 900.0) ** 0.9
    assert identify(FREQ, H, real_poles=4, blind_at_dc=True).numerator[-1] == 0.0


@pytest.mark.parametrize(
    ("freq", "response"),
    [
        (FREQ[:3], np.ones(3)),
        (FREQ, np.zeros(FREQ.size)),
        (FREQ, np.full(FREQ.size, np.nan)),
        (FREQ - 0.01, np.ones(FREQ.size)),
    ],
    ids=["too few", "zero", "nan", "dc"],
)
def test_samples_that_cannot_be_fitted_are_refused(freq: np.ndarray, response: np.ndarray) -> None:
    with pytest.raises(ValueError, match="response: expected"):
        identify(freq, response, real_poles=2)


@pytest.mark.oracle
def test_a_sine_in_time_gives_the_response_through_offset_drift_and_transient() -> None:
    b, a = [154.537, 15.626], [5.2175, 148.0, 15.444]
    rate_hz, freq, amplitude = 2000.0, 7.3, 0.02
    t = np.arange(9001) / rate_hz
    reading = LinearFilter(b, a, rate_hz).process(amplitude * np.sin(2.0 * np.pi * freq * t)) + 0.5 + 1e-3 * t
    G = sine_response(reading, rate_hz, freq, amplitude, settle=2.0)
    # First-order hold: (w T)^2 / 12 = 4e-5; the slow mode's 4 % of gain bends by less than (2.5 s / 9.6 s)^2 / 8 of
    # what is left of it.
    assert abs(G / transfer(b, a, np.array([freq]))[0] - 1.0) < 2e-4


@pytest.mark.oracle
def test_noise_leaves_in_each_part_of_the_response_what_the_docstring_says() -> None:
    rate_hz, freq, density, seconds = 1000.0, 5.0, 2e-4, 2.0
    t = np.arange(round(rate_hz * seconds)) / rate_hz
    noise = density * np.sqrt(rate_hz) * random_stream(3, "noise").standard_normal((300, t.size))
    G = np.array([sine_response(np.sin(2.0 * np.pi * freq * t) + row, rate_hz, freq, 1.0) for row in noise])
    # A standard deviation of 300 runs scatters by 1/sqrt(600) = 4 %: four of them; the drift in the fit costs less than
    # 1 %.
    wanted = density * np.sqrt(2.0 / seconds)
    assert np.std(G.real) == pytest.approx(wanted, rel=0.17, abs=0.0)
    assert np.std(G.imag) == pytest.approx(wanted, rel=0.17, abs=0.0)


@pytest.mark.parametrize(("freq", "settle"), [(0.4, 0.0), (1.0, 1.5), (600.0, 0.0), (0.0, 0.0)])
def test_a_sine_that_the_record_cannot_show_is_refused(freq: float, settle: float) -> None:
    with pytest.raises(ValueError, match="reading: expected at least a period"):
        sine_response(np.zeros(2000), 1000.0, freq, 1.0, settle=settle)
