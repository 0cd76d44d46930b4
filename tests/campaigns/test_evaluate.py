"""Many seeds at once: the same numbers as one run each."""

from __future__ import annotations

import pickle
import tracemalloc
from copy import deepcopy

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from threadpoolctl import threadpool_info, threadpool_limits

import testbed
from testbed.fusion import FILTERS
from testbed.fusion.filters.wideband import Wideband
from tests.scenario.test_loader import SCENARIOS
from tests.scenes import short, short_file

SEEDS = [3, 2024]


def differences(ours, theirs, path=""):
    """Yield where two metrics differ by more than 1e-9 of the value, rounding of nothing aside."""
    if isinstance(theirs, dict):
        assert ours.keys() == theirs.keys(), path
        for key in theirs:
            yield from differences(ours[key], theirs[key], f"{path}.{key}")
    elif isinstance(theirs, list):
        assert len(ours) == len(theirs), path
        for i, (a, b) in enumerate(zip(ours, theirs, strict=True)):
            yield from differences(a, b, f"{path}[{i}]")
    elif isinstance(theirs, float) and isinstance(ours, float):
        if abs(ours - theirs) > 1e-9 * abs(theirs) + 1e-18:
            yield path, ours, theirs
    elif ours != theirs:
        yield path, ours, theirs


def of_run(scenario, seed):
    """Return the metrics of a run without the fluid over the height of a channel: a picture for its report."""
    found = testbed.run(scenario, seed=seed).metrics.to_dict()
    found.pop("profiles", None)
    return found


def agrees(scenario, seeds=SEEDS):
    found = testbed.evaluate(scenario, seeds)
    for seed, metrics in zip(seeds, found, strict=True):
        assert list(differences(metrics.to_dict(), of_run(scenario, seed))) == []


def shortened(path):
    """Return a shipped scenario of a tenth of a second, or of 200 samples where those are slower."""
    scenario = testbed.load_scenario(path)
    length = max(0.1, 200.0 / scenario.base_rate_hz)
    gone = dict.fromkeys({"expect", "detail"} & set(scenario.source))
    if scenario.pointing is not None:
        gone |= {"pointing.windows": ["1 ms", "10 ms"]}
        gone |= {"pointing.tracker.fades": []} if scenario.pointing.tracker.fades else {}
    return scenario.with_(duration=f"{length} s", settle=f"{length / 2} s", **gone)


@pytest.mark.parametrize("path", SCENARIOS, ids=lambda path: path.stem)
def test_metrics_are_those_of_a_run(path):
    agrees(shortened(path))


# What may stand between the noise and the reading, one by one and together.
GYRO = {
    "turn_on_bias": "0.2 deg/s",
    "dead_band": "0.01 deg/s",
    "dropped": "0.05",
    "jitter": "200 us",
    "fir": "average",
    "scale_factor_asymmetry": "0.01",
    "sensitivity": "100 LSB/(deg/s)",
    "cross_axis": ["0.01", "0.02"],
    "range": "0.96 deg/s",
    "rate_ramp": "0.1 deg/s^2",
    "noise": False,
}
MHD = {
    "adc_bits": 10,
    "delay": "130 us",
    "second_pole": "3 kHz",
    "saturation": {"limit": "0.32 V", "recovery_time": "1 ms"},
    "scale_factor_error": "1 %",
    "noise": False,
}


@settings(max_examples=8, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    gyro=st.sets(st.sampled_from(sorted(GYRO))),
    mhd=st.sets(st.sampled_from(sorted(MHD))),
    filters=st.sets(st.sampled_from(["kalman", "arw_shakf", "complementary"]), min_size=1),
    engine=st.sampled_from(["modal", "mujoco"]),
    seed=st.integers(0, 2**32),
)
def test_metrics_are_those_of_a_run_whatever_the_instruments(tmp_path, gyro, mhd, filters, engine, seed):
    keys = {f"sensors.mems_gyro.{key}": GYRO[key] for key in gyro} | {f"sensors.mhd_ars.{key}": MHD[key] for key in mhd}
    if "noise" in gyro | mhd:
        filters = {"kalman"}
    exposed = "cross_axis" in gyro
    scenario = short(tmp_path).with_(
        **keys,
        fusion={name: {"belief": "eq39"} for name in filters},
        expect=None,
        duration="0.12 s",
        settle="0.05 s",
        **{"turntable.engine": "mujoco" if exposed else engine},
    )
    agrees(scenario, [seed, seed + 1])


def test_banks_go_side_by_side_with_other_filters(tmp_path, monkeypatch):
    """More seeds than the others take at a time, in buffers that all share; none of them by itself."""
    few = {"filters": 2, "decades": 9.0, "order": 2, "q": "1e-2 rad^2/s^5", "coloured": False}
    filters = {"wideband": few, "kalman": {"coloured": False}, "arw_shakf": {}}
    changes = {"duration": "0.1 s", "settle": "0.05 s", "turntable.engine": "modal", "fusion": filters, "expect": None}
    scenario = short(tmp_path).with_(**changes)
    expected = [of_run(scenario, seed) for seed in (1, 18)]
    monkeypatch.setattr(Wideband, "_advance", None)
    found = testbed.evaluate(scenario, range(1, 19))
    for ours, theirs in zip((found[0], found[-1]), expected, strict=True):
        assert list(differences(ours.to_dict(), theirs)) == []


@pytest.mark.parametrize("rails", [None, MHD["saturation"]])
def test_johnson_noise_in_front_of_rails_stays_with_its_seed(tmp_path, rails):
    parts = {"sensors.mhd_ars.ring": {"radius": "20 mm", "width": "10 mm"}}
    parts |= {} if rails is None else {"sensors.mhd_ars.saturation": rails}
    agrees(short(tmp_path).with_(**parts, duration="0.12 s", settle="0.05 s"))


