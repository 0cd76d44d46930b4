"""Noise term by term: the terms add up to the instrument's density, and each is its closed form."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from testbed.judging.noise_terms import ROUNDING, noise_terms
from testbed.sensors import list_presets, load_preset

FREQ = np.geomspace(1e-3, 400.0, 40)


@pytest.mark.parametrize("name", list_presets())
def test_terms_add_up_to_the_noise_of_the_instrument(name):
    sensor = load_preset(name)
    freq = np.geomspace(1e-3, min(400.0, 0.4 * sensor.sample_rate), 40)
    total = np.sum([density(freq) for density in noise_terms(sensor).values()], axis=0)
    assert_allclose(total, sensor.input_noise_psd(freq), rtol=1e-9)


def test_each_term_is_its_own_density():
    gyro = load_preset("adis16505")
    terms = noise_terms(gyro)
    assert_allclose(terms["angle_random_walk"](FREQ), gyro.angle_random_walk**2, rtol=1e-9)
    pink = gyro.bias_instability**2 / (2.0 * np.pi * FREQ)
    # A difference of densities: what is far below the white noise keeps fewer digits.
    assert_allclose(terms["bias_instability"](FREQ), pink, rtol=1e-6, atol=1e-12 * gyro.angle_random_walk**2)
    mhd = noise_terms(load_preset("sx300"))
    assert set(mhd) >= {"white", ROUNDING}


def test_without_noise_there_are_none():
    assert noise_terms(load_preset("sx300").model_copy(update={"noise": False})) == {}
