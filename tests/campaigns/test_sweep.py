"""A sweep: its rows are those of runs, it goes on where it was stopped, and nothing half-done is read."""

from __future__ import annotations

import json
import pickle
import subprocess
import sys

import numpy as np
import pyarrow.parquet as pq
import pytest
from distributed import KilledWorker
from typer.testing import CliRunner

import testbed
from testbed.campaigns.agenda import CHUNK, Agenda, play
from testbed.campaigns.engine import _finished, play_here
from testbed.campaigns.rows import FAILED, rows_of, schema_of
from testbed.campaigns.size import warm
from testbed.campaigns.store import CASES, CaseStore, read_cases
from testbed.campaigns.study import load_study
from testbed.campaigns.sweep import open_sweep, sweep
from testbed.cli.app import app
from testbed.errors import RunError, ScenarioError
from tests.campaigns.test_study import written

VARIED = "vary: {motion.0.sine.frequency: [5 Hz, 20 Hz]}\nseeds: 3\n"


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    folder = tmp_path_factory.mktemp("sweep")
    study = load_study(written(folder, VARIED))
    return study, sweep(study, out=folder / "out")


def test_every_row_is_that_of_a_run(done):
    study, folder = done
    table = open_sweep(folder)
    rows = {(row["case"], row["seed"], row["source"]): row for row in table.to_pylist()}
    assert len(rows) == table.num_rows == 2 * 3 * 4
    for case in study.cases:
        for seed in study.seeds:
            metrics = testbed.run(case.scenario, seed=seed).metrics
            for expected in rows_of(case, seed, metrics):
                row = rows[case.number, seed, expected["source"]]
                for name, value in expected.items():
                    if isinstance(value, float):
                        np.testing.assert_allclose(row[name], value, rtol=1e-9, err_msg=name)
                    elif name != "lines":
                        assert row[name] == value, name
    assert rows[1, 7, "kalman"]["motion.0.sine.frequency"] == 20.0
    assert {row["version"] for row in rows.values()} == {testbed.__version__}


def test_the_data_set_is_one_part_of_the_fixed_columns_that_others_read(done):
    study, folder = done
    (part,) = (folder / CASES).iterdir()
    assert pq.read_schema(part).remove_metadata() == schema_of(study)
    frame = pytest.importorskip("pandas").read_parquet(folder / CASES)
    assert len(frame) == 24
    assert frame.groupby("source").rmse_deg_s.mean().kalman > 0.0


def test_the_page_has_every_point_and_the_order_of_the_filters(done):
    study, folder = done
    page = (folder / "sweep.html").read_text("utf-8")
    assert page.count('data-kind="filter"') == 4
    assert page.count('data-kind="sensor"') == 4
    assert "http" not in page.replace("http://www.w3.org", "")
    assert f'<data id="n_done" value="6">6</data> of {len(study.cases) * len(study.seeds)} runs' in page


def test_a_second_launch_repeats_nothing(done, monkeypatch):
    study, folder = done
    before = read_cases(folder)
    monkeypatch.setattr("testbed.campaigns.engine.play", None)
    sweep(study, out=folder)
    assert read_cases(folder).equals(before)


def test_what_was_stopped_goes_on_and_ends_with_the_same_rows(done, tmp_path):
    study, folder = done
    calls = []

    def stop(told):
        calls.append(told.done)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        sweep(study, out=tmp_path / "out", progress=stop)
    assert calls == [3]
    assert len(set(read_cases(tmp_path / "out")["case"].to_pylist())) == 1
    sweep(study, out=tmp_path / "out")
    again = read_cases(tmp_path / "out")
    assert sorted(set(again["launch"].to_pylist())) == [1, 2]
    assert again.drop_columns("launch").equals(read_cases(folder).drop_columns("launch"))


def test_a_study_that_has_changed_is_refused_with_the_difference(done, tmp_path):
    _, folder = done
    for text, message in (
        ("vary: {motion.0.sine.frequency: [5 Hz, 21 Hz]}\nseeds: 3\n", r"case 1 was .*20 Hz.* and is .*21 Hz"),
        ("vary: {motion.0.sine.frequency: [5 Hz]}\nseeds: 3\n", "it had 2 cases and has 1"),
        ("vary: {motion.0.sine.frequency: [5 Hz, 20 Hz]}\nseeds: 4\n", "seeds was"),
    ):
        with pytest.raises(ScenarioError, match=message):
            sweep(load_study(written(tmp_path, text)), out=folder)
    study = load_study(written(tmp_path, VARIED))
    (tmp_path / "base.yaml").write_text((tmp_path / "base.yaml").read_text().replace("0.2 s", "0.3 s"))
    assert study is not None
    with pytest.raises(ScenarioError, match="its base has changed"):
        sweep(load_study(tmp_path / "study.yaml"), out=folder)
    assert read_cases(folder).num_rows == 24


