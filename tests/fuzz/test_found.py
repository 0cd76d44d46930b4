"""What the fuzz has found, each as one case by hand."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
from pydantic import ValidationError

import testbed
from testbed.campaigns.study import load_study
from testbed.cli.app import app
from testbed.errors import MOST_QUOTED, ScenarioError
from testbed.fusion.filters.self_calibrating import SelfCalibratingParameters
from testbed.identification.session import identify_sensors
from testbed.logs import read_log
from testbed.logs.values import ValueScan
from tests.fuzz.texts import BASE, RESPONSE, STUDY


@pytest.mark.parametrize(
    "inner", [{"x" * 300: {}}, {"wideband": {"x" * 300: 1}}, {"wideband": dict.fromkeys("abcdefghij", 1)}]
)
def test_names_inside_a_nested_filter_are_not_echoed_whole(inner):
    with pytest.raises(ValidationError) as refused:
        SelfCalibratingParameters(filter=inner)
    (found,) = refused.value.errors()
    assert "x" * (MOST_QUOTED + 1) not in found["msg"]
    assert found["msg"].count("Extra inputs") <= 5


@pytest.mark.parametrize("size", [1e160, 1e300])
def test_a_channel_of_numbers_whose_squares_overflow_has_no_finite_scatter(size):
    scan = ValueScan()
    scan.add(np.array([0.0, size, -size, np.nan, 1.0]))
    found = scan.result()
    assert (found.low, found.high, found.n_missing) == (-size, size, 1)
    assert found.std == np.inf


def test_a_sensor_whose_readings_are_beyond_all_rates_is_refused_and_named(tmp_path):
    head, *rows = RESPONSE.splitlines()
    lines = [f"{row}e60" for row in rows]
    (tmp_path / "log.csv").write_text("\n".join([head, *lines]) + "\n")
    with pytest.raises(ScenarioError, match=r"gyro: .*a reading may be damaged"):
        identify_sensors(read_log(tmp_path / "log.csv"), "laser", "gyro")


@pytest.mark.parametrize(
    "words",
    [
        ("replay", "x.csv", "--start", "9" * 5000),
        ("replay", "x.csv", "--settle", f"-{'9' * 5000} s"),
        ("replay", "x.csv", "--filter", f"{'x' * 5000},,"),
        ("sweep", "study.yaml", "--only", f"{'9' * 5000}:1"),
    ],
    ids=["start", "settle", "filter", "only"],
)
def test_an_option_is_not_echoed_whole(tmp_path, monkeypatch, words):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "base.yaml").write_text(BASE)
    (tmp_path / "study.yaml").write_text(STUDY)
    with pytest.raises(ScenarioError) as refused:
        app(list(words), standalone_mode=False)
    assert len(str(refused.value)) < 4 * MOST_QUOTED


def test_a_response_that_no_model_can_be_fitted_to_is_refused_and_named(tmp_path):
    """One reading at the end of the numbers, whose response is infinite; and a record that ends early."""
    head, *rows = RESPONSE.splitlines()
    damaged = [*rows[:24], rows[24].rpartition(",")[0] + ",1.7e308", *rows[25:]]
    for lines in (damaged, damaged[:162]):
        (tmp_path / "log.csv").write_text("\n".join([head, *lines]) + "\n")
        # Outside of the tests NumPy goes on where a number overflows.
        with np.errstate(all="ignore"), pytest.raises(ScenarioError, match="gyro"):
            identify_sensors(read_log(tmp_path / "log.csv"), "laser", "gyro")


def test_sensors_that_a_belief_knows_are_not_echoed_whole():
    sensors = {"mems_gyro": {"preset": "adis16505_filtered"}, "mhd_ars": {"preset": "sx300"}}
    sensor = {"numerator": [1.0], "denominator": [1.0], "output_noise": "1e-6 rad/s/sqrt(Hz)"}
    belief = {"mems_gyro": sensor, "s" * 300: sensor}
    with pytest.raises(ScenarioError) as refused:
        testbed.Scenario.from_dict(
            {
                "name": "long",
                "duration": "1 s",
                "motion": [{"static": {}}],
                "sensors": sensors,
                "fusion": {"kalman": {"belief": belief}},
            }
        )
    assert "says nothing of sensor" in str(refused.value)
    assert "s" * (MOST_QUOTED + 1) not in str(refused.value)


def test_a_value_of_an_axis_is_not_echoed_whole(tmp_path):
    (tmp_path / "base.yaml").write_text(BASE)
    (tmp_path / "study.yaml").write_text(
        f"name: long\nbase: base.yaml\nvary: {{sensors.mems_gyro.bias_instability: [{{preset: {'s' * 300}}}]}}\n"
    )
    with pytest.raises(ScenarioError) as refused:
        load_study(tmp_path / "study.yaml")
    assert "case 0" in str(refused.value)
    assert "s" * (MOST_QUOTED + 1) not in str(refused.value)


def test_a_first_step_beyond_the_motor_is_a_finding_for_modes_too():
    wheel = {
        "speed": "1800 rev/min",
        "stop_speed": "3000 rev/min",
        "inertia": "1 kg*m^2",
        "harmonics": [{"number": 1.0, "coefficient": "13.7 g*cm^2"}],
        "modes": [{"frequency": "41 Hz", "damping": 0.01, "gain": 1e9}],
    }
    with pytest.raises(ScenarioError, match="more than the motor has"):
        testbed.Scenario.from_dict(
            {
                "name": "hard",
                "duration": "1 s",
                "turntable": {"preset": "air_bearing", "engine": "modal"},
                "motion": [{"reaction_wheel": wheel}],
            }
        )


@pytest.mark.parametrize("position", [["0 m"] * 4, ["0 m"] * 150, ["0 m"] * 2, [], ["0 m", "0 m", "0 m", {"x": 1}]])
def test_a_list_of_the_wrong_length_beside_a_data_sheet_is_one_finding(position):
    """A gyro joins the findings of its data sheet with those of its fields, which keep what they count."""
    with pytest.raises(ScenarioError, match=r"mounting\.position.*(at most 3 entries|is required)"):
        testbed.Scenario.from_dict(
            {
                "name": "long",
                "duration": "1 s",
                "motion": [{"static": {}}],
                "sensors": {"mems_gyro": {"preset": "adis16505_filtered", "mounting": {"position": position}}},
            }
        )


@pytest.mark.parametrize(
    "ends", [["1 Hz", f"2 {'s' * 300}"], ["1 Hz", "s" * 300], [f"{'9' * 300} Hz", "1 s"], [f"-1 {'s' * 300}"] * 2]
)
@pytest.mark.parametrize("spread", ["linear", "log", "random", "latin_hypercube"])
def test_ends_of_an_axis_are_not_echoed_whole(tmp_path, spread, ends):
    (tmp_path / "base.yaml").write_text(BASE)
    axis = json.dumps({spread: ends, "points": 3})
    (tmp_path / "study.yaml").write_text(f"name: long\nbase: base.yaml\nvary: {{duration: {axis}}}\n")
    with pytest.raises(ScenarioError, match="vary") as refused:
        load_study(tmp_path / "study.yaml")
    assert re.search(rf"(\w)\1{{{MOST_QUOTED}}}", str(refused.value)) is None
