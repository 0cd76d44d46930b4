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


OVEN = {
    "start": "20 degC",
    "steps": [
        {"hold": "2 h"},
        {"ramp": "60 degC", "rate": "0.1 K/min"},
        {"ramp": "-30 degC", "over": "54000 s"},
        {"hold": "1 h"},
    ],
}


def test_holds_and_ramps_follow_each_other() -> None:
    """Paper 3's oven: 7200 s, then 40 K and 90 K at 0.1 K/min; the last temperature is held."""
    profile = TemperatureProfile.model_validate(OVEN, context=BORDER)
    times = np.array([0, 7199, 7200, 7800, 31_200, 31_800, 85_200, 100_000], dtype=float)
    corners = np.interp(times, [0, 7200, 31_200, 85_200], [293.15, 293.15, 333.15, 243.15])
    got = np.array([profile.at(int(t), 1, 1.0)[0] for t in times])
    # Sums of numbers of 300 K: a few of their last digits.
    np.testing.assert_allclose(got, corners, rtol=0, atol=1e-12)


def test_a_programme_of_one_ramp_is_the_line() -> None:
    line = TemperatureProfile(start=280.0, stop=300.1, over=3.0)
    steps = TemperatureProfile.model_validate({"start": 280.0, "steps": [{"ramp": 300.1, "over": 3.0}]})
    assert np.array_equal(line.at(0, 5000, 1000.0), steps.at(0, 5000, 1000.0))


def test_a_programme_gives_the_same_bits_in_blocks_and_at_any_clock() -> None:
    profile = TemperatureProfile.model_validate(OVEN, context=BORDER)
    whole = profile.at(0, 90_000, 1.0)
    parts = [profile.at(a, n, 1.0) for a, n in ((0, 1), (1, 40_000), (40_001, 49_999))]
    assert np.array_equal(np.concatenate(parts), whole)
    np.testing.assert_allclose(profile.at(0, 90_000 * 4, 4.0)[::4], whole, rtol=0, atol=1e-12)


def test_a_programme_survives_the_round_trip() -> None:
    profile = TemperatureProfile.model_validate(OVEN, context=BORDER)
    written = json.loads(profile.model_dump_json(context=BORDER))
    assert written["steps"][1] == {"ramp": "333.15 K", "rate": f"{profile.steps[1].rate!r} K/s"}
    assert "stop" not in written
    assert TemperatureProfile.model_validate(written, context=BORDER) == profile


@pytest.mark.parametrize(
    ("step", "message"),
    [
        ({}, "expected hold, or ramp with either rate or over, got nothing"),
        ({"hold": "1 h", "ramp": "60 degC"}, "got hold and ramp"),
        ({"ramp": "60 degC"}, "got ramp"),
        ({"ramp": "60 degC", "rate": "0.1 K/min", "over": "1 h"}, "got ramp and rate and over"),
        ({"ramp": "60 degC", "rate": "-0.1 K/min"}, "more than 0"),
        ({"ramp": "60 degC", "rate": "0.1 K"}, "wrong dimension"),
        ({"hold": "0 s"}, "more than 0"),
        ({"wait": "1 h"}, "wait"),
    ],
)
def test_a_step_that_is_none_is_refused(step: object, message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        TemperatureProfile.model_validate({"start": "20 degC", "steps": [step]}, context=BORDER)


def test_a_line_and_steps_at_once_are_refused() -> None:
    with pytest.raises(ValidationError, match="either stop and over or steps, got start and stop and over and steps"):
        TemperatureProfile.model_validate({**OVEN, **RAMP}, context=BORDER)


def test_the_schema_offers_all_three() -> None:
    schema = TemperatureProfile.model_json_schema()
    text = json.dumps(schema)
    assert all(f'"{word}"' in text for word in ("start", "stop", "over", "steps", "hold", "ramp", "rate"))