def test_the_command_refuses_before_it_tries_out_what_it_takes(done, tmp_path, monkeypatch):
    _, folder = done
    monkeypatch.setattr("testbed.campaigns.size.size_of", None)
    path = written(tmp_path, "vary: {motion.0.sine.frequency: [5 Hz]}\nseeds: 3\n")
    refused = CliRunner().invoke(app, ["sweep", str(path), "--out", str(folder)])
    assert isinstance(refused.exception, ScenarioError)
    assert "it had 2 cases and has 1" in str(refused.exception)
    assert refused.stderr == ""


def test_where_a_precision_is_reached_early_the_last_word_is_that_all_is_done(tmp_path):
    study = load_study(written(tmp_path, "seeds: {until: {rmse: 90 %}, most: 30}\n"))
    told = []
    sweep(study, out=tmp_path / "out", progress=lambda one: told.append((one.done, one.runs)))
    assert told == [(CHUNK, 30), (CHUNK, CHUNK)]


def test_a_folder_of_something_else_or_in_use_is_refused(done, tmp_path):
    study, _ = done
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "notes.txt").write_text("mine")
    with pytest.raises(ScenarioError, match="is no sweep"):
        sweep(study, out=tmp_path / "mine")
    (tmp_path / "file").write_text("mine")
    with pytest.raises(ScenarioError, match="is no folder"):
        sweep(study, out=tmp_path / "file")
    with (
        CaseStore(tmp_path / "out", study.document(), schema_of(study)),
        pytest.raises(ScenarioError, match="in use by another sweep"),
    ):
        sweep(study, out=tmp_path / "out")


def test_a_case_that_fails_is_a_row_with_its_reason_and_stops_nothing(tmp_path, monkeypatch):
    study = load_study(written(tmp_path, VARIED))
    real = testbed.evaluate

    def fails(scenario, seeds):
        if scenario.lines == (5.0,) and 8 in seeds:
            msg = "the table diverged at 0.1 s"
            raise RunError(msg)
        return real(scenario, seeds)

    monkeypatch.setattr("testbed.campaigns.evaluate.evaluate", fails)
    rows = read_cases(sweep(study, out=tmp_path / "out")).to_pylist()
    (failed,) = [row for row in rows if row["status"] == FAILED]
    assert (failed["case"], failed["seed"], failed["reason"]) == (0, 8, "RunError: the table diverged at 0.1 s")
    assert {(row["case"], row["seed"]) for row in rows} == {(case, seed) for case in (0, 1) for seed in (7, 8, 9)}
    assert "the table diverged" in (tmp_path / "out" / "sweep.html").read_text("utf-8")


def squares_of(plan_rows):
    def fake(task):
        common = {"case": task.case.number, "kind": "filter", "source": "kalman", "status": "ok"}
        return [{**common, "seed": seed, "rmse_deg_s": plan_rows(task.case.number, seed)} for seed in task.seeds]

    return fake


def test_a_case_gets_chunks_until_its_error_is_known_and_the_order_of_others_changes_nothing(tmp_path):
    """Errors that scatter by 20 % need more seeds for 5 % than those that scatter by 1 %."""
    text = "vary: {motion.0.sine.frequency: [5 Hz, 20 Hz]}\nseeds: {until: {rmse: 5 %}, most: 200}\n"
    study = load_study(written(tmp_path, text))

    def error(case, seed):
        return 1.0 + (0.2 if case else 0.01) * np.random.default_rng([case, seed]).standard_normal()

    def seeds_of(reverse, done=(), squares=None):
        plan, fake, waiting, given = Agenda(study, done, squares), squares_of(error), [], {0: set(), 1: set()}
        while True:
            while (task := plan.next()) is not None:
                waiting.append(task)
            if not waiting:
                return given
            task = waiting.pop(0 if not reverse else -1)
            plan.finish(task, fake(task))
            given[task.case.number] |= set(task.seeds)

    first = seeds_of(reverse=False)
    assert len(first[0]) == CHUNK
    assert CHUNK < len(first[1]) < 200
    assert seeds_of(reverse=True) == first
    # And after a stop in the middle of a chunk.
    known = [(1, seed) for seed in study.seeds[: CHUNK + 3]]
    squares = {(1, seed): {"kalman": error(1, seed) ** 2} for _, seed in known}
    again = seeds_of(reverse=False, done=known, squares=squares)
    assert again[1] | {seed for _, seed in known} == first[1]


