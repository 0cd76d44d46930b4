"""Identification gives back what made the response."""

from __future__ import annotations

import numpy as np
import pytest

from testbed.fusion.belief import default_belief
from testbed.fusion.identify import identify
from testbed.signals import transfer

FREQ = np.logspace(-2, 3, 121)


@pytest.mark.oracle
@pytest.mark.parametrize("name", ["mems_gyro", "mhd_ars"])
def test_the_transfer_function_behind_the_samples_is_found(name: str) -> None:
    one = default_belief()[name]
    b, a = np.array(one.numerator), np.array(one.denominator)
    fit = identify(FREQ, transfer(b, a, FREQ), real_poles=2, blind_at_dc=name == "mhd_ars")
    # Steps of the search end at 1e-14 of the residual's change; poles follow to its square root times their sensitivity.
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
