"""A study: what its axes take, that every case is checked first, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

from testbed.campaigns.axes import Axis, jointly_drawn, values_of
from testbed.campaigns.rows import unit_at
from testbed.campaigns.study import load_study
from testbed.errors import ScenarioError

BASE = """
name: base
seed: 7
duration: 0.2 s
settle: 0.1 s
turntable: {mode: fixed}
motion: [{sine: {frequency: 10 Hz, rate: 1 deg/s}}]
sensors: {mhd_ars: {preset: sx300}, mems_gyro: {preset: adis16505}}
fusion: {kalman: {}, steady_state: {}}
expect: {kalman: {rmse_deg_s: "< 1e-9"}}
"""


def written(folder, text):
    (folder / "base.yaml").write_text(BASE)
    (folder / "study.yaml").write_text("name: study\nbase: base.yaml\n" + text)
    return folder / "study.yaml"


def axis(**keys):
    return Axis.model_validate(keys)


def test_points_are_at_equal_distances_or_ratios_and_carry_the_unit():
    assert values_of(axis(linear=["1 Hz", "3 Hz"], points=3)) == ["1 Hz", "2 Hz", "3 Hz"]
    assert values_of(axis(log=["0.5 Hz", "500 Hz"], points=4)) == ["0.5 Hz", "5 Hz", "50 Hz", "500 Hz"]
    assert values_of(axis(linear=[1, 3], points=3)) == [1, 2, 3]
    assert values_of(axis(linear=[0, 1], points=3)) == [0, 0.5, 1]
    assert values_of(Axis.model_validate([None, {"preset": "mpu6050"}])) == [None, {"preset": "mpu6050"}]


def test_a_hypercube_has_one_point_in_each_part_of_each_axis_and_random_draws_stay_between_their_ends():
    axes = {"a": axis(latin_hypercube=["0 Hz", "10 Hz"], points=10), "b": axis(latin_hypercube=[5, 15], points=10)}
    points = jointly_drawn(axes, 3)
    for key, low in (("a", 0.0), ("b", 5.0)):
        found = sorted(float(str(point[key]).split()[0]) for point in points)
        assert [int(value - low) for value in found] == list(range(10))
    free = jointly_drawn({"a": axis(random=["2 Hz", "4 Hz"], points=200)}, 0)
    values = np.array([float(point["a"].removesuffix(" Hz")) for point in free])
    assert ((values >= 2.0) & (values <= 4.0)).all()
    # The mean of 200 even draws lies within four standard deviations of the middle.
    assert abs(values.mean() - 3.0) < 4.0 * 2.0 / np.sqrt(12.0 * 200.0)
    assert free == jointly_drawn({"a": axis(random=["2 Hz", "4 Hz"], points=200)}, 0)
    assert free != jointly_drawn({"a": axis(random=["2 Hz", "4 Hz"], points=200)}, 1)


def test_another_axis_does_not_move_the_draws_of_this_one():
    alone = jointly_drawn({"a": axis(random=[0, 1], points=5)}, 0)
    beside = jointly_drawn({"b": axis(random=[0, 1], points=5), "a": axis(random=[0, 1], points=5)}, 0)
    assert [point["a"] for point in alone] == [point["a"] for point in beside]


def test_cases_are_the_product_in_order_and_the_base_is_prepared(tmp_path):
    text = """
vary:
  motion.0.sine.frequency: [5 Hz, 20 Hz]
  fusion.kalman.order: {linear: [1, 3], points: 3}
