"""What a belief may say of a sensor, every filter uses or refuses by name: delay, bias, equal poles, no dynamics."""

from __future__ import annotations

import numpy as np
import pytest

from testbed.fusion.belief import SensorBelief
from testbed.fusion.two_paths.base import TwoPaths
from testbed.signals import LinearFilter
from tests.contract.records import BELIEF, DEG, METHODS, NAMES, RATES

pytestmark = pytest.mark.contract

SECONDS, FREQ_HZ = 4.0, 10.0


def sine(t):
    """Return a sine that begins smoothly at t = 0."""
    return np.where(t > 0.0, DEG * np.sin(2.0 * np.pi * FREQ_HZ * t) * np.minimum(t, 1.0), 0.0)


def moved(delay=0.0, bias=0.0, **beliefs):
    """Return noise-free readings of a sine from rest, each sensor late by `delay` and off by `bias`, and the truth."""
    t = np.arange(round(SECONDS * 20_000)) / 20_000.0
    readings = {}
    for name, rate_hz in RATES.items():
        one = beliefs.get(name, BELIEF[name])
        whole = LinearFilter(list(one.numerator), list(one.denominator), 20_000.0).process(sine(t - delay)) + bias
        readings[name] = whole[:: round(20_000.0 / rate_hz)]
    return readings, sine(t)


def error_of(name, belief, readings, truth):
    """Return the rms error over the last second [rad/s]."""
    found = METHODS[name](belief, RATES, METHODS[name].Parameters(start="rest")).process(readings)
    return float(np.sqrt(np.mean((found.rate - truth)[-20_000:] ** 2)))


@pytest.mark.parametrize("name", NAMES)
def test_a_bias_that_is_known_changes_nothing(name):
    bias = 0.3 * DEG
    plain, _ = moved()
    off, _ = moved(bias=bias)
    belief = {key: one.model_copy(update={"bias": bias}) for key, one in BELIEF.items()}
    wanted = METHODS[name](BELIEF, RATES, METHODS[name].Parameters(start="rest")).process(plain)
    found = METHODS[name](belief, RATES, METHODS[name].Parameters(start="rest")).process(off)
    # Adding and taking off the bias rounds at 1e-16 of it; sums of many readings, and the slowest integrals, keep it.
    np.testing.assert_allclose(found.rate, wanted.rate, atol=1e-9 * DEG)


@pytest.mark.parametrize("name", ["steady_state", "wideband"])
def test_a_delay_that_is_known_is_made_up_for(name):
    """Half a millisecond at 10 Hz is a lag of 1.8 degrees: 0.022 deg/s rms where nobody knows of it.

    The others believe the rate to be a random walk, of which the past says no more than where it was: they only stay.
    """
    readings, truth = moved(delay=0.5e-3)
    belief = {key: one.model_copy(update={"delay": 0.5e-3}) for key, one in BELIEF.items()}
    unknown, known = (error_of(name, one, readings, truth) for one in (BELIEF, belief))
    lag = DEG / np.sqrt(2.0) * 2.0 * np.pi * FREQ_HZ * 0.5e-3
    assert unknown == pytest.approx(lag, rel=0.1, abs=0.0)
    assert known < 0.05 * lag


@pytest.mark.parametrize("name", [name for name in NAMES if issubclass(METHODS[name], TwoPaths)])
def test_a_method_of_inverses_refuses_a_delay(name):
    belief = {key: one.model_copy(update={"delay": 0.5e-3}) for key, one in BELIEF.items()}
    with pytest.raises(ValueError, match="expected sensors without a delay"):
        METHODS[name](belief, RATES, METHODS[name].Parameters())


def shaped(numerator, denominator):
    """Return a gyro with these dynamics and with the slow noise of the one that it stands for."""
    slow = BELIEF["mems_gyro"].model_dump(include={"bias_instability", "rate_random_walk"})
    return SensorBelief(numerator=numerator, denominator=denominator, input_noise=4e-5, output_noise=1e-6, **slow)


SHAPES = {
    "static": shaped((0.9,), (1.0,)),
    "equal poles": shaped((0.9 * 3000.0**2,), np.poly([-3000.0, -3000.0])),
}


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("name", NAMES)
def test_a_gyro_without_dynamics_or_with_equal_poles_is_used(name, shape):
    """As well as the one with a single pole at the same place."""
    single = shaped((2700.0,), (1.0, 3000.0))
    errors = []
    for gyro in (SHAPES[shape], single):
        readings, truth = moved(mems_gyro=gyro)
        errors.append(error_of(name, BELIEF | {"mems_gyro": gyro}, readings, truth))
    assert errors[0] < 1.5 * errors[1] + 1e-3 * DEG
