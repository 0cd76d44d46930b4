"""Temperature at the border, and what it does to fluid, magnet and channel."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from pydantic import BaseModel, ValidationError

from testbed.models.mhd_channel.channel import MhdChannel
from testbed.models.mhd_channel.fluids import FLUIDS, Fluid
from testbed.models.mhd_channel.thermal_drift import REFERENCE, drift
from testbed.units import Temperature

BORDER = {"border": True}


class Room(BaseModel):
    temperature: Temperature


@pytest.mark.parametrize(
    ("text", "kelvin"),
    [("20 degC", 293.15), ("293.15 K", 293.15), ("-40 degC", 233.15), ("0degC", 273.15), ("300000 mK", 300.0)],
)
def test_temperatures_are_kelvin_inside(text: str, kelvin: float) -> None:
    assert Room.model_validate({"temperature": text}, context=BORDER).temperature == pytest.approx(kelvin, rel=1e-15)


def test_reference_is_20_degrees_to_the_last_bit_and_survives_the_round_trip() -> None:
    room = Room.model_validate({"temperature": "20 degC"}, context=BORDER)
    assert room.temperature == REFERENCE == 293.15
    written = room.model_dump(context=BORDER)
    assert written == {"temperature": "293.15 K"}
    assert Room.model_validate(written, context=BORDER) == room
    assert Room(temperature=293.15) == room


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ("-300 degC", "expected more than 0.0 K"),
        ("0 K", "expected more than 0.0 K"),
        ("20", "the unit is missing"),
        (25, "the unit is missing"),
        ("20 degF", "'degF' is not understood"),
        ("20 degC/s", "'degC/s'"),
        ("20 m", "wrong dimension"),
        ("nan degC", "not finite"),
        ("warm degC", "expected a quantity in K, such as '25 degC'"),
    ],
)
def test_bad_temperatures_are_named(value: Any, message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        Room.model_validate({"temperature": value}, context=BORDER)


def test_drift_is_one_at_the_reference_and_linear_beside_it() -> None:
    assert drift(-3.6e-3, REFERENCE) == 1.0
    slope = (drift(-3.6e-3, REFERENCE + 1e-3) - drift(-3.6e-3, REFERENCE - 1e-3)) / 2e-3
    # Central difference: c^3 h^2 / 6.
    assert slope == pytest.approx(-3.6e-3, rel=1e-9)


@pytest.mark.parametrize("name", FLUIDS)
def test_fluids_thin_expand_and_conduct_less_when_warm(name: str) -> None:
    cold, warm = FLUIDS[name], FLUIDS[name].at(REFERENCE + 40.0)
    assert warm.density < cold.density
    assert warm.viscosity < cold.viscosity
    assert warm.conductivity < cold.conductivity
    # What it is at a temperature is constant.
    assert warm.at(REFERENCE - 40.0) == warm
    assert cold.at(REFERENCE).model_dump(exclude_defaults=True) == {
        key: value for key, value in cold.model_dump().items() if not key.endswith("_drift")
    }


@pytest.mark.oracle
@pytest.mark.parametrize(("temp_c", "volume"), [(10.0, 0.0736877), (30.0, 0.0739552), (40.0, 0.0740891)])
def test_mercury_expands_as_in_the_handbook(temp_c: float, volume: float) -> None:
    # CRC Handbook, ml/g; 0.0738215 at 20 C. The coefficient is rounded to 3 digits and the volume slightly curved.
    ratio = FLUIDS["mercury"].at(273.15 + temp_c).density / FLUIDS["mercury"].density
    assert ratio == pytest.approx(0.0738215 / volume, rel=1.5e-5)


def test_channel_follows_its_magnet_and_its_fluid() -> None:
    fluid = Fluid(
        density=6440.0,
        viscosity=2.4e-3,
        conductivity=3.46e6,
        density_drift=-1e-4,
        viscosity_drift=-5e-3,
        conductivity_drift=-1e-3,
    )
    it = MhdChannel(fluid=fluid, height=4e-3, field=0.45, field_drift=-1.1e-3)
    warm = it.at(REFERENCE + 30.0)
    # a = sigma B^2 / rho, Ha = B (l/2) sqrt(sigma/mu): exponents add.
    assert warm.braking_rate / it.braking_rate == pytest.approx(np.exp(30 * (-1e-3 - 2.2e-3 + 1e-4)), rel=1e-12)
    assert warm.hartmann_number / it.hartmann_number == pytest.approx(
        np.exp(30 * (-1.1e-3 + 0.5 * (-1e-3 + 5e-3))), rel=1e-12
    )
    assert warm.at(REFERENCE) == warm
    freq = np.geomspace(0.01, 1000.0, 50)
    assert np.array_equal(it.at(REFERENCE).response(freq), it.response(freq))