seeds: 4
"""
    study = load_study(written(tmp_path, text))
    assert [tuple(case.values.values()) for case in study.cases] == [
        ("5 Hz", 1),
        ("5 Hz", 2),
        ("5 Hz", 3),
        ("20 Hz", 1),
        ("20 Hz", 2),
        ("20 Hz", 3),
    ]
    assert study.cases[4].scenario.lines == (20.0,)
    assert study.cases[4].scenario.fusion["kalman"].parameters.order == 2
    # The base's seed and those that follow it, its expectations left out, by modes where they hold.
    assert study.seeds == (7, 8, 9, 10)
    assert study.cases[0].scenario.expect == ()
    assert study.cases[0].scenario.turntable.engine == "auto"
    assert len({case.sha256 for case in study.cases}) == 6


def test_an_engine_that_the_base_names_stays(tmp_path):
    path = written(tmp_path, "seeds: 1\n")
    (tmp_path / "base.yaml").write_text(BASE.replace("{mode: fixed}", "{mode: fixed, engine: mujoco}"))
    assert load_study(path).cases[0].scenario.turntable.engine == "mujoco"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("vary: {motion.0.sine.frequency: {log: [1 Hz, 10 Hz]}}", "expected points beside log"),
        ("vary: {motion.0.sine.frequency: {log: [0 Hz, 10 Hz], points: 3}}", "expected ends above zero"),
        ("vary: {motion.0.sine.frequency: {log: [1 Hz, 1 kHz], points: 3}}", "expected both ends in the same unit"),
        ("vary: {motion.0.sine.frequency: {list: [1 Hz], points: 3}}", "expected no points beside a list"),
        ("vary: {motion.0.sine.frequency: {points: 3}}", "expected one of list, linear"),
        ("vary: {motion.0.sine.frequency: {list: [1 Hz], log: [1 Hz, 2 Hz], points: 3}}", "got list, log"),
        ("vary: {motion.0.sine.frequency: {linear: [one, two], points: 3}}", "expected two numbers with their unit"),
        ("vary: {motion.0.sine.frequency: [1 Hz, 2 deg]}", r"case 1 \(motion.0.sine.frequency 2 deg\)"),
        ("vary: {motion.0.sine.frequncy: [1 Hz]}", "frequncy"),
        ("vary: {sensors.mems_gyro.range: [0.05 deg/s]}", "case 0"),
        ("vary: {duration: {linear: [1 s, 2 s], points: 10000}, settle: [0 s, 0.1 s, 0.2 s]}", "at most 20000 cases"),
        (
            "vary: {duration: {random: [1 s, 2 s], points: 3}, settle: {random: [0 s, 1 s], points: 4}}",
            "same points on all drawn axes",
        ),
        ("vary: {seed: [1, 2]}", "expected no axis of seeds"),
        ("vary: {duration: {linear: [1e400 s, 2 s], points: 2}}", "expected two numbers with their unit"),
        ("seeds: 0", "seeds"),
        ("seeds: {until: {rmse: 0 %}, most: 10}", "rmse"),
        ("seeds: {until: {rmse: 5 %}}", "most"),
        ("sedes: 3", "did you mean 'seeds'"),
        ("draws: -1", "draws"),
    ],
)
def test_what_is_wrong_is_named_before_anything_runs(tmp_path, text, message):
    with pytest.raises(ScenarioError, match=message):
        load_study(written(tmp_path, f"{text}\n"))


def test_findings_of_cases_stand_at_their_axis_all_at_once(tmp_path):
    text = "vary:\n  duration: [0.2 s, 0.15 s]\n  motion.0.sine.frequency: [1 deg, 2 deg]\n"
    with pytest.raises(ScenarioError) as caught:
        load_study(written(tmp_path, text))
    found = caught.value.problems
    assert [problem.line for problem in found] == [5] * 4
    assert all(problem.file.endswith("study.yaml") for problem in found)


def test_a_base_that_is_not_there_is_named(tmp_path):
    path = written(tmp_path, "seeds: 1\n")
    (tmp_path / "base.yaml").unlink()
    with pytest.raises(ScenarioError, match=r"base\.yaml: cannot be read"):
        load_study(path)


def test_a_list_of_nothing_is_refused_in_our_words(tmp_path):
    path = written(tmp_path, "vary: {duration: {list: []}}\n")
    with pytest.raises(ScenarioError, match=r"vary\.duration\.list: expected at least 1 entry, got 0: add some"):
        load_study(path)


@pytest.mark.parametrize(
    ("key", "unit"),
    [
        ("motion.0.sine.frequency", "Hz"),
        ("settle", "s"),
        ("sensors.mhd_ars.channel.height", "m"),
        ("sensors.mems_gyro.angle_random_walk", "rad*s^-0.5"),
        ("fusion.kalman.order", "-"),
        ("motion.3.sine.frequency", "-"),
        ("sensors.mems_gyro", "-"),
    ],
)
def test_a_value_at_a_key_has_the_unit_of_its_part(tmp_path, key, unit):
    scenario = load_study(written(tmp_path, "seeds: 1\n")).cases[0].scenario
    assert unit_at(scenario, key) == unit
