"""Filters of a replay: by name, with parameters from a file, one belief and one start for all."""

from __future__ import annotations

import pytest

import testbed
from testbed.errors import ScenarioError
from testbed.inputs.plugins import Plugins
from testbed.playback.filters import filter_specs

SENSORS = ("mhd_ars", "mems_gyro")


def specs(names=(), fusion=None, belief=None, start=None, sensors=SENSORS):
    return filter_specs(sensors, names, fusion, belief, start, Plugins())


def test_a_name_alone_knows_nothing_of_the_start_and_believes_equation_39():
    found = specs(["kalman", "blending"])
    assert list(found) == ["kalman", "blending"]
    assert found["kalman"].parameters.start == "unknown"
    assert {one.source for one in found["kalman"].belief.values()} == {"eq39"}
    assert list(found["kalman"].belief) == list(SENSORS)


def test_a_file_gives_types_parameters_beliefs_and_starts(tmp_path):
    path = tmp_path / "filters.yaml"
    path.write_text(
        "fusion:\n  stiff: {type: kalman, start: rest, order: 2, q: 1e6 (deg/s)^2/s^3}\n  wideband: {}\n",
        encoding="utf-8",
    )
    found = specs(["kalman"], path)
    assert list(found) == ["stiff", "wideband", "kalman"]
    assert (found["stiff"].type, found["stiff"].parameters.order, found["stiff"].parameters.start) == (
        "kalman",
        2,
        "rest",
    )
    assert found["wideband"].parameters.start == "unknown"
    assert specs([], path, start="rest")["wideband"].parameters.start == "rest"


def test_a_belief_file_counts_for_all_filters(tmp_path):
    path = tmp_path / "belief.yaml"
    gyro = "{numerator: [1.0], denominator: [0.001, 1.0], output_noise: 0.2 deg/sqrt(h)}"
    path.write_text(f"mhd_ars: {gyro}\nmems_gyro: {gyro}\n", encoding="utf-8")
    found = specs(["kalman"], {"wideband": {"belief": "eq39"}}, path)
    assert {tuple(one.belief["mhd_ars"].denominator) for one in found.values()} == {(0.001, 1.0)}
    known = {name: testbed.belief_of("sx300") for name in SENSORS}
    assert specs(["kalman"], belief=known)["kalman"].belief["mhd_ars"].numerator == known["mhd_ars"].numerator


@pytest.mark.parametrize(
    ("said", "message"),
    [
        ({}, "--filter: expected at least one filter"),
        ({"names": ["kalmann"]}, r"unknown filter 'kalmann'; did you mean 'kalman'\?"),
        ({"names": ["kalman"], "belief": "eq40"}, "fusion.kalman.belief: unknown belief 'eq40'"),
        ({"names": ["kalman"], "belief": "exact"}, "'exact' is known of simulated instruments only"),
        ({"fusion": {"kalman": {"form": "round"}}}, "fusion.kalman.form"),
        ({"fusion": {"kalman": 3}}, "fusion.kalman: expected a mapping"),
        (
            {"names": ["kalman"], "sensors": ("gx", "gy")},
            r"nothing of sensor 'gx' \(it knows mems_gyro, mhd_ars\); name the channels of the recording as the belief",
        ),
    ],
)
def test_what_does_not_fit_is_told(said, message):
    with pytest.raises(ScenarioError, match=message):
        specs(**said)


def test_a_wrong_belief_is_told_by_its_line(tmp_path):
    path = tmp_path / "belief.yaml"
    path.write_text(
        "mhd_ars:\n  numerator: [1.0]\n  denominator: [0.001, 1.0]\n  output_noise: 3 mm\n", encoding="utf-8"
    )
    with pytest.raises(ScenarioError, match=r"belief.yaml:4: mhd_ars.output_noise"):
        specs(["kalman"], belief=path)
