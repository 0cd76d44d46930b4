"""The comparison with a baseline, the history and the leaderboard, on rows that are made up."""

from __future__ import annotations

import json
import re

import numpy as np
import pyarrow.parquet as pq
import pytest
from typer.testing import CliRunner

import testbed
from testbed.campaigns.agenda import play
from testbed.campaigns.regression import standard
from testbed.campaigns.regression.compare import LIMIT_DEG, in_words, incomparable, moves
from testbed.campaigns.regression.history import NUMBERS, append, latest, read_history
from testbed.campaigns.regression.leaderboard import standings
from testbed.campaigns.regression.regress import run_regression
from testbed.campaigns.regression.standard import AXES, SHORT, STANDARD, Contenders, Setting, published, standard_study
from testbed.campaigns.renewal import code_sha256
from testbed.campaigns.statistics import holm
from testbed.campaigns.study import load_study
from testbed.campaigns.sweep import sweep
from testbed.cli.app import app
from testbed.errors import ScenarioError
from testbed.fusion import FILTERS
from tests.campaigns.test_size import SAID
from tests.campaigns.test_study import written
from tests.examples.programs import EXAMPLES

SEEDS = range(10)


def made(source="kalman", error=0.01, scatter=0.3, case=("mixed", "rest"), *, seed=0, **changes):
    """Return rows of a filter whose error scatters from seed to seed, the same for the same `seed`."""
    rng = np.random.default_rng([seed, *source.encode()])
    usual = dict(zip(AXES, (*case, "none", "exact", "sx300, adis16505_filtered"), strict=True))
    rows = []
    for k in SEEDS:
        value = error * np.exp(scatter * rng.standard_normal())
        row = {"kind": "filter", "source": source, "seed": k, "rmse_deg_s": value, "mean_std_deg_s": error, "nees": 1.0}
        row |= {"optimum_rmse_deg_s": 0.002, "floor_rmse_deg_s": 0.001, "gain": 1.0, "phase_deg": 179.9, **usual}
        rows.append(row | {key: change(row[key]) if callable(change) else change for key, change in changes.items()})
    return rows


def test_what_has_not_changed_has_not_moved():
    assert moves(made(), made()) == []
    # What another processor rounds differently: 1e-5 of a decibel, all one way.
    assert moves(made(rmse_deg_s=lambda x: x * (1.0 + 1e-6)), made()) == []


@pytest.mark.parametrize("factor", [1.07, 0.93])
def test_more_than_half_a_decibel_fails_either_way(factor):
    rng = np.random.default_rng(1)
    # So much scatter of the change itself that it is no certainty.
    (one,) = moves(made(rmse_deg_s=lambda x: x * factor * np.exp(0.001 * rng.standard_normal())), made())
    assert one.quantity == "error"
    assert one.change == pytest.approx(20.0 * np.log10(factor), abs=0.05)
    assert one.lower < one.change < one.upper


def test_less_than_half_a_decibel_fails_where_it_is_no_chance():
    rng = np.random.default_rng(2)
    (one,) = moves(made(rmse_deg_s=lambda x: x * 1.02 * np.exp(0.001 * rng.standard_normal())), made())
    assert one.p_value < 0.01
    assert moves(made(rmse_deg_s=lambda x: x * 1.01 * np.exp(0.04 * rng.standard_normal())), made()) == []


def test_chance_is_corrected_for_all_that_is_compared():
    """Changes that are pure chance, 200 comparisons at a time: 1 % of the campaigns may fail, so of 30 hardly two."""
    failed = 0
    for trial in range(30):
        rng = np.random.default_rng([3, trial])
        before = [row for k in range(200) for row in made(f"filter_{k}")]
        now = [{**row, "rmse_deg_s": row["rmse_deg_s"] * np.exp(0.01 * rng.standard_normal())} for row in before]
        failed += bool(moves(now, before))
    # Binomial of 30 and 0.01: three or more once in 3000.
    assert failed <= 2