@pytest.mark.parametrize("truth_seed", [None, 5])
def test_a_random_truth_belongs_to_the_seed_or_to_its_own(tmp_path, truth_seed):
    noise = {"random": {"psd": "1e-8 rad^2/s", "low": "1 Hz", "high": "50 Hz"}}
    given = {} if truth_seed is None else {"truth_seed": truth_seed}
    scenario = short(tmp_path).with_(motion=[noise], **given, duration="0.1 s", settle="0.05 s")
    agrees(scenario)
    one, other = (found.turntable.command_to_inertial_rms_deg_s for found in testbed.evaluate(scenario, [1, 2]))
    assert (one == other) == (truth_seed is not None)


def test_settings_are_evaluated_each_under_every_seed(tmp_path):
    scenario = short(tmp_path).with_(duration="0.1 s", settle="0.05 s")
    changes = [
        {},
        {"sensors.mems_gyro.angle_random_walk": "1 deg/sqrt(h)"},
        {"fusion.kalman.q": "1 (deg/s)^2/s"},
        {"settle": "0.02 s"},
    ]
    table = testbed.evaluate(scenario, SEEDS, changes)
    assert [len(row) for row in table] == [2] * 4
    for change, row in zip(changes, table, strict=True):
        for seed, metrics in zip(SEEDS, row, strict=True):
            assert list(differences(metrics.to_dict(), of_run(scenario.with_(**change), seed))) == []


def test_settings_that_move_the_truth_have_their_own(tmp_path):
    scenario = short(tmp_path).with_(duration="0.1 s", settle="0.05 s")
    slow, fast = testbed.evaluate(scenario, [1], [{"motion.0.sine.frequency": f} for f in ("5 Hz", "20 Hz")])
    assert [row[0].line_freq_hz for row in (slow, fast)] == [[5.0], [20.0]]


def test_what_is_bad_is_said_before_anything_runs(tmp_path, monkeypatch):
    monkeypatch.setattr("testbed.campaigns.evaluate.Lockstep", None)
    scenario = short(tmp_path)
    with pytest.raises(testbed.ScenarioError, match="seed"):
        testbed.evaluate(scenario, [1, -1])
    with pytest.raises(testbed.ScenarioError, match="duratoin"):
        testbed.evaluate(scenario, [1], [{"duratoin": "1 s"}])
    assert testbed.evaluate(scenario, []) == []


def test_arguments_and_results_pickle(tmp_path):
    scenario = short(tmp_path).with_(duration="0.1 s", settle="0.05 s")
    arguments = pickle.loads(pickle.dumps((scenario, [1, 1, 2], [{}, {"settle": "0.01 s"}])))
    found = testbed.evaluate(*arguments)
    assert pickle.loads(pickle.dumps(found)) == found
    assert found[0][0] == found[0][1]


def test_sums_take_one_thread_and_leave_the_setting_as_it_was(tmp_path, monkeypatch):
    """With threads a block's sums give other last digits, and beside a busy core they wait."""
    seen = []
    monkeypatch.setattr("testbed.campaigns.evaluate._play", lambda *_: seen.append(_threads()) or {(0, 1): None})
    # Two, since the environment of the tests may have set one.
    with threadpool_limits(limits=2, user_api="blas"):
        before = _threads()
        testbed.evaluate(short(tmp_path), [1])
        after = _threads()
    assert set(before) == {2}
    assert seen == [[1] * len(before)]
    assert after == before


def _threads():
    return [library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"]


def test_nothing_is_written(tmp_path, monkeypatch):
    path = short_file(tmp_path)
    (tmp_path / "empty").mkdir()
    monkeypatch.chdir(tmp_path / "empty")
    testbed.evaluate(path, [1])
    assert list((tmp_path / "empty").iterdir()) == []


def test_memory_is_flat_in_duration_and_seeds(tmp_path, monkeypatch):
    """Peak of what is allocated, the metrics that are returned left out: twice the seeds or the length add less than
    10 %.
    """
    scenario = short(tmp_path).with_(fusion={"kalman": {}}, expect=None, **{"turntable.engine": "modal"})
    testbed.evaluate(scenario, [1])

    def peak(seconds, n):
        tracemalloc.start()
        found = testbed.evaluate(scenario.with_(duration=f"{seconds} s"), range(n))
        kept, most = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        assert len(found) == n
        return most - kept

    # Whole blocks, and as many seeds as advance together.
    monkeypatch.setattr("testbed.campaigns.evaluate._TOGETHER", 20)
    once = peak(2, 40)
    assert peak(5, 40) < 1.1 * once
    assert peak(2, 80) < 1.1 * once


@pytest.mark.parametrize("name", sorted(FILTERS))
def test_a_copied_filter_goes_on_by_itself(name, rng):
    from testbed.fusion.belief import default_belief
    from testbed.parts import resolve

    rates = {"mhd_ars": 20_000.0, "mems_gyro": 2_000.0}
    kind = resolve("filter", name, FILTERS)
    stage = kind(default_belief(), rates, kind.Parameters())
    blocks = [
        {"mhd_ars": 1e-3 * rng.standard_normal(200), "mems_gyro": 1e-3 * rng.standard_normal(20)} for _ in range(3)
    ]
    stage.process(blocks[0])
    twin = deepcopy(stage)
    other = twin.process(blocks[1]).rate
    twin.process(blocks[2])
    assert np.array_equal(stage.process(blocks[1]).rate, other)
