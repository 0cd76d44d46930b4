"""What a scenario takes from presets, and where it departs from them."""

from __future__ import annotations

from testbed.scenario.departures import departures
from tests.scenes import short


def by_part(scenario):
    return {row["part"]: row for row in departures(scenario)}


def test_every_part_names_its_preset_and_nothing_that_it_shares(tmp_path):
    found = by_part(short(tmp_path))
    assert {part: row["preset"] for part, row in found.items()} == {
        "turntable": "air_bearing",
        "sensors.mhd_ars": "sx300",
        "sensors.mems_gyro": "adis16505_filtered",
        "fusion.kalman": None,
        "fusion.arw_shakf": None,
    }
    assert all(row["differs"] == [] for row in found.values())


def test_what_differs_is_named_with_both_values_as_written(tmp_path):
    found = by_part(
        short(
            tmp_path,
            ("{preset: air_bearing}", "{preset: air_bearing, feedforward_inertia_error: 0.1}"),
            ("adis16505_filtered}", "adis16505_filtered, angle_random_walk: 0.3 deg/sqrt(h), noise: off}"),
            ("kalman: {}", "kalman: {belief: exact}"),
        )
    )
    assert found["turntable"]["differs"][0]["key"] == "feedforward_inertia_error"
    rows = {row["key"]: row for row in found["sensors.mems_gyro"]["differs"]}
    assert rows["angle_random_walk"] == {
        "key": "angle_random_walk",
        "here": "0.3 deg/sqrt(h)",
        "preset": "0.15 deg/sqrt(h)",
    }
    assert rows["noise"]["here"] in {"off", "False"}
    assert found["fusion.kalman"]["differs"] == [{"key": "belief", "here": "exact", "preset": None}]


def test_what_a_change_sets_is_a_departure_too(tmp_path):
    scenario = short(tmp_path).with_(**{"sensors.mems_gyro.angle_random_walk": "0.6 deg/sqrt(h)"})
    assert by_part(scenario)["sensors.mems_gyro"]["differs"][0]["here"] == "0.6 deg/sqrt(h)"


def test_faults_are_told_in_words(tmp_path):
    faults = "faults: [{kind: lost, at: 0.2 s, length: 0.1 s}]"
    edited = short(tmp_path, ("preset: adis16505_filtered", f"preset: adis16505_filtered, {faults}"))
    rows = {row["key"]: row["here"] for part in departures(edited) for row in part["differs"]}
    assert rows["faults"] == "kind lost, at 0.2 s, length 0.1 s"
