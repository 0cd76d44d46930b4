"""Scenarios: what is understood, and what bad input gets: file, line, key, expectation."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ruamel.yaml import YAML

import testbed
from testbed.errors import ScenarioError
from testbed.runs.folder import write_scenario
from testbed.scenario.loader import load_scenario

SCENARIOS = sorted((Path(__file__).parents[2] / "scenarios").rglob("*.yaml"))

GOOD = """\
name: good
seed: 7
duration: 2 s
settle: 1 s
turntable: {preset: air_bearing}
motion:
  - sine: {frequency: 0.5 Hz, angle: 5.555 mrad}
  - sine: {frequency: 10 Hz, rate: 0.18 deg/s, phase: 30 deg}
sensors:
  mhd_ars: {preset: sx300}
  mems_gyro: {preset: adis16505_filtered, noise: off}
fusion:
  kalman: {q: 0.1 (deg/s)^2/s}
expect:
  kalman: {rmse_deg_s: "< 0.0143"}
"""


def load(tmp_path, text=GOOD, **options):
    path = tmp_path / "scenario.yaml"
    path.write_text(text, encoding="utf-8")
    return load_scenario(path, **options)


def refused(tmp_path, old, new):
    """Return the problems that appear when `old` in the good scenario becomes `new`, and check their file."""
    assert old in GOOD
    with pytest.raises(ScenarioError) as caught:
        load(tmp_path, GOOD.replace(old, new))
    assert all(problem.file == str(tmp_path / "scenario.yaml") for problem in caught.value.problems)
    return caught.value.problems


def test_load_understands_units_presets_and_switches(tmp_path):
    scenario = load(tmp_path)
    assert scenario.frame.duration == 2.0
    assert scenario.lines == (0.5, 10.0)
    assert scenario.motion[1][1].phase == pytest.approx(np.pi / 6, rel=1e-15)
    assert scenario.sensors["mems_gyro"].noise is False
    assert scenario.sensors["mhd_ars"].noise is True
    assert scenario.sensors["mhd_ars"].channel.height == 0.015
    assert scenario.fusion["kalman"].parameters.q == pytest.approx(0.1 * np.deg2rad(1.0) ** 2, rel=1e-14)
    assert scenario.expect[0].met(0.0142)
    assert not scenario.expect[0].met(0.0143)
    assert not scenario.expect[0].met(None)


@pytest.mark.parametrize("path", SCENARIOS, ids=lambda p: p.stem)
def test_load_accepts_every_shipped_scenario_and_names_it_as_its_file(path):
    assert load_scenario(path).name == path.stem


def test_load_of_the_resolved_scenario_gives_the_same_run(tmp_path):
    """scenario.yaml of a run folder is a scenario: SI values survive the round trip to the last bit."""
    first = load(tmp_path)
    write_scenario(tmp_path, first.resolved(), {})
    second = load_scenario(tmp_path / "scenario.yaml")
    assert second.resolved() == first.resolved()
    assert np.array_equal(testbed.run(second).fusion["kalman"].rate, testbed.run(first).fusion["kalman"].rate)


@pytest.mark.parametrize(
    ("old", "new", "line", "key", "message"),
    [
        ("seed: 7", "sead: 7", 2, "sead", "did you mean 'seed'"),
        ("duration: 2 s", "duration: 2", 3, "duration", "the unit is missing"),
        ("duration: 2 s", "duration: 2 Hz", 3, "duration", "wrong dimension"),
        ("duration: 2 s", "duration: .nan", 3, "duration", "expected a quantity in s"),
        ("duration: 2 s", "duration: nan s", 3, "duration", "not finite"),
        ("duration: 2 s", "duration: inf s", 3, "duration", "not finite"),
        ("duration: 2 s", "duration: -2 s", 3, "duration", "expected more than 0"),
        ("duration: 2 s", "duration: 2.00001 s", 3, "duration", "multiple of the base step"),
        ("settle: 1 s", "settle: 3 s", 4, "settle", "expected less than the duration"),
        ("settle: 1 s", "settle: 2 s", 4, "settle", "expected less than the duration"),
        ("seed: 7", "seed: -7", 2, "seed", "greater than or equal to 0"),
        ("seed: 7", "seed: 7.5", 2, "seed", "integer"),
        ("name: good", "name: ../bad", 1, "name", "match pattern"),
        ("name: good\n", "", None, "name", "is required"),
        ("preset: air_bearing", "preset: air_bering", 5, "turntable.preset", "did you mean 'air_bearing'"),
        (
            "{preset: air_bearing}",
            "{preset: air_bearing, mode: flying}",
            5,
            "turntable.mode",
            "'servo', 'digital', 'ideal' or 'fixed'",
        ),
        (
            "{preset: air_bearing}",
            "{floor: {lines: [{axis: x, frequency: 3 Hz, angle: 1 urad}]}}",
            5,
            "turntable.floor.lines.0",
            "expected displacement or acceleration for axis x, got angle",
        ),
        (
            "{preset: air_bearing}",
            "{floor: {lines: [{axis: x, frequency: 10 kHz, displacement: 1 nm}]}}",
            5,
            "turntable",
            "expected frequencies below 10000 Hz",
        ),
        (
            "{preset: air_bearing}",
            "{floor: {bands: [{axis: rz, low: 1 Hz, high: 9 Hz, angular_acceleration_psd: 1e-8 (m/s^2)^2/Hz}]}}",
            5,
            "turntable.floor.bands.0.angular_acceleration_psd",
            "wrong dimension",
        ),
        (
            "{preset: air_bearing}",
            "{mode: ideal, wobble: [{axis: rx, angle: 1 urad, periods: 2}]}",
            5,
            "turntable",
            "wobble: expected mode 'servo' or 'digital'",
        ),
        (
            "{preset: air_bearing}",
            "{mode: digital, digital: {controller_rate: 3 kHz}}",
            5,
            "turntable",
            "divided by a whole number",
        ),
        (
            "{preset: air_bearing}",
            "{mode: digital, digital: {controller_rate: 500 Hz}}",
            5,
            "turntable",
            "expected a stable digital servo",
        ),
        (
            "{preset: air_bearing}",
            "{earth_rate: {latitude: 91 deg}}",
            5,
            "turntable.earth_rate.latitude",
            "expected at most",
        ),
        (
            "{preset: air_bearing}",
            "{earth_rate: {latitude: 48}}",
            5,
            "turntable.earth_rate.latitude",
            "the unit is missing",
        ),
        ("{preset: air_bearing}", "{rotor_mass: -20 kg}", 5, "turntable.rotor_mass", "expected more than 0"),
        ("frequency: 0.5 Hz", "frequency: 0.5 rad/s", 7, "motion.0.sine.frequency", "wrong dimension"),
        ("angle: 5.555 mrad", "angel: 5.555 mrad", 7, "motion.0.sine.angel", "did you mean 'angle'"),
        ("angle: 5.555 mrad", "angle: 5.555 mrad, rate: 1 deg/s", 7, "motion.0.sine", "exactly one"),
        ("- sine: {frequency: 0.5", "- sinus: {frequency: 0.5", 7, "motion.0.sinus", "did you mean 'sine'"),
        ("frequency: 10 Hz", "frequency: 1000 Hz", 8, "motion.1.sine", "sees only what is below 1000 Hz"),
        ("rate: 0.18 deg/s", "rate: 31 deg/s", 6, "motion", "beyond the range of mhd_ars"),
        ("preset: sx300", "preset: sx30", 10, "sensors.mhd_ars.preset", "did you mean 'sx300'"),
        ("mhd_ars: {preset: sx300}", "my_ars: {sample_rate: 20 kHz}", 10, "sensors.my_ars.type", "unknown sensor"),
        ("noise: off", "noise: maybe", 11, "sensors.mems_gyro.noise", "bool"),
        (
            "noise: off",
            "angle_random_walk: -0.15 deg/sqrt(h)",
            11,
            "sensors.mems_gyro.angle_random_walk",
            "expected at least 0",
        ),
        ("  kalman: {q:", "  kallman: {q:", 13, "fusion.kallman.type", "did you mean 'kalman'"),
        ("{q: 0.1 (deg/s)^2/s}", "{q: 0.1 deg/s}", 13, "fusion.kalman.q", "wrong dimension"),
        ("{q: 0.1 (deg/s)^2/s}", "{belief: eq93}", 13, "fusion.kalman.belief", "eq39"),
        (
            "{q: 0.1 (deg/s)^2/s}",
            "{type: nowhere:Nothing}",
            13,
            "fusion.kalman.type",
            "unknown filter 'nowhere:Nothing'",
        ),
        ("{q: 0.1 (deg/s)^2/s}", "{belief: [1]}", 13, "fusion.kalman.belief", "expected the name of a belief"),
        ("{q: 0.1 (deg/s)^2/s}", "{belief: 1}", 13, "fusion.kalman.belief", "expected the name of a belief"),
        ("{q: 0.1 (deg/s)^2/s}", "{belief: {mhd_ars: 1}}", 13, "fusion.kalman.belief.mhd_ars", "got 1"),
        ("{q: 0.1 (deg/s)^2/s}", "{type: 5}", 13, "fusion.kalman.type", "expected a name, got 5"),
        ("{q: 0.1 (deg/s)^2/s}", "{type: [kalman]}", 13, "fusion.kalman.type", "expected a name"),
        ("preset: sx300", "preset: sx300, type: 5", 10, "sensors.mhd_ars.type", "expected a name, got 5"),
        ("preset: sx300", "preset: sx300, type: [mhd_ars]", 10, "sensors.mhd_ars.type", "expected a name"),
        ("seed: 7", f"seed: {2**63}", 2, "seed", "less than or equal to 9223372036854775807"),
        ("seed: 7", f"bandwidth: {'9' * 400} Hz", 2, "bandwidth", "got a text of 403 characters"),
        ('"< 0.0143"', "0.0143", 15, "expect.kalman.rmse_deg_s", "such as '< 0.0143'"),
        ('"< 0.0143"', '"< zero"', 15, "expect.kalman.rmse_deg_s", "such as '< 0.0143'"),
        ("rmse_deg_s:", "rms_deg_s:", 15, "expect.kalman.rms_deg_s", "is no metric"),
        ("expect:\n  kalman:", "expect:\n  kalmann:", 15, "expect.kalmann", "is no sensor or filter"),
    ],
)
def test_load_refuses_with_line_key_and_expectation(tmp_path, old, new, line, key, message):
    problems = refused(tmp_path, old, new)
    assert any(p.key == key and p.line == line and message in p.message for p in problems), [str(p) for p in problems]


def test_load_refuses_a_motion_beyond_the_motor(tmp_path):
    # I A w = 0.05 kg m^2 * 20 deg/s * 2 pi 900 Hz = 98.7 N m, and 2.4 % for the rate loop (2 pi 150 Hz * 25 us),
    # against 6 N m.
    problems = refused(tmp_path, "frequency: 10 Hz, rate: 0.18 deg/s", "frequency: 900 Hz, rate: 20 deg/s")
    assert any(re.search(r"needs a torque of 101 N m, more than the motor's 6 N m", p.message) for p in problems), (
        problems
    )


def test_high_torque_preset_takes_a_motion_that_the_plain_one_refuses(tmp_path):
    motion = ("frequency: 10 Hz, rate: 0.18 deg/s", "frequency: 60 Hz, rate: 50 deg/s")
    sensors = (
        "  mhd_ars: {preset: sx300}\n  mems_gyro: {preset: adis16505_filtered, noise: off}",
        "  mems_gyro: {preset: adis16505}",
    )
    text = GOOD.replace(*motion).replace(*sensors)
    with pytest.raises(ScenarioError, match=r"needs a torque of 16\.\d N m, more than the motor's 6 N m"):
        load(tmp_path, text)
    assert (
        load(tmp_path, text.replace("preset: air_bearing", "preset: air_bearing_high_torque")).turntable.torque_limit
        == 26.0
    )


def test_load_shows_all_errors_at_once_in_the_order_of_the_file(tmp_path):
    text = (
        GOOD.replace("seed: 7", "sead: 7")
        .replace("frequency: 0.5 Hz", "frequency: 0.5 s")
        .replace("0.1 (deg/s)^2/s", "nan (deg/s)^2/s")
    )
    with pytest.raises(ScenarioError) as caught:
        load(tmp_path, text)
    assert [p.line for p in caught.value.problems] == [2, 7, 13]


def test_load_refuses_a_repeated_key_with_its_line(tmp_path):
    (problem,) = refused(tmp_path, "settle: 1 s", "duration: 3 s")
    assert problem.line == 4
    assert "repeated key" in problem.message


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "is empty"),
        (b"# nothing\n", "is empty"),
        (b"- a\n- b\n", "expected a mapping"),
        (b"just words", "expected a mapping"),
        (b"name: [unclosed", "not YAML"),
        (b"name: a\n  bad indent: b\n", "not YAML"),
        (b"\x00\x01\x02\x03", "not YAML"),
        (bytes(range(128, 256)), "binary"),
        (b"a: *nowhere\n", "not YAML"),
    ],
    ids=["empty", "comment", "list", "text", "unclosed", "indent", "control", "binary", "alias"],
)
def test_load_refuses_what_is_no_scenario(tmp_path, content, message):
    path = tmp_path / "scenario.yaml"
    path.write_bytes(content)
    with pytest.raises(ScenarioError, match=message):
        load_scenario(path)


def test_load_refuses_a_missing_file_and_a_folder(tmp_path):
    with pytest.raises(ScenarioError, match="No such file"):
        load_scenario(tmp_path / "nothing.yaml")
    with pytest.raises(ScenarioError, match="directory"):
        load_scenario(tmp_path)


def test_load_finds_a_recorded_motion_beside_the_scenario_and_its_bad_line(tmp_path):
    record = tmp_path / "record.csv"
    record.write_text("t,w\n" + "\n".join(f"{0.01 * i:.2f},{0.1 * i % 1}" for i in range(300)))
    entry = "- recorded: {file: record.csv, time: {column: t, unit: s}, rate: {column: w, unit: deg/s}}"
    text = GOOD.replace("- sine: {frequency: 0.5 Hz, angle: 5.555 mrad}", entry)
    assert load(tmp_path, text).motion[0][0] == "recorded"
    record.write_text(record.read_text().replace("\n0.50,", "\nx,"))
    with pytest.raises(ScenarioError) as caught:
        load(tmp_path, text)
    assert caught.value.problems[0].file == str(record)
    assert caught.value.problems[0].line == 52


def test_load_takes_a_users_own_filter_by_its_path(tmp_path, monkeypatch):
    (tmp_path / "users_filter.py").write_text(
        "class Mine:\n    def __init__(self, belief, sample_rate_hz, parameters):\n        self.parameters = "
        "parameters\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    text = GOOD.replace("kalman: {q: 0.1 (deg/s)^2/s}", "kalman: {type: users_filter:Mine, gain: 3}")
    scenario = load(tmp_path, text, plugins=["users_filter"])
    assert scenario.fusion["kalman"].parameters == {"gain": 3}
    assert scenario.fusion["kalman"].factory.__name__ == "Mine"


@pytest.mark.parametrize(
    "file", ["../record.csv", "/etc/hostname", "sub/../../record.csv", "away/record.csv", "~/x", "a\0b", "x" * 5000]
)
def test_load_reads_a_recorded_motion_only_inside_the_scenarios_folder(tmp_path, file):
    """Also through a link; what stands there is not read and not repeated."""
    inside = tmp_path / "inside"
    inside.mkdir()
    (tmp_path / "record.csv").write_text("secret,column\n1,2\n")
    (inside / "away").symlink_to(tmp_path)
    entry = f"- recorded: {{file: {file!r}, time: {{column: t, unit: s}}, rate: {{column: w, unit: deg/s}}}}"
    text = GOOD.replace("- sine: {frequency: 0.5 Hz, angle: 5.555 mrad}", entry)
    with pytest.raises(ScenarioError) as caught:
        load(inside, text)
    assert "secret" not in str(caught.value)
    assert len(str(caught.value)) < 1000


def test_load_reads_outside_the_folder_when_told_to(tmp_path):
    inside = tmp_path / "inside"
    inside.mkdir()
    (tmp_path / "record.csv").write_text("t,w\n" + "\n".join(f"{0.01 * i:.2f},0.1" for i in range(300)))
    entry = "- recorded: {file: ../record.csv, time: {column: t, unit: s}, rate: {column: w, unit: deg/s}}"
    text = GOOD.replace("- sine: {frequency: 0.5 Hz, angle: 5.555 mrad}", entry)
    with pytest.raises(ScenarioError, match=r"in the scenario's folder; --allow-outside"):
        load(inside, text)
    assert load(inside, text, allow_outside=True).motion[0][0] == "recorded"


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("secret,w\n1,2\n", "no column 't'"),
        ("t,w\n0,1\nsecret key,2\n", "got 'secret key'"),
        ("t,w\n0,1\n0.01,inf\n", "finite number"),
        ("secret\n\nt,w\n0,1\n0.01\nx,y,z\n", "record.csv"),
        ("t,w\n" + "0," + "9" * 200_000 + "\n", "finite number"),
        ("", "expected a recording, got an empty file"),
        ("t,w\n0,1\n", "at least 4 samples"),
        ("t,w\n" + "1" * 100 + "x,1\n", "got '1111"),
    ],
)
def test_a_bad_record_is_refused_and_nothing_but_the_cell_is_repeated(tmp_path, content, message):
    (tmp_path / "record.csv").write_text(content)
    entry = "- recorded: {file: record.csv, time: {column: t, unit: s}, rate: {column: w, unit: deg/s}}"
    with pytest.raises(ScenarioError) as caught:
        load(tmp_path, GOOD.replace("- sine: {frequency: 0.5 Hz, angle: 5.555 mrad}", entry))
    assert message in str(caught.value)
    assert ("secret" in str(caught.value)) == ("secret key" in message)
    assert len(str(caught.value)) < 500


def test_load_takes_two_gyros(tmp_path):
    text = GOOD.replace(
        "  mems_gyro: {preset: adis16505_filtered, noise: off}",
        "  left: {preset: adis16505_filtered}\n  right: {preset: adis16505_filtered}",
    )
    scenario = load(tmp_path, text)
    assert set(scenario.fusion["kalman"].belief) == {"mhd_ars", "left", "right"}


def assert_scenario_or_clear_error(path):
    """Any other exception is a traceback for a user's mistake."""
    problems = None
    try:
        load_scenario(path)
    except ScenarioError as error:
        problems = error.problems
    assert problems is None or (problems and all(problem.message for problem in problems))