def test_a_case_that_has_failed_gets_no_further_chunk_after_a_stop_either(tmp_path):
    """Nor does one that has failed under its first seed, of which no error is known."""
    study = load_study(written(tmp_path, "seeds: {until: {rmse: 1 %}, most: 40}\n"))
    done = [(0, seed) for seed in study.seeds[:CHUNK]]
    squares = {(0, seed): {"kalman": 1.0 + seed} for _, seed in done[1:]}
    assert Agenda(study, done, squares).next() is not None
    assert Agenda(study, done, squares, [0]).next() is None


def test_the_bias_of_stopping_early_is_small(tmp_path):
    """The mean square over the seeds that a precision asks for, over many campaigns, against the truth: within 5 %."""
    text = "seeds: {until: {rmse: 10 %}, most: 200}\n"
    study = load_study(written(tmp_path, text))
    means = []
    for trial in range(300):
        rng = np.random.default_rng([9, trial])
        errors = dict(zip(study.seeds, np.sqrt(rng.chisquare(4.0, len(study.seeds)) / 4.0), strict=True))
        plan, fake = Agenda(study, ()), squares_of(lambda _, seed, errors=errors: errors[seed])
        used = []
        while (task := plan.next()) is not None:
            rows = fake(task)
            plan.finish(task, rows)
            used += [row["rmse_deg_s"] ** 2 for row in rows]
        means.append(np.mean(used))
    spread = 4.0 * np.std(means) / np.sqrt(len(means))
    assert abs(np.mean(means) - 1.0) < 0.05 + spread


def test_one_process_and_two_workers_give_the_same_rows(done, tmp_path):
    study, folder = done
    # In a process of its own: the cluster leaves what it started to the end of its process.
    command = [sys.executable, "-m", "testbed", "sweep", study.file, "--out", str(tmp_path / "out"), "--workers", "2"]
    assert subprocess.run([*command, "--quiet"], check=False).returncode == 0
    again = tmp_path / "out"
    assert read_cases(again).drop_columns("launch").equals(read_cases(folder).drop_columns("launch"))


class Finished(list):
    """What `distributed.as_completed` is of futures that are there at once."""

    add = list.append

    def __next__(self):
        return self.pop(0)


class Future:
    """A task that was played, or that killed its workers."""

    def __init__(self, task, *, dies):
        self._task, self._dies = task, dies

    def result(self):
        if self._dies:
            key = "play"
            raise KilledWorker(key, None, 3)
        return [{"case": self._task.case.number, "seed": seed, "status": "ok"} for seed in self._task.seeds]

    def release(self):
        pass


def test_a_case_that_kills_its_workers_fails_alone(tmp_path, monkeypatch):
    """The first one takes the second one with it, and does not when they are played alone; nothing else waits."""
    study = load_study(written(tmp_path, "vary: {motion.0.sine.frequency: [5 Hz, 20 Hz, 30 Hz]}\nseeds: 2\n"))
    submitted = []

    class Client:
        def submit(self, _play, packed, *, pure):
            assert not pure
            submitted.append(pickle.loads(packed))
            number = submitted[-1].case.number
            return Future(submitted[-1], dies=number == 0 or (number == 1 and len(submitted) <= 2))

    monkeypatch.setattr("distributed.as_completed", Finished)
    found = [row for _, rows in _finished(Client(), Agenda(study, ()), 3) for row in rows]
    assert sorted((row["case"], row["seed"], row["status"]) for row in found) == [
        *((0, seed, FAILED) for seed in (7, 8)),
        *((case, seed, "ok") for case in (1, 2) for seed in (7, 8)),
    ]
    assert {row["reason"] for row in found if row["status"] == FAILED} == {
        "4 workers died of it: out of memory, or a crash of compiled code"
    }
    assert [task.case.number for task in submitted[:3]] == [0, 1, 2]
    assert sorted(task.case.number for task in submitted[3:]) == [0, 1]


def test_a_scheduler_that_is_not_there_is_an_error_of_the_run(done, tmp_path, monkeypatch):
    study, _ = done
    monkeypatch.setattr("testbed.campaigns.engine._PATIENCE", 1.0)
    with pytest.raises(RunError, match="cannot be reached"):
        sweep(study, out=tmp_path / "out", scheduler="tcp://127.0.0.1:1")


