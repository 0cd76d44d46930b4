"""`testbed compensate` from run folders and from text files: train on two cycles, apply and audit on a third."""

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import testbed
from testbed.cli import app, main
from testbed.compensate import read_model
from testbed.errors import ScenarioError
from testbed.thermal_records import Columns, read

FOG = Path(__file__).parents[1] / "scenarios" / "fog"
DEG_H = np.radians(1.0) / 3600.0


def ends_with(arguments, monkeypatch, capsys):
    """Run the installed command, return its exit status and what it printed."""
    monkeypatch.setattr("sys.argv", ["testbed", "compensate", *map(str, arguments)])
    with pytest.raises(SystemExit) as end:
        main()
    return end.value.code, "".join(capsys.readouterr())


@pytest.fixture(scope="module")
def cycles(tmp_path_factory):
    """Run both shipped programmes at 0.1 Hz: two cycles to train on, one to judge."""
    folder = tmp_path_factory.mktemp("cycles")
    for name, programme, seed in (("up", "", 11), ("down", "_down_first", 12), ("unseen", "", 13)):
        text = (FOG / f"thermal_cycle{programme}.yaml").read_text()
        text = text.replace("sample_rate: 1 Hz", "sample_rate: 0.1 Hz").replace(
            "bandwidth: 0.5 Hz", "bandwidth: 0.05 Hz"
        )
        (folder / f"{name}.yaml").write_text(text)
        testbed.run(testbed.load_scenario(folder / f"{name}.yaml"), seed=seed, out=folder / name)
    return folder


@pytest.fixture(scope="module")
def model(cycles):
    path = cycles / "model.json"
    result = CliRunner().invoke(
        app, ["compensate", "train", str(cycles / "up"), str(cycles / "down"), "--out", str(path)]
    )
    assert result.exit_code == 0, result.output
    assert "up, fog, 23.67 h at 0.1 Hz" in result.output
    return path


@pytest.fixture(scope="module")
def table(cycles):
    """Write the unseen cycle as a laboratory would have logged it."""
    run = testbed.open_run(cycles / "unseen")
    fog = run.sensors["fog"]
    columns = np.stack([fog.time / 3600.0, fog.rate / DEG_H, fog.temperature - 273.15], axis=1)
    path = cycles / "unseen.csv"
    np.savetxt(path, columns, delimiter=",", header="hours,rate,temperature", comments="", fmt="%.12g")
    return path


def test_a_run_is_read_with_its_true_drift(cycles):
    run, found = testbed.open_run(cycles / "unseen"), read(cycles / "unseen", Columns())
    np.testing.assert_array_equal(found.record.rate, run.sensors["fog"].rate)
    np.testing.assert_array_equal(found.record.temperature, run.sensors["fog"].temperature)
    np.testing.assert_array_equal(found.drift, run.truth["fog_drift"])
    assert found.record.sample_rate_hz == pytest.approx(0.1, rel=1e-12)


def test_a_text_file_gives_the_same_record_in_any_units(cycles, table):
    run = read(cycles / "unseen", Columns()).record
    by_time = read(table, Columns(time="hours", time_unit="h")).record
    by_rate = read(table, Columns(sample_rate="0.1 Hz", rate="2", temperature="3")).record
    for record in (by_time, by_rate):
        # Twelve digits were written; at 10 deg/h that is 1e-11 deg/h.
        np.testing.assert_allclose(record.rate, run.rate, atol=1e-10 * DEG_H)
        np.testing.assert_allclose(record.temperature, run.temperature, atol=1e-8)
        assert record.sample_rate_hz == pytest.approx(0.1, rel=1e-9)
    assert read(table, Columns(time="hours", time_unit="h")).drift is None


def test_applying_writes_what_the_model_says(cycles, model, tmp_path):
    out = tmp_path / "deep" / "compensated.csv"
    result = CliRunner().invoke(app, ["compensate", "apply", str(model), str(cycles / "unseen"), "--out", str(out)])
    assert result.exit_code == 0, result.output
    written = np.genfromtxt(out, delimiter=",", names=True)
    expected = read_model(model).apply(read(cycles / "unseen", Columns()).record)
    np.testing.assert_allclose(written["rate_deg_h"], expected.rate / DEG_H, rtol=1e-8)
    np.testing.assert_allclose(written["drift_deg_h"], expected.drift / DEG_H, rtol=1e-8)
    np.testing.assert_array_equal(written["extrapolated"], expected.extrapolated)
    np.testing.assert_allclose(written["time_s"], 10.0 * np.arange(8520))


