"""The line of sight of a finished run, and the command that prints it."""

from __future__ import annotations

import json

import pytest
from numpy.testing import assert_allclose
from ruamel.yaml import YAML
from typer.testing import CliRunner

import testbed
from testbed.campaigns.study import load_study
from testbed.campaigns.sweep import open_sweep, sweep
from testbed.cli.app import app
from tests.chain.test_pointing import aimed
from tests.recording.test_writer import read

OTHER = "tracker: {bandwidth: 5 Hz}\nmirror: {bandwidth: 1 kHz, latency: 0 s}\nwindows: [10 ms]\n"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    out = tmp_path_factory.mktemp("aim") / "run"
    testbed.run(aimed(duration="1 s", settle="0.5 s"), out=out)
    return out


def test_a_finished_run_has_the_line_of_sight_that_it_had(folder):
    """The same stage over the stored signals: rates are stored in double precision."""
    own = testbed.open_run(folder).metrics.pointing["kalman"].to_dict()
    found = testbed.line_of_sight(folder)["kalman"].to_dict()
    for key in ("residual_rms_urad", "knowledge_rms_urad", "tracker_only_rms_urad", "delay_us", "peak_urad"):
        assert_allclose(found[key], own[key], rtol=1e-9)
    assert_allclose(list(found["budget"]["shares"].values()), list(own["budget"]["shares"].values()), atol=1e-9)
    assert found["budget"]["knowledge"].keys() == own["budget"]["knowledge"].keys()


def test_another_pointing_is_played_on_the_same_run(folder, tmp_path):
    file = tmp_path / "aim.yaml"
    file.write_text(OTHER)
    found = CliRunner().invoke(app, ["pointing", str(folder), "--pointing", str(file), "--json"])
    assert found.exit_code == 0, found.output
    sight = json.loads(found.stdout)["pointing"]["kalman"]
    own = testbed.open_run(folder).metrics.pointing["kalman"]
    assert sight["residual_rms_urad"] < own.residual_rms_urad
    assert set(sight["rpe_urad"]) == {"0.01"}
    table = CliRunner().invoke(app, ["pointing", str(folder)])
    assert table.exit_code == 0
    assert "latency dominates" in table.stdout


def test_a_replayed_record_has_the_line_of_sight_of_its_run(tmp_path):
    """With the same readings, truth, filter and start."""
    filters, run = {"kalman": {"belief": "eq39"}}, tmp_path / "run"
    testbed.run(aimed(duration="1 s", settle="0.5 s", fusion=filters), out=run, outputs=["netcdf"])
    log = testbed.export(run, "parquet", tmp_path / "log") / "log.yaml"
    testbed.replay(log, filters, start="rest", settle=0.5, out=tmp_path / "again", outputs=["netcdf"])
    other = {"tracker": {"bandwidth": "5 Hz"}, "windows": ["10 ms"]}
    own, found = (testbed.line_of_sight(place, other)["kalman"] for place in (run, tmp_path / "again"))
    assert_allclose(found.residual_rms_urad, own.residual_rms_urad, rtol=1e-6)
    assert_allclose(found.rpe_urad["0.01"], own.rpe_urad["0.01"], rtol=1e-6)
    told = CliRunner().invoke(app, ["pointing", str(tmp_path / "again"), "--pointing", _file(tmp_path), "--json"])
    assert told.exit_code == 0, told.output
    assert json.loads(told.stdout)["pointing"]["kalman"]["residual_rms_urad"] > 0.0


def _file(folder):
    path = folder / "aim.yaml"
    path.write_text(OTHER)
    return str(path)


@pytest.mark.parametrize(
    ("text", "key"),
    [
        ("mirror: {bandwidht: 1 kHz}\n", "mirror.bandwidht"),
        ("pointing:\n  feed_forward: [wideband]\n", "pointing.feed_forward.0"),
        ("windows: [2 s]\n", "windows.0"),
    ],
)
def test_what_does_not_fit_the_run_is_refused_at_its_place(folder, tmp_path, text, key):
    file = tmp_path / "aim.yaml"
    file.write_text(text)
    with pytest.raises(testbed.ScenarioError) as caught:
        testbed.line_of_sight(folder, file)
    (problem,) = caught.value.problems
    assert problem.key.endswith(key)
    assert problem.file == str(file)


def test_a_run_without_pointing_asks_for_one(tmp_path):
    out = tmp_path / "run"
    testbed.run(aimed(duration="0.2 s", settle="0.1 s", pointing=None), out=out)
    with pytest.raises(testbed.ScenarioError, match="--pointing"):
        testbed.line_of_sight(out)
    assert testbed.line_of_sight(out, {"mirror": {"bandwidth": "2 kHz"}})["kalman"].residual_rms_urad > 0.0


def test_the_report_has_the_design_page(folder):
    """Requirement, budget and curves: the number of the table is that of metrics.json."""
    page = (folder / "report.html").read_text()
    own = testbed.open_run(folder).metrics.pointing["kalman"]
    assert '<table id="sights">' in page
    assert f'value="{own.residual_rms_urad}"' in page
    assert "latency dominates" in page
    assert {"sight_budget", "sight_curves"} <= set(testbed.open_run(folder).plot())


def test_the_recording_has_residual_and_beam_spot(folder):
    """The spot is the residual in urad, every 400th base sample."""
    found = read(folder / "recording.rrd")
    entities = {entity for entity, _ in found}
    assert {"/pointing/kalman/residual", "/pointing/target/kalman"} <= entities
    _, spots = found["/pointing/target/kalman", "Points2D:positions"]
    residual = testbed.open_run(folder).pointing["kalman"].residual[::400]
    assert_allclose(spots.reshape(-1, 2)[:, 0], 1e6 * residual, rtol=1e-6, atol=1e-9)


def test_a_sweep_has_the_line_of_sight_in_its_columns(tmp_path):
    """An axis in the mirror; null for a sensor; every number that of a run."""
    keys = aimed(duration="0.5 s", settle="0.3 s", **{"pointing.windows": ["10 ms"]}).resolved()
    yaml = YAML(typ="safe", pure=True)
    yaml.dump({**keys, "expect": None}, tmp_path / "base.yaml")
    study = {"name": "late", "base": "base.yaml", "vary": {"pointing.mirror.latency": ["0 us", "500 us"]}, "seeds": 1}
    yaml.dump(study, tmp_path / "study.yaml")
    rows = open_sweep(sweep(load_study(tmp_path / "study.yaml"), out=tmp_path / "out")).to_pylist()
    found = {row["pointing.mirror.latency"]: row for row in rows if row["source"] == "kalman"}
    assert found[0.0]["residual_rms_urad"] < found[500e-6]["residual_rms_urad"]
    assert 0.0 < found[500e-6]["rpe_urad.0.01"] < found[500e-6]["residual_rms_urad"]
    assert all(row["residual_rms_urad"] is None for row in rows if row["kind"] == "sensor")
    scenario = testbed.load_scenario(tmp_path / "base.yaml").with_(**{"pointing.mirror.latency": "500 us"})
    run = testbed.run(scenario, seed=found[500e-6]["seed"]).metrics.pointing["kalman"]
    assert_allclose(found[500e-6]["residual_rms_urad"], run.residual_rms_urad, rtol=1e-9)