@pytest.mark.parametrize(("quantity", "change"), [("gain", 1.06), ("gain", 0.94), ("phase", LIMIT_DEG + 0.1)])
def test_gain_and_phase_are_held_too_across_the_half_turn(quantity, change):
    key = "gain" if quantity == "gain" else "phase_deg"
    turned = (lambda x: x * change) if quantity == "gain" else (lambda x: x + change - 360.0)
    (one,) = moves(made(**{key: turned}), made())
    assert one.quantity == quantity


def test_what_is_undefined_in_one_of_the_two_is_said():
    (one,) = moves(made(rmse_deg_s=None), made())
    assert one.words() == "kalman, mixed: its error is defined in one of the two only"
    assert moves(made(rmse_deg_s=None), made(rmse_deg_s=None)) == []


def test_what_is_new_or_gone_is_named_and_does_not_fail():
    before, now = [*made(), *made("old")], [*made(), *made("mine"), *made(case=("10 Hz", "in motion"))]
    assert moves(now, before) == []
    assert incomparable(now, before) == [
        "mine has no baseline yet",
        "kalman, 10 Hz, in motion: has no baseline yet",
        "old is gone",
    ]
    assert incomparable(now, []) == ["everything has no baseline yet"]


def test_what_is_left_of_a_line_of_sight_is_held_too():
    """Beyond 0.5 dB; a baseline without one is named, a line of sight that is gone has moved."""
    aimed = {"residual_rms_urad": 0.5, "rpe_urad.0.1": 0.3}
    assert moves(made(**aimed), made(**aimed)) == []
    (one,) = moves(made(**{**aimed, "residual_rms_urad": 0.54}), made(**aimed))
    assert (one.quantity, one.change) == ("residual", pytest.approx(20.0 * np.log10(1.08)))
    (one,) = moves(made(**{**aimed, "rpe_urad.0.1": 0.27}), made(**aimed))
    assert one.quantity == "RPE"
    assert moves(made(**aimed), made()) == []
    assert incomparable(made(**aimed), made()) == ["line of sight, mixed: has no baseline yet"]
    (one,) = moves(made(), made(**aimed))
    assert one.quantity == "definition"


def test_holm_is_the_step_down_of_its_paper():
    """Worked by hand: 0.01 x 4, max(0.04, 0.02 x 3), max(0.06, 0.03 x 2), 0.5 x 1."""
    assert holm([0.03, 0.01, 0.5, 0.02]) == pytest.approx([0.06, 0.04, 0.5, 0.06])


def test_the_history_keeps_every_entry_with_its_reason(tmp_path):
    path = tmp_path / "history.parquet"
    append(made(), {"kalman": 1.0}, SHORT, "First.", path)
    append(made(error=0.02), {}, STANDARD, "The other one.", path)
    append(made(error=0.03), {"kalman": 2.0}, SHORT, "Another R.", path)
    rows = read_history(path)
    assert [row["reason"] for row in latest(rows, SHORT)] == ["Another R."] * len(SEEDS)
    assert {row["entry"] for row in rows} == {1, 2, 3}
    assert {row["version"] for row in rows} == {testbed.__version__}
    assert moves(made(error=0.03), latest(rows, SHORT)) == []
    assert set(NUMBERS) < set(pq.read_table(path).column_names)
    with pytest.raises(ScenarioError, match="expected a reason"):
        append(made(), {}, SHORT, "  ", path)


