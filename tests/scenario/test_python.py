"""Python builds what YAML builds: mappings, changed copies, parts; whatever is wrong is a ScenarioError."""

from __future__ import annotations

import pickle
import time
from pathlib import Path

import numpy as np
import pytest
from ruamel.yaml import YAML

import testbed
from testbed.errors import ScenarioError
from testbed.models.motions.sine import Sine
from testbed.scenario.model import Scenario
from testbed.sensors import load_preset
from tests.scenes import SHORT, short, short_file

SCENARIOS = Path(testbed.__file__).parents[1] / "scenarios"


def mapping(text=SHORT):
    return YAML(typ="safe", pure=True).load(text)


@pytest.fixture(scope="module")
def scenario(tmp_path_factory):
    return short(tmp_path_factory.mktemp("python"))


@pytest.mark.parametrize("path", sorted(SCENARIOS.glob("*.yaml")), ids=lambda path: path.stem)
def test_a_mapping_builds_what_its_file_builds(path):
    assert Scenario.from_dict(mapping(path.read_text()), folder=SCENARIOS).resolved() == (
        testbed.load_scenario(path).resolved()
    )


def test_run_takes_a_scenario_a_path_or_a_mapping(tmp_path, scenario):
    rates = [
        testbed.run(given).fusion["kalman"].rate
        for given in (scenario, short_file(tmp_path), str(short_file(tmp_path)), mapping())
    ]
    assert all(np.array_equal(rate, rates[0]) for rate in rates)


def test_run_refuses_what_is_no_scenario():
    with pytest.raises(ScenarioError, match="expected a scenario, its file or a mapping of its keys, got 3"):
        testbed.run(3)


def test_a_mapping_needs_units_as_yaml_does():
    with pytest.raises(ScenarioError) as caught:
        Scenario.from_dict(mapping() | {"duration": 0.5, "settle": "1 m", "duraton": "1 s"})
    assert [(problem.key, problem.message.partition(",")[0]) for problem in caught.value.problems] == [
        ("duraton", "unknown key; did you mean 'duration'? (known: bandwidth"),
        ("duration", "expected a quantity in s"),
        ("settle", "expected a quantity in s"),
    ]


def test_tuples_arrays_numpy_numbers_and_paths_are_what_yaml_has(tmp_path):
    (tmp_path / "rate.csv").write_text("t,w\n" + "".join(f"{0.001 * k},0.0\n" for k in range(2000)))
    term = {"recorded": {"file": Path("rate.csv"), "time": {"column": "t", "unit": "s"}}}
    term["recorded"]["rate"] = {"column": "w", "unit": "deg/s"}
    built = Scenario.from_dict(mapping() | {"motion": (term,), "seed": np.int64(7)}, folder=tmp_path)
    assert built.frame.seed == 7
    assert built.motion[0][1].file == tmp_path / "rate.csv"
    assert built.with_(seed=8).motion[0][1].file == tmp_path / "rate.csv"


def test_the_mapping_is_left_alone_and_not_kept():
    given = mapping()
    built = Scenario.from_dict(given)
    assert given == mapping()
    given["motion"][0]["sine"]["frequency"] = "20 Hz"
    assert built.with_(seed=1).lines == (10.0,)


def test_a_mapping_that_holds_itself_is_refused():
    given = mapping()
    given["fusion"]["kalman"]["belief"] = given
    with pytest.raises(ScenarioError, match="levels"):
        Scenario.from_dict(given)


def test_with_changes_what_it_names_and_nothing_else(scenario):
    changed = scenario.with_(
        duration="1 s",
        **{
            "sensors.mems_gyro.angle_random_walk": "0.3 deg/sqrt(h)",
            "sensors.mhd_ars.channel.height": "14 mm",
            "motion.0.sine.frequency": "4 Hz",
        },
    )
    assert changed.frame.duration == 1.0
    assert changed.lines == (4.0,)
    assert changed.sensors["mems_gyro"].angle_random_walk == pytest.approx(np.deg2rad(0.3) / 60.0)
    # A part of a preset that the file does not have: the rest of the preset stays.
    assert changed.sensors["mhd_ars"].channel.height == 0.014
    assert changed.sensors["mhd_ars"].channel.fluid == scenario.sensors["mhd_ars"].channel.fluid
    before, after = scenario.resolved(), changed.resolved()
    before["duration"], before["motion"] = after["duration"], after["motion"]
    before["sensors"]["mems_gyro"]["angle_random_walk"] = after["sensors"]["mems_gyro"]["angle_random_walk"]
    before["sensors"]["mhd_ars"]["channel"]["height"] = after["sensors"]["mhd_ars"]["channel"]["height"]
    assert before == after
    assert scenario.frame.duration == 0.5