def test_the_audit_of_a_frozen_model_passes_and_reduces_the_drift(cycles, model, tmp_path):
    """Median targets of one command: the drift is at least six times smaller after two cycles, every rate intact."""
    result = CliRunner().invoke(
        app, ["compensate", "audit", str(model), str(cycles / "unseen"), "--out", str(tmp_path)]
    )
    assert result.exit_code == 0, result.output
    assert "verdict: no leak found" in result.output
    found = json.loads((tmp_path / "audit.json").read_text())
    assert found["passed"]
    assert found["leaks"] == []
    assert found["drift_reduction"] > 5.0
    # The rate never enters the model: what survives is one to rounding.
    assert all(abs(line["gain"] - 1.0) < 1e-6 for line in found["gains"])
    assert found["step_gain"] == pytest.approx(1.0, abs=1e-6)
    assert (
        abs(found["after"]["coefficients"]["N"]["value"] / found["before"]["coefficients"]["N"]["value"] - 1.0) < 0.02
    )
    gains = np.genfromtxt(tmp_path / "gains.csv", delimiter=",", names=True)
    np.testing.assert_array_equal(gains["period_s"], [line["period_s"] for line in found["gains"]])
    names = {line.split(",")[0] for line in (tmp_path / "allan.csv").read_text().splitlines()[1:]}
    assert names == {"record", "compensated", "oracle"}
    page = (tmp_path / "audit.html").read_text()
    assert page.count("<svg") == 3
    assert "No leak was found" in page


def test_the_audit_of_a_text_file_needs_no_truth(table, model, tmp_path):
    arguments = [
        "compensate",
        "audit",
        str(model),
        str(table),
        "--time",
        "hours",
        "--time-unit",
        "h",
        "--out",
        str(tmp_path),
    ]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0, result.output
    found = json.loads((tmp_path / "audit.json").read_text())
    assert found["oracle"] is None
    assert found["drift_reduction"] is None
    assert found["oracle_ratio_1h"] is None
    assert "true drift" not in (tmp_path / "audit.html").read_text().split("<h2>Figures</h2>")[1]


def test_a_leak_ends_with_1_and_is_named(cycles, tmp_path, monkeypatch, capsys):
    """A compensation that trains on the record it corrects, here a plain smoother in the place of the paper's pipeline."""
    from testbed.audit.quality import low_pass

    class Result:
        def __init__(self, record):
            self.rate = record.rate - low_pass(record.rate, record.sample_rate_hz, 1.0 / 2000.0)

    monkeypatch.setattr("testbed.compensate.paper3.compensate", Result)
    status, text = ends_with(["audit", "paper3", cycles / "unseen", "--out", tmp_path], monkeypatch, capsys)
    assert status == 1
    assert "LEAK: of a true rate with a period of 21600 s only" in text
    assert "LEAK: the Allan deviation at 1 h is" in text
    assert "This result is a leak" in (tmp_path / "audit.html").read_text()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["train", "{unseen}", "--method", "gradeint"], "did you mean 'gradient'"),
        (["train", "{missing}"], "expected a text file or a run folder"),
        (["train", "{table}"], "expected either the sample rate"),
        (["train", "{table}", "--time", "hours", "--temperature-unit", "m"], "--temperature-unit"),
        (["train", "{table}", "--rate", "1", "--column", "speed"], "no column 'speed'"),
        (["train", "{unseen}", "--sensor", "gyro"], "gyro"),
        (["apply", "{table}", "{unseen}"], "expected a model that `testbed compensate train` wrote"),
        (["apply", "{missing}", "{unseen}"], "expected a model that `testbed compensate train` wrote"),
        (["audit", "{other}", "{unseen}"], "expected format 'testbed drift model'"),
        (["audit", "{model}", "{short}", "--rate", "0.1"], "so that a slow rate can be told from drift"),
    ],
)
def test_bad_input_ends_with_2_and_leaves_nothing(
    cycles, model, table, tmp_path, monkeypatch, capsys, arguments, message
):
    (tmp_path / "other.json").write_text('{"format": "something else"}')
    (tmp_path / "short.csv").write_text("\n".join(table.read_text().splitlines()[:100]))
    places = {
        "unseen": cycles / "unseen",
        "missing": tmp_path / "missing",
        "table": table,
        "model": model,
        "other": tmp_path / "other.json",
        "short": tmp_path / "short.csv",
    }
    out = tmp_path / "out"
    filled = [argument.format(**places) for argument in arguments]
    status, text = ends_with([*filled, "--out", out], monkeypatch, capsys)
    assert status == 2
    assert message in text
    assert not out.exists()


def test_a_run_without_a_thermometer_is_refused(tmp_path):
    scene = tmp_path / "still.yaml"
    scene.write_text("name: still\nduration: 1 s\nmotion: [static: {}]\nsensors: {mems_gyro: {preset: adis16505}}\n")
    testbed.run(testbed.load_scenario(scene), out=tmp_path / "run")
    with pytest.raises(ScenarioError, match="expected one sensor with a thermometer, got none"):
        read(tmp_path / "run", Columns())