def test_filters_stand_in_the_order_of_their_errors_over_the_least():
    rows = [*made("good", 0.004, 0.0), *made("bad", 0.008, 0.0, nees=5.0), *made("bad", 0.032, 0.0, ("4 Hz", "rest"))]
    rows += made("good", 0.002, 0.0, ("4 Hz", "rest"), optimum_rmse_deg_s=None)
    good, bad = standings(rows, {"good": 2.0})
    # By hand: sqrt(2 x 2) with the floor where there is no optimum, and sqrt(4 x 16).
    assert (good.name, good.over_optimum, good.honest, good.cost) == ("good", pytest.approx(2.0), 1.0, 2.0)
    assert (bad.over_optimum, bad.worst) == (pytest.approx(8.0), pytest.approx(16.0))
    assert (bad.honest, bad.worst_case) == (0.5, "4 Hz")
    assert bad.error_over_claim == pytest.approx(1.0)
    assert [one.name for one in standings([*rows, *made("lazy", 0.001, 0.0)], {})] == ["good", "bad", "lazy"]
    assert np.isnan(good.residual)
    aimed = [*made("good", residual_rms_urad=2.0), *made("good", case=("4 Hz", "rest"), residual_rms_urad=8.0)]
    (found,) = standings(aimed, {})
    assert found.residual == pytest.approx(4.0)


def test_the_standard_campaign_has_what_it_says():
    settings = standard._settings()
    assert len(settings) == len({tuple(one.values.values()) for one in settings})
    assert {f"{freq} Hz" for freq in (0.1, 500)} <= {one.signal for one in settings}
    assert len({one.fault for one in settings}) == 7
    assert in_words(Setting().values.values()) == "mixed"
    assert standard._SEEDS[STANDARD] == 10
    assert set(standard.shipped().fusion) <= set(FILTERS)


@pytest.fixture
def tiny(monkeypatch):
    """One case of two seeds."""
    monkeypatch.setattr(standard, "_short_settings", lambda: [Setting("100 Hz")])
    monkeypatch.setitem(standard._SEEDS, SHORT, 2)
    monkeypatch.setattr(
        "testbed.campaigns.regression.regress.shipped", lambda: Contenders({"kalman": {}, "complementary": {}})
    )


def test_a_published_filter_enters_by_one_file_and_one_command(tiny, tmp_path):
    history = tmp_path / "history.parquet"
    first = run_regression(short=True, out=tmp_path / "all", update="First.", history=history)
    assert first.incomparable == ["everything has no baseline yet"]
    again = run_regression(short=True, out=tmp_path / "all", history=history)
    assert (list(again.moves), again.incomparable) == ([], [])
    entry = published(["own_filter:Blend"], [str(EXAMPLES / "own_filter.py")])
    mine = run_regression(entry, short=True, out=tmp_path / "mine", history=history)
    assert {one.name for one in mine.standings} == {"kalman", "complementary", "Blend"}
    assert list(mine.moves) == []
    assert mine.incomparable == ["Blend has no baseline yet"]
    assert all(one.cost is not None for one in mine.standings)
    assert all(one.residual > 0.0 for one in mine.standings)
    page = (mine.folder / "leaderboard.html").read_text("utf-8")
    assert "--filter=own_filter:Blend" in page
    assert 'data-name="Blend"' in page
    assert "First." in page
    with pytest.raises(ScenarioError, match="the baseline is that of the filters that ship"):
        run_regression(entry, short=True, update="Mine.", out=tmp_path / "mine", history=history)


def test_a_campaign_goes_on_with_the_code_that_began_it_and_is_played_anew_by_any_other(tiny, tmp_path, monkeypatch):
    played = []

    def recorded(task):
        played.append(task.case.number)
        return play(task)

    def stop(_told):
        raise KeyboardInterrupt

    monkeypatch.setattr("testbed.campaigns.engine.play", recorded)
    monkeypatch.setattr(standard, "_short_settings", lambda: [Setting("100 Hz"), Setting("still")])
    options = {"short": True, "out": tmp_path / "out", "history": tmp_path / "h.parquet"}
    with pytest.raises(KeyboardInterrupt):
        run_regression(**options, progress=stop)
    run_regression(**options)
    assert played == [0, 1]
    # Looked at, and then stored: nothing is repeated.
    run_regression(**options, update="First.")
    assert played == [0, 1]
    monkeypatch.setattr("testbed.campaigns.regression.regress.code_sha256", lambda _plugins: "another")
    assert list(run_regression(**options).moves) == []
    assert played == [0, 1, 0, 1]
    (tmp_path / "out" / "notes.txt").write_text("mine")
    monkeypatch.setattr("testbed.campaigns.regression.regress.code_sha256", lambda _plugins: "a third")
    with pytest.raises(ScenarioError, match=r"notes\.txt: move that away"):
        run_regression(**options)