keys = st.sampled_from(
    ["name", "duration", "settle", "seed", "motion", "sensors", "fusion", "turntable", "expect", "detail", "bogus"]
)
scalars = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-10, 10),
    st.floats(allow_nan=True),
    st.text(max_size=8),
    st.sampled_from(["1 s", "2 Hz", "off"]),
)
trees = st.recursive(
    scalars,
    lambda inner: st.one_of(st.lists(inner, max_size=3), st.dictionaries(keys, inner, max_size=3)),
    max_leaves=8,
)


@pytest.mark.property
@settings(deadline=None, max_examples=150)
@given(data=st.dictionaries(keys, trees, max_size=6))
def test_load_of_any_tree_gives_a_scenario_or_one_clear_error(tmp_path_factory, data):
    path = tmp_path_factory.mktemp("any") / "scenario.yaml"
    with path.open("w", encoding="utf-8") as stream:
        YAML(typ="safe", pure=True).dump(data, stream)
    assert_scenario_or_clear_error(path)


@pytest.mark.property
@settings(deadline=None, max_examples=150)
@given(position=st.integers(0, len(GOOD) - 1), replacement=st.text(max_size=3))
def test_load_of_a_damaged_scenario_gives_a_scenario_or_one_clear_error(tmp_path_factory, position, replacement):
    path = tmp_path_factory.mktemp("damaged") / "scenario.yaml"
    path.write_text(GOOD[:position] + replacement + GOOD[position + 1 :], encoding="utf-8", errors="ignore")
    assert_scenario_or_clear_error(path)


