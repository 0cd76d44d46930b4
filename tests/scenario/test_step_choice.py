"""The step of a run: as given, as large as the truth allows, and what is said of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import testbed
from testbed.chain.pipeline import simulate
from testbed.cli.terminal import print_metrics
from testbed.cli.understood import print_scenario
from testbed.errors import ScenarioError
from testbed.judging.table_facts import table_facts
from testbed.scenario.step_choice import TRUTH_ERROR, choose_step
from tests.scenes import short

AUTO = ("{preset: air_bearing}", "{preset: air_bearing, step: auto}")


def truth_of(scenario):
    _, blocks = simulate(replace(scenario, fusion={}, expect=()))
    return np.concatenate([block.truth.rate for block in blocks])


def with_step(scenario, step):
    return replace(scenario, turntable=scenario.turntable.model_copy(update={"step": step}))


def test_auto_takes_three_holds_at_10_hz_and_keeps_its_promise(tmp_path):
    scenario = short(tmp_path, AUTO)
    choice = choose_step(scenario)
    assert choice.holds == 3
    assert choice.step == pytest.approx(150e-6, rel=1e-15)
    assert 0.0 < choice.error < TRUTH_ERROR / 2
    base, long = truth_of(with_step(scenario, 5e-5)), truth_of(scenario)
    assert 0.0 < np.abs(base - long).max() < TRUTH_ERROR * np.abs(base).max()


@pytest.mark.parametrize(
    "motion",
    [
        "- chirp: {start_frequency: 1 Hz, stop_frequency: 150 Hz, rate: 1 deg/s}",
        "- random: {psd: 1e-4 (deg/s)^2/Hz, low: 1 Hz, high: 80 Hz}",
        "- sine: {frequency: 1 Hz, rate: 5 deg/s}\n  - sine: {frequency: 120 Hz, rate: 0.1 deg/s}",
    ],
    ids=["chirp", "random", "small and fast on large and slow"],
)
def test_auto_keeps_its_promise_over_the_whole_run(motion, tmp_path):
    """Also where the hard part is not in the first second."""
    scenario = short(tmp_path, AUTO, ("- sine: {frequency: 10 Hz, rate: 1 deg/s}", motion), ("0.5 s", "1.5 s"))
    base, long = truth_of(with_step(scenario, 5e-5)), truth_of(scenario)
    print(choose_step(scenario), f"run: {np.abs(base - long).max() / np.abs(base).max():.1e}")
    assert np.abs(base - long).max() < TRUTH_ERROR * np.abs(base).max()


def test_auto_keeps_the_base_step_where_no_longer_one_would_do(tmp_path):
    scenario = short(tmp_path, AUTO, ("10 Hz, rate: 1 deg/s", "400 Hz, rate: 0.5 deg/s"))
    assert choose_step(scenario) == choose_step(with_step(scenario, 5e-5))
    assert choose_step(scenario).holds == 1
    assert choose_step(scenario).error is None
    np.testing.assert_array_equal(truth_of(scenario), truth_of(with_step(scenario, 5e-5)))


def test_auto_on_a_fixed_table_changes_nothing(tmp_path):
    scenario = short(tmp_path, ("{preset: air_bearing}", "{mode: fixed, step: auto}"))
    assert choose_step(scenario).holds == 1


@pytest.mark.parametrize(("step", "holds", "substeps"), [("100 us", 2, 1), ("50 us", 1, 1), ("25 us", 1, 2)])
def test_given_step_is_taken(step, holds, substeps, tmp_path):
    scenario = short(tmp_path, ("{preset: air_bearing}", f"{{preset: air_bearing, step: {step}}}"))
    choice = choose_step(scenario)
    assert (choice.holds, choice.substeps) == (holds, substeps)
    assert (choice.error is None) == (holds == 1)
    assert np.array_equal(truth_of(scenario), truth_of(with_step(scenario, 5e-5))) == (step == "50 us")


@pytest.mark.parametrize(
    ("step", "message"),
    [
        ("70 us", "expected auto, or 50 us times or divided by a whole number, got 70 us"),
        ("400 us", "expected every mode below 397.9 Hz at a step of 0.0004 s"),
        ("autos", "expected a quantity in s"),
        ("0 s", "expected at least 1e-07 s"),
    ],
)
def test_step_that_cannot_be_is_refused_with_its_line(step, message, tmp_path):
    with pytest.raises(ScenarioError, match=message) as caught:
        short(tmp_path, ("{preset: air_bearing}", f"{{preset: air_bearing, step: {step}}}"))
    assert caught.value.problems[0].line == 6


def test_whole_chain_gives_the_same_bits_in_any_blocks(tmp_path):
    scenario = short(tmp_path, AUTO)
    whole, parts = testbed.run(scenario), testbed.run(scenario, block=0.0371)
    np.testing.assert_array_equal(whole.truth.rate, parts.truth.rate)
    np.testing.assert_array_equal(whole.fusion["kalman"].rate, parts.fusion["kalman"].rate)


def test_step_error_and_factor_are_printed_and_in_the_metrics(tmp_path, capsys):
    scenario = short(tmp_path, AUTO)
    print_scenario(scenario, table_facts(scenario))
    metrics = testbed.run(scenario).metrics
    print_metrics(metrics, tmp_path)
    assert capsys.readouterr().out.count("integration step 150 us, 3 times the hold, error 3.") == 2
    entry = metrics["turntable"]
    assert entry["step_s"] == pytest.approx(150e-6, rel=1e-15)
    assert entry["step_factor"] == 3.0
    assert entry["step_error"] == choose_step(scenario).error
    assert scenario.resolved()["turntable"]["step"] == "auto"


def test_look_ahead_beyond_the_end_of_a_record_keeps_the_promise(tmp_path):
    """The record ends with the run: what the last steps see of the time behind it is its spline, carried on."""
    t = np.linspace(0.0, 0.5, 251)
    rows = [f"{a!r},{b!r}" for a, b in zip(t.tolist(), np.sin(2 * np.pi * 7.0 * t).tolist(), strict=True)]
    (tmp_path / "record.csv").write_text("\n".join(["t,w", *rows]))
    record = (
        "recorded: {file: record.csv, time: {column: t, unit: s}, rate: {column: w, unit: deg/s}}",
        "sine: {frequency: 10 Hz, rate: 1 deg/s}",
    )
    scenario = short(tmp_path, AUTO, record[::-1])
    assert choose_step(scenario).holds > 1
    base, long = truth_of(with_step(scenario, 5e-5)), truth_of(scenario)
    assert np.abs(base - long).max() < TRUTH_ERROR * np.abs(base).max()