def test_an_update_without_a_reason_is_refused_before_anything_is_played(tmp_path, monkeypatch):
    monkeypatch.setattr("testbed.campaigns.regression.regress.sweep", None)
    with pytest.raises(ScenarioError, match="expected a reason"):
        run_regression(update=" ", out=tmp_path / "out")


def test_the_code_of_a_campaign_is_the_package_and_the_plugin(tmp_path):
    plugin = tmp_path / "mine.py"
    plugin.write_text("a = 1")
    first = code_sha256([str(plugin)])
    assert first == code_sha256([str(plugin)])
    plugin.write_text("a = 2")
    assert first != code_sha256([str(plugin)]) != code_sha256([])


def test_a_sweep_of_somebody_is_refused_and_stays(tiny, tmp_path):
    """It came to its end and has as many rows."""
    folder = sweep(load_study(written(tmp_path, "seeds: 9\n")), out=tmp_path / "mine")
    before = testbed.open_sweep(folder)
    with pytest.raises(ScenarioError, match="holds another study: name was"):
        run_regression(short=True, out=folder, history=tmp_path / "h.parquet")
    assert testbed.open_sweep(folder).equals(before)


def test_the_command_says_what_it_takes_and_what_moved_by_its_status(tiny, tmp_path, monkeypatch):
    history = tmp_path / "history.parquet"
    monkeypatch.setattr(
        "testbed.campaigns.regression.regress.run_regression",
        lambda entry, **options: run_regression(entry, **options, history=history),
    )
    command = ["regress", "--short", "--json", "--quiet", "--out", str(tmp_path / "out")]
    first = CliRunner().invoke(app, [*(word for word in command if word != "--quiet"), "--update", "First."])
    assert first.exit_code == 0
    said = re.search(SAID, first.stderr)
    assert said is not None
    assert said.groups() == ("1", "2")
    assert said.end() < first.stderr.index("2 of 2 runs")
    done = CliRunner().invoke(app, command)
    assert done.stderr == ""
    assert done.exit_code == 0
    document = json.loads(done.stdout)
    assert {one["name"] for one in document["standings"]} == {"kalman", "complementary"}
    # How long it took, which needs no word of what workers spent.
    assert 0.0 < document["seconds"] < 600.0
    rows = [{**row, "rmse_deg_s": 2.0 * row["rmse_deg_s"]} for row in read_history(history)]
    history.unlink()
    append(rows, {}, SHORT, "A planted drift.", history)
    moved = CliRunner().invoke(app, command)
    assert moved.exit_code == 1
    assert {one["quantity"] for one in json.loads(moved.stdout)["moves"]} == {"error"}


def test_one_point_has_a_command(tmp_path):
    study = standard_study(Contenders({"kalman": {}}), short=True)
    assert study.command == "testbed regress --short"
    assert published(["m:A"], ["m.py"]).words == ["--plugin=m.py", "--filter=m:A"]


@pytest.mark.parametrize("word", ["x", "9:1", "0", "0:-1", f"0:{2**63}", "0:1:2"])
def test_a_word_that_is_no_case_is_refused_before_any_is_built(monkeypatch, word):
    monkeypatch.setattr(standard, "_scenario", None)
    refused = CliRunner().invoke(app, ["regress", "--short", "--only", word])
    assert isinstance(refused.exception, ScenarioError)
    assert "expected CASE:SEED, the case from 0 to 8, such as 8:1" in str(refused.exception)


def test_one_case_is_built_alone_and_is_that_of_the_whole(tiny):
    (one,) = standard_study(Contenders({"kalman": {}}), short=True, only=0).cases
    (whole,) = standard_study(Contenders({"kalman": {}}), short=True).cases
    assert one.sha256 == whole.sha256