def test_error_against_the_delay_of_a_sensor(tmp_path):
    """A line of f comes late by 360 f T degrees; the estimate that believes otherwise is the worse for it."""
    axes = "{sensors.mhd_ars.delay: {linear: [0 ms, 1 ms], points: 3}, motion.0.sine.frequency: [20 Hz]}"
    path = written(tmp_path, f"vary: {axes}\nseeds: 1\n")
    folder = sweep(load_study(path), out=tmp_path / "out")
    rows = {(row["source"], row["sensors.mhd_ars.delay"]): row for row in open_sweep(folder).to_pylist()}
    phases = [rows["mhd_ars", delay]["lines"][0]["phase_deg"] for delay in (0.0, 5e-4, 1e-3)]
    # The ramp-in is still on: its share of a radian within the delay, and the noise of the sensor.
    np.testing.assert_allclose(np.diff(phases), -360.0 * 20.0 * 5e-4, rtol=0, atol=0.2)
    errors = [rows["kalman", delay]["rmse_deg_s"] for delay in (0.0, 5e-4, 1e-3)]
    assert errors == sorted(errors)
    assert errors[2] > 2.0 * errors[0]
    page = (folder / "sweep.html").read_text("utf-8")
    assert 'aria-label="Errors over the first axis"' in page
    for case in range(3):
        assert f"testbed sweep {path} --only {case}:7" in page


def test_the_line_of_sight_over_the_latency_of_its_mirror(tmp_path):
    """Any key of `pointing` is an axis: what a line leaves grows with the latency, and the rows are those of a run."""
    axes = "{pointing.mirror.latency: [0 ms, 0.5 ms, 1 ms], pointing.tracker.bandwidth: [10 Hz]}"
    path = written(tmp_path, f"vary: {axes}\nseeds: 1\n")
    with (tmp_path / "base.yaml").open("a") as base:
        base.write("pointing: {windows: [10 ms], mirror: {bandwidth: 1 kHz}}\n")
    study = load_study(path)
    folder = sweep(study, out=tmp_path / "out")
    rows = [row for row in open_sweep(folder).to_pylist() if row["source"] == "kalman"]
    assert [row["pointing.mirror.latency"] for row in rows] == [0.0, 5e-4, 1e-3]
    assert {row["pointing.tracker.bandwidth"] for row in rows} == {10.0}
    left = [row["residual_rms_urad"] for row in rows]
    assert left == sorted(left)
    found = testbed.run(study.cases[2].scenario, seed=7).metrics.pointing["kalman"]
    for name in ("rpe_urad", "mpe_urad"):
        np.testing.assert_allclose(rows[2][f"{name}.0.01"], found[name]["0.01"], rtol=1e-9)
    assert all(row["residual_rms_urad"] is None for row in open_sweep(folder).to_pylist() if row["kind"] == "sensor")
    page = (folder / "sweep.html").read_text("utf-8")
    assert 'aria-label="Line of sight over the first axis"' in page
    assert page.count("RPE over 10 ms") == 1


def test_what_a_task_gives_can_be_sent(tmp_path):
    study = load_study(written(tmp_path, "seeds: 1\n"))
    task = Agenda(study, ()).next()
    assert task is not None
    rows = play(task)
    assert {row["kind"] for row in json.loads(json.dumps(rows))} == {"sensor", "filter"}
    taken = []
    play_here(Agenda(study, ()), lambda _, found: taken.extend(found))
    assert taken == rows


def test_a_sensors_clock_sweeps(tmp_path):
    """Each case has a clock of its own, the first one none; its rows are those of a run."""
    axis = "vary: {sensors.mems_gyro.clock.error: [0 ppm, 500 ppm]}\nseeds: 1\n"
    study = load_study(written(tmp_path, axis))
    rows = {(row["case"], row["source"]): row for row in open_sweep(sweep(study, out=tmp_path / "out")).to_pylist()}
    assert [rows[case.number, "kalman"]["sensors.mems_gyro.clock.error"] for case in study.cases] == [0.0, 5e-4]
    for case in study.cases:
        metrics = testbed.run(case.scenario, seed=study.seeds[0]).metrics
        assert rows[case.number, "kalman"]["rmse_deg_s"] == pytest.approx(metrics.fusion["kalman"].rmse_deg_s, rel=1e-9)
    assert rows[0, "kalman"]["rmse_deg_s"] != rows[1, "kalman"]["rmse_deg_s"]


def test_workers_of_this_machine_find_the_cache_warm_and_those_elsewhere_are_left_alone(done, tmp_path, monkeypatch):
    study, _ = done
    warmed = []

    def no_client(*_):
        msg = "enough"
        raise RunError(msg)

    monkeypatch.setattr("testbed.campaigns.size.warm", warmed.append)
    monkeypatch.setattr("testbed.campaigns.engine._client", no_client)
    for words, expected in (({"workers": 2}, [study]), ({"scheduler": "tcp://127.0.0.1:1"}, [study])):
        with pytest.raises(RunError, match="enough"):
            sweep(study, out=tmp_path / "out", **words)
        assert warmed == expected


def test_a_case_that_fails_at_its_beginning_does_not_stop_the_warming(done, monkeypatch):
    def fails(*_):
        msg = "no"
        raise RunError(msg)

    monkeypatch.setattr("testbed.campaigns.size.Lockstep", fails)
    warm(done[0])
