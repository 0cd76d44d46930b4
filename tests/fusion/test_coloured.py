"""Markov states that stand for slow noise: the fit, and the model that they make."""

from __future__ import annotations

import numpy as np
import pytest

from testbed.fusion.belief import SensorBelief, load_belief
from testbed.fusion.coloured import fit_markov, slow_noise
from testbed.fusion.model import build_model

RATES = {"mems_gyro": 2000.0, "mhd_ars": 20_000.0}


@pytest.mark.oracle
def test_a_markov_density_is_found_again() -> None:
    """A density that is a sum of processes at the corners of the fit is met exactly."""
    corner = 2.0 * np.pi * 1e-3

    def density(freq: np.ndarray) -> np.ndarray:
        return 2.0 * corner * 4.0 / (corner**2 + (2.0 * np.pi * freq) ** 2)

    fit = fit_markov(density, 1e-3 * density(np.array([1e-3]))[0], 1e-3)
    assert fit.error_db < 1e-6
    np.testing.assert_allclose(fit.variance[0], 4.0, rtol=1e-6)
    np.testing.assert_allclose(fit.density(np.array([1e-4, 1e-2])), density(np.array([1e-4, 1e-2])), rtol=1e-6)


@pytest.mark.parametrize(("per_decade", "error"), [(1.0, 0.22), (1.25, 0.17), (1.5, 0.14)])
@pytest.mark.parametrize("knee", [0.1, 10.0])
def test_one_state_a_decade_is_within_a_quarter_of_a_decibel(per_decade: float, error: float, knee: float) -> None:
    """Against the 1/f density itself on a grid of the test's own; at its sharp corner up to 1 dB."""
    white, lowest = 1.0, 1e-4
    fit = fit_markov(lambda f: white * knee / np.maximum(f, lowest), white, lowest, per_decade=per_decade)
    freq = np.logspace(-3.5, 2.0, 997)
    off = np.abs(10.0 * np.log10((white + fit.density(freq)) / (white + white * knee / freq)))
    assert off.max() < error + (0.05 if knee > 1.0 else 0.0)
    assert fit.error_db == pytest.approx(off.max(), abs=0.02)
    assert fit.corner_error_db < 1.0


@pytest.mark.parametrize("name", ["eq39", "identified", "swept", "paper2"])
def test_shipped_beliefs_have_eleven_slow_states(name: str) -> None:
    """And the fit is within 0.22 dB of their densities, as docs/filters.md says."""
    belief = load_belief(name)
    assert sum(slow_noise(one).size for one in belief.values()) == 11
    assert max(slow_noise(one).error_db for one in belief.values()) < 0.22


@pytest.mark.oracle
def test_the_readings_of_the_model_have_the_density_of_the_belief() -> None:
    """H (e^{jwT} - F)^-1 Q ... of the discrete model, the signal held at zero, against the belief's own formula."""
    belief = load_belief("identified")
    model = build_model(belief, RATES, order=1, q=0.0, coloured=True)
    F, Q, H, T = model.F[1:, 1:], model.Q[1:, 1:], model.H[:, 1:], 1.0 / 20_000.0
    for freq in (1e-3, 1e-2, 0.1, 1.0):
        inner = np.linalg.inv(np.exp(2j * np.pi * freq * T) * np.eye(len(F)) - F)
        for i, name in enumerate(model.sensors):
            row = H[i] @ inner
            found = T * (row @ Q @ row.conj()).real + belief[name].output_noise ** 2
            one, at = belief[name], np.array([freq])
            power = np.abs(one.realisation().response(at)[0]) ** 2
            wanted = power * one.input_noise**2 + one.output_noise**2 + one.slow_density(at)[0]
            assert abs(10.0 * np.log10(found / wanted)) < 0.23


def test_a_turn_on_bias_and_a_strong_walk_share_a_state() -> None:
    plain = SensorBelief(numerator=(30.0,), denominator=(1.0, 30.0), input_noise=4e-5)
    assert slow_noise(plain).size == 0
    biased = slow_noise(plain.model_copy(update={"turn_on_bias": 1e-3}))
    assert (biased.inner.rate, biased.inner.drive) == (0.0, 0.0)
    walking = slow_noise(plain.model_copy(update={"rate_random_walk": 1e-6, "turn_on_bias": 1e-3}))
    assert (walking.inner.rate, walking.inner.drive) == (0.0, 1e-12)
    weak = slow_noise(plain.model_copy(update={"rate_random_walk": 1e-12}))
    assert weak.size == 0


def test_slow_noise_without_white_noise_is_refused() -> None:
    alone = SensorBelief(numerator=(30.0,), denominator=(1.0, 30.0), bias_instability=1e-4)
    with pytest.raises(ValueError, match="white noise: expected more than 0 beside 1/f noise"):
        slow_noise(alone)