def test_an_explicit_null_survives_the_round_trip(tmp_path):
    """`memory: null` is the infinite memory of (30), not the default of one second."""
    scenario = load(tmp_path, GOOD.replace("kalman: {q: 0.1 (deg/s)^2/s}", "kalman: {type: arw_shakf, memory: null}"))
    write_scenario(tmp_path, scenario.resolved(), {})
    again = load_scenario(tmp_path / "scenario.yaml")
    assert again.fusion["kalman"].parameters.memory is None
    assert again.resolved() == scenario.resolved()


def test_the_runs_temperature_reaches_an_mhd_ars_that_names_none(tmp_path):
    warm = load(tmp_path, GOOD.replace("seed: 7", "seed: 7\ntemperature: 40 degC"))
    own = load(
        tmp_path,
        GOOD.replace("seed: 7", "seed: 7\ntemperature: 40 degC").replace(
            "preset: sx300", "preset: sx300, temperature: 10 degC"
        ),
    )
    assert load(tmp_path).sensors["mhd_ars"].temperature == 293.15
    assert warm.sensors["mhd_ars"].temperature == 313.15
    assert own.sensors["mhd_ars"].temperature == 283.15
    write_scenario(tmp_path, warm.resolved(), {})
    assert load_scenario(tmp_path / "scenario.yaml").sensors["mhd_ars"].temperature == 313.15
