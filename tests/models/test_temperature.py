from __future__ import annotations

import json

import numpy as np
import pytest
from pydantic import ValidationError

from testbed.models.temperature import ROOM, TemperatureProfile

BORDER = {"border": True}
RAMP = {"start": "25 degC", "stop": "298.15 K", "over": "2 min"}


def test_a_constant_is_one_string() -> None:
    profile = TemperatureProfile.model_validate("25 degC", context=BORDER)
    assert profile == ROOM
    assert profile.model_dump(mode="json", context=BORDER) == "298.15 K"
    assert np.array_equal(profile.at(5, 3, 20_000.0), np.full(3, 298.15))


def test_a_ramp_is_straight_and_then_held() -> None:
    profile = TemperatureProfile.model_validate({**RAMP, "stop": "35 degC"}, context=BORDER)
    assert profile.over == 120.0
    # Half a minute, one minute, the end, and an hour.
    got = [profile.at(round(t * 100), 1, 100.0)[0] for t in (0.0, 30.0, 60.0, 120.0, 3600.0)]
    np.testing.assert_allclose(got, [298.15, 300.65, 303.15, 308.15, 308.15], rtol=1e-15)


def test_blocks_give_the_same_bits() -> None:
    profile = TemperatureProfile(start=250.0, stop=333.3, over=0.7)
    parts = [profile.at(a, n, 1000.0) for a, n in ((0, 1), (1, 300), (301, 699))]
    assert np.array_equal(np.concatenate(parts), profile.at(0, 1000, 1000.0))


@pytest.mark.parametrize("profile", [ROOM, TemperatureProfile(start=280.0, stop=300.1, over=3.0)])
def test_round_trip_is_exact(profile: TemperatureProfile) -> None:
    written = json.loads(profile.model_dump_json(context=BORDER))
    assert TemperatureProfile.model_validate(written, context=BORDER) == profile


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (25, "the unit is missing"),
        ("25 s", "wrong dimension"),
        ("-1 K", "expected more than 0.0 K"),
        ({"start": "25 degC"}, "stop"),
        ({**RAMP, "over": "0 s"}, "expected more than 0.0 s"),
        ({**RAMP, "till": "0 s"}, "till"),
    ],
)
def test_nonsense_is_refused(value: object, message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        TemperatureProfile.model_validate(value, context=BORDER)