def test_none_removes_and_mappings_and_lists_replace(scenario):
    assert scenario.with_(seed=None).frame.seed == 0
    assert list(scenario.with_(**{"fusion.arw_shakf": None}).fusion) == ["kalman"]
    assert list(scenario.with_(fusion={"shakf": {}}, expect=None).fusion) == ["shakf"]
    two = scenario.with_(motion=[{"static": {}}, {"sine": {"frequency": "3 Hz", "rate": "1 deg/s"}}])
    assert two.lines == (3.0,)
    assert [kind for kind, _ in two.with_(**{"motion.0": None}).motion] == ["sine"]
    gyro = scenario.with_(**{"sensors.mems_gyro": {"preset": "adis16505"}}).sensors["mems_gyro"]
    assert gyro == load_preset("adis16505")


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("duraton", "3 s", "did you mean 'duration'"),
        ("duration", 3.0, "the unit is missing"),
        ("duration", "3 m", "wrong dimension"),
        ("settle", "1e9 s", "expected less than the duration"),
        ("motion.1.sine.frequency", "4 Hz", "expected an index from 0 to 0, got '1'"),
        ("motion.-1.sine.frequency", "4 Hz", "expected an index from 0 to 0, got '-1'"),
        ("motion.first", {}, "expected an index from 0 to 0, got 'first'"),
        ("motion.1", None, "expected an index from 0 to 0, got '1'"),
        ("motion.0.sine.frequenzy", "4 Hz", "did you mean 'frequency'"),
        ("duration.seconds", 3, "expected a mapping or a list to hold 'seconds', got '0.5 s'"),
        ("sensors.mems_gyra.range", "1 deg/s", "mems_gyra"),
        ("sensors.mems_gyro.angle_random_walk", None, "has no 'angle_random_walk' to be removed (there are preset)"),
        ("sensors.fog.drift", None, "has no 'fog' to be removed (there are mhd_ars, mems_gyro)"),
        ("fusion.kalmann.order", 2, "unknown filter 'kalmann'; did you mean 'kalman'"),
        ("", 3, "unknown key"),
    ],
)
def test_a_wrong_key_index_or_value_is_a_scenario_error(scenario, key, value, message):
    with pytest.raises(ScenarioError) as caught:
        scenario.with_(**{key: value})
    assert message in str(caught.value)
    assert any(problem.key.startswith(key.split(".", maxsplit=1)[0]) for problem in caught.value.problems)


def test_all_wrong_keys_are_said_at_once(scenario):
    with pytest.raises(ScenarioError) as caught:
        scenario.with_(**{"motion.7": None, "seed.x": 1})
    assert [problem.key for problem in caught.value.problems] == ["motion.7", "seed.x"]


def test_a_seed_changes_the_source_too(scenario):
    other = scenario.with_seed(5)
    assert (other.frame.seed, other.source["seed"]) == (5, 5)
    assert other.with_(duration="1 s").frame.seed == 5
    assert scenario.source["seed"] == scenario.frame.seed == 11
    assert other.resolved() == scenario.with_(seed=5).resolved()


@pytest.mark.parametrize("seed", [-1, 1.5, "7", None, True])
def test_a_wrong_seed_is_refused(scenario, seed):
    with pytest.raises(ScenarioError, match="seed: "):
        scenario.with_seed(seed)


def test_a_seed_costs_less_than_a_validation(scenario):
    """A thousand seeds in less time than a hundred validations would take, at 10 ms and more each."""
    begin = time.process_time()
    for seed in range(1000):
        scenario.with_seed(seed)
    assert time.process_time() - begin < 1.0


def test_a_scenario_pickles(scenario):
    twin = pickle.loads(pickle.dumps(scenario))
    assert twin.resolved() == scenario.resolved()
    assert twin.with_(duration="1 s").frame.duration == 1.0


def test_a_copy_of_a_part_refuses_what_it_does_not_know(scenario):
    with pytest.raises(ScenarioError, match=r"^duraton: unknown key; did you mean 'duration'"):
        scenario.frame.model_copy(update={"duraton": 3.0})
    with pytest.raises(ScenarioError) as caught:
        load_preset("sx300").model_copy(update={"range": -1.0, "rnage": 1.0})
    assert [problem.key for problem in caught.value.problems] == ["range", "rnage"]


def test_a_copy_of_a_part_is_the_part_with_its_changes():
    sine = Sine(frequency=4.0, rate=0.1)
    assert sine.model_copy(update={"frequency": 5.0}) == Sine(frequency=5.0, rate=0.1)
    assert sine.model_copy(update={"frequency": "5 Hz"}) == Sine(frequency=5.0, rate=0.1)
    assert sine.model_copy() == sine.model_copy(deep=True) == sine.model_copy(update={}) == sine
    gyro = load_preset("adis16505")
    assert gyro.model_copy(update={"noise": False}).model_dump() == gyro.model_dump() | {"noise": False}
