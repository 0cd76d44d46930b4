"""Electromotive force, resistance and Johnson noise of the ring, by hand."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.constants import Boltzmann

from testbed.models.mhd_channel.channel import MhdChannel
from testbed.models.mhd_channel.ring import BOLTZMANN, ChannelRing

RING = ChannelRing(width=6e-3, radius=15e-3)


def channel(closure: str, field: float = 0.3) -> MhdChannel:
    return MhdChannel(fluid="mercury", height=5e-3, field=field, closure=closure)


@pytest.mark.oracle
@pytest.mark.parametrize("closure", ["local", "radial_field"])
def test_emf_along_the_height(closure: str) -> None:
    # 0.3 T, 5 mm, 15 mm: 22.5 uV/(rad/s).
    assert RING.emf_per_rate(channel(closure)) == pytest.approx(22.5e-6, rel=1e-12)


@pytest.mark.oracle
def test_emf_across_the_width() -> None:
    assert RING.emf_per_rate(channel("axial_field")) == pytest.approx(0.3 * 6e-3 * 15e-3, rel=1e-12)


@pytest.mark.oracle
def test_resistance_is_length_over_cross_section() -> None:
    around = 2 * np.pi * 15e-3
    assert RING.resistance(channel("radial_field")) == pytest.approx(5e-3 / (1.04e6 * around * 6e-3), rel=1e-12)
    assert RING.resistance(channel("axial_field")) == pytest.approx(6e-3 / (1.04e6 * around * 5e-3), rel=1e-12)


@pytest.mark.oracle
def test_johnson_noise_is_nyquists() -> None:
    assert Boltzmann == BOLTZMANN
    it = channel("axial_field")
    # One-sided 4 k T R; scaled from the textbook's 4.07 nV/sqrt(Hz) of 1 kohm at 300 K.
    one_sided = 4.07e-9 * np.sqrt(RING.resistance(it) / 1e3)
    assert np.sqrt(2.0) * RING.voltage_noise(it, 300.0) == pytest.approx(one_sided, rel=1e-3, abs=1e-20)


def test_thermal_energy_on_a_capacitor_is_half_kt() -> None:
    it, capacity = channel("axial_field"), 1e-6
    resistance = RING.resistance(it)
    # Equipartition: the two-sided density over the RC's noise bandwidth 1/(2 RC) is kT/C.
    variance = RING.voltage_noise(it, 300.0) ** 2 / (2 * resistance * capacity)
    assert variance == pytest.approx(Boltzmann * 300.0 / capacity, rel=1e-12, abs=0.0)
