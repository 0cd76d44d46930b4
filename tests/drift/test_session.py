"""`testbed compensate` from run folders and from text files: train on two cycles, apply and audit on a third."""

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import testbed
from testbed.cli import main
from testbed.cli.app import app
from testbed.drift.records import Columns, read_thermal
from testbed.drift.session import read_model
from testbed.errors import ScenarioError
from tests.cli.commands import documented

FOG = Path(__file__).parents[2] / "scenarios" / "fog"
DEG_H = np.radians(1.0) / 3600.0


def ends_with(arguments, monkeypatch, capsys):
    """Run the installed command, return its exit status and what it printed."""
    monkeypatch.setattr("sys.argv", ["testbed", "compensate", *map(str, arguments)])
    monkeypatch.setattr("signal.signal", lambda *_: None)
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
    run, found = testbed.open_run(cycles / "unseen"), read_thermal(cycles / "unseen", Columns())
    np.testing.assert_array_equal(found.record.rate, run.sensors["fog"].rate)
    np.testing.assert_array_equal(found.record.temperature, run.sensors["fog"].temperature)
    np.testing.assert_array_equal(found.drift, run.truth["fog_drift"])
    assert found.record.sample_rate_hz == pytest.approx(0.1, rel=1e-12)


def test_the_true_drift_of_a_fast_base_is_that_of_the_readings(tmp_path):
    """A truth of 20 kHz, readings at 400 Hz: the drift at the instant of each reading, by interpolation over time."""
    scene = tmp_path / "table.yaml"
    scene.write_text(
        "name: table\nduration: 1 s\nturntable: {mode: ideal}\n"
        "temperature: {start: 20 degC, stop: 80 degC, over: 1 s}\nmotion: [static: {}]\n"
        "sensors: {fog: {preset: fog_paper3}}\n"
    )
    run = testbed.run(testbed.load_scenario(scene), out=tmp_path / "run")
    found = read_thermal(tmp_path / "run", Columns())
    expected = np.interp(run.sensors["fog"].time, run.truth.time, run.truth.fog_drift)
    assert found.record.sample_rate_hz == pytest.approx(400.0, rel=1e-9)
    assert found.drift.size == found.record.rate.size == 400
    np.testing.assert_allclose(found.drift, expected, rtol=1e-9, atol=1e-20)


def test_a_text_file_gives_the_same_record_in_any_units(cycles, table):
    run = read_thermal(cycles / "unseen", Columns()).record
    by_time = read_thermal(table, Columns(time="hours", time_unit="h")).record
    by_rate = read_thermal(table, Columns(sample_rate="0.1 Hz", rate="2", temperature="3")).record
    for record in (by_time, by_rate):
        # Twelve digits were written; at 10 deg/h that is 1e-11 deg/h.
        np.testing.assert_allclose(record.rate, run.rate, atol=1e-10 * DEG_H)
        np.testing.assert_allclose(record.temperature, run.temperature, atol=1e-8)
        assert record.sample_rate_hz == pytest.approx(0.1, rel=1e-9)
    assert read_thermal(table, Columns(time="hours", time_unit="h")).drift is None


def test_applying_writes_what_the_model_says(cycles, model, tmp_path):
    out = tmp_path / "deep" / "compensated.csv"
    result = CliRunner().invoke(app, ["compensate", "apply", str(model), str(cycles / "unseen"), "--out", str(out)])
    assert result.exit_code == 0, result.output
    written = np.genfromtxt(out, delimiter=",", names=True)
    expected = read_model(model).apply(read_thermal(cycles / "unseen", Columns()).record)
    np.testing.assert_allclose(written["rate_deg_h"], expected.rate / DEG_H, rtol=1e-8)
    np.testing.assert_allclose(written["drift_deg_h"], expected.drift / DEG_H, rtol=1e-8)
    np.testing.assert_array_equal(written["extrapolated"], expected.extrapolated)
    np.testing.assert_allclose(written["time_s"], 10.0 * np.arange(8520))


def test_each_command_says_its_result_to_a_program(cycles, model, tmp_path):
    def document(*words):
        result = CliRunner().invoke(app, ["compensate", *map(str, words), "--json"])
        assert result.exit_code == 0, result.output
        return json.loads(result.stdout)

    out = tmp_path / "model.json"
    found = document("train", cycles / "up", cycles / "down", "--out", out)
    assert found.keys() == documented()["testbed compensate train"]
    assert found["cycles"] == ["up, fog", "down, fog"]
    assert found["blocked_error_deg_h"] == pytest.approx(read_model(out).blocked_error / DEG_H)
    assert found["written"] == str(out)
    assert out.read_text() == model.read_text()
    found = document("apply", model, cycles / "unseen", "--out", tmp_path / "plain.csv")
    assert found.keys() == documented()["testbed compensate apply"]
    share = np.genfromtxt(tmp_path / "plain.csv", delimiter=",", names=True)["extrapolated"].mean()
    assert (found["record"], found["method"]) == ("unseen, fog", "gradient")
    assert found["extrapolated"] == pytest.approx(share)
    found = document("audit", model, cycles / "unseen", "--out", tmp_path / "audit")
    assert found == {**json.loads((tmp_path / "audit" / "audit.json").read_text()), "written": str(tmp_path / "audit")}


@pytest.mark.parametrize(("first", "elsewhere"), [(0, False), (1800, True)])
def test_another_start_temperature_is_flagged(table, model, tmp_path, first, elsewhere):
    """From the middle of the first ramp on the gyro is 15 K warmer than where its cycles of training began."""
    rows = table.read_text().splitlines()
    path = tmp_path / "log.csv"
    path.write_text("\n".join([rows[0], *rows[1 + first :]]))
    options = ["--rate", "0.1 Hz", "--out", str(tmp_path / "out")]
    for command in ("apply", "audit"):
        result = CliRunner().invoke(
            app, ["compensate", command, str(model), str(path), *options[:3], f"{options[3]}_{command}"]
        )
        assert result.exit_code == 0, result.output
        said = "from the nearest start of a training cycle: its first hours are compensated worse"
        assert (said in " ".join(result.output.split())) is elsewhere
    found = json.loads((tmp_path / "out_audit" / "audit.json").read_text())
    assert found["starts_elsewhere"] is elsewhere
    # 10,800 s of 0.1 K/min, 1.5 K behind.
    assert found["start_distance_k"] == pytest.approx(16.5 if first else 0.0, abs=0.1)
    assert found["extrapolated"] == 0.0


def test_the_audit_of_a_frozen_model_passes_and_reduces_the_drift(cycles, model, tmp_path):
    """Median targets of one command: the drift is at least six times smaller after two cycles, every rate intact."""
    place = tmp_path / "audit"
    result = CliRunner().invoke(app, ["compensate", "audit", str(model), str(cycles / "unseen"), "--out", str(place)])
    assert result.exit_code == 0, result.output
    assert "verdict: no leak found" in result.output
    found = json.loads((place / "audit.json").read_text())
    assert found["passed"]
    assert found["leaks"] == []
    assert found["drift_reduction"] > 6.0
    assert found["block_std_over_oracle"] < 1.4
    # The rate never enters the model: what survives is one to rounding.
    assert all(abs(line["gain"] - 1.0) < 1e-6 for line in found["gains"])
    assert found["step_gain"] == pytest.approx(1.0, abs=1e-6)
    for letter, bound in (("N", 0.02), ("B", 0.06)):
        before, after = (found[key]["coefficients"][letter]["value"] for key in ("before", "after"))
        assert after == pytest.approx(before, rel=bound, abs=0.0)
    gains = np.genfromtxt(place / "gains.csv", delimiter=",", names=True)
    np.testing.assert_array_equal(gains["period_s"], [line["period_s"] for line in found["gains"]])
    names = {line.split(",")[0] for line in (place / "allan.csv").read_text().splitlines()[1:]}
    assert names == {"record", "compensated", "oracle"}
    page = (place / "audit.html").read_text()
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
        str(tmp_path / "audit"),
    ]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0, result.output
    found = json.loads((tmp_path / "audit" / "audit.json").read_text())
    assert found["oracle"] is None
    assert found["drift_reduction"] is None
    assert found["oracle_ratio_1h"] is None
    assert "true drift" not in (tmp_path / "audit" / "audit.html").read_text().split("<h2>Figures</h2>")[1]


def test_a_leak_ends_with_1_and_is_named(cycles, tmp_path, monkeypatch, capsys):
    """A compensation that trains on the record it corrects, here a smoother in the place of the paper's pipeline."""
    from testbed.drift.quality import smoothed

    class Result:
        def __init__(self, record):
            self.rate = record.rate - smoothed(record.rate, record.sample_rate_hz, 1.0 / 2000.0)

    monkeypatch.setattr("testbed.compensation.paper3.compensate", Result)
    status, text = ends_with(["audit", "paper3", cycles / "unseen", "--out", tmp_path / "audit"], monkeypatch, capsys)
    assert status == 1
    assert "LEAK: of a true rate with a period of 21600 s only" in text
    assert "LEAK: the Allan deviation at 1 h is" in text
    assert "This result is a leak" in (tmp_path / "audit" / "audit.html").read_text()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["train", "{unseen}", "--method", "gradeint"], "did you mean 'gradient'"),
        (["train", "{missing}"], "expected a recording or a run folder"),
        (["train", "{table}"], "expected either the sample rate"),
        (["train", "{table}", "--time", "hours", "--temperature-unit", "m"], "--temperature-unit"),
        (["train", "{table}", "--rate", "1", "--column", "speed"], "no column 'speed'"),
        (["train", "{unseen}", "--sensor", "gyro"], "gyro"),
        (["train", "{table}", "--rate", "1", "--time", "hours"], "(--time), got both"),
        (["train", "{table}", "--rate", "1", "--unit", "deg"], "--unit: expected a quantity in rad/s"),
        (["train", "{table}", "--rate", "1", "--sensor", "fog"], "--sensor: expected a run folder with it"),
        (["train", "{unseen}", "--rate", "1"], "--rate: expected a text file with it"),
        (["audit", "{model}", "{unseen}", "--unit", "deg/s"], "--unit: expected a text file with it"),
        (["apply", "{model}", "{unseen}", "--column", "2"], "--column: expected a text file with it"),
        (["train", "{unseen}", "{up}", "{unseen}"], "unseen: expected different cycles, got this one twice"),
        # Of a cycle on the table at rest, the rate spans 0.6 deg/h, which is no thermal cycle in degC.
        (
            ["train", "{table}", "--rate", "0.1", "--column", "temperature", "--temperature", "rate"],
            "--temperature: expected a temperature that moves by at least 1 K",
        ),
        (["apply", "{model}", "{gap}", "--time", "hours", "--time-unit", "h"], "gap.csv:32: uneven or missing sample"),
        (["apply", "{model}", "{gap}", "--time", "hours", "--time-unit", "h"], "fill the gap or cut the record"),
        (
            ["apply", "{model}", "{nan}", "--rate", "0.1"],
            "nan.csv:32: expected a finite number in 'rate', got none; fill it",
        ),
        (
            ["apply", "{model}", "{comma}", "--rate", "0.1"],
            "comma.csv:3: expected a finite number in 'rate', got 'x'",
        ),
        (
            ["audit", "{missing}", "{unseen}"],
            "missing: cannot be read: No such file",
        ),
        (["audit", "{model}", "{slow}", "--rate", "0.005"], "expected at least one reading in 100 s"),
        (["apply", "{table}", "{unseen}"], "expected a model that `testbed compensate train` wrote"),
        (["apply", "{missing}", "{unseen}"], "cannot be read: No such file"),
        (["audit", "{other}", "{unseen}"], "format: input should be 'testbed drift model'"),
        (["audit", "{model}", "{short}", "--rate", "0.1"], "so that a slow rate can be told from drift"),
    ],
)
def test_bad_input_ends_with_2_and_leaves_nothing(
    cycles, model, table, tmp_path, monkeypatch, capsys, arguments, message
):
    (tmp_path / "other.json").write_text('{"format": "something else"}')
    lines = table.read_text().splitlines()
    texts = {
        "short": lines[:100],
        "gap": lines[:31] + lines[35:],
        "nan": [*lines[:31], "0.1,nan,20", *lines[32:]],
        "comma": ["hours;rate;temperature", "0;10,5;20,0", "0,1;x;20,0", *["0,2;10,5;20,0"] * 9],
        "slow": [lines[0], *lines[1::20]],
    }
    for name, text in texts.items():
        (tmp_path / f"{name}.csv").write_text("\n".join(text))
    places = {name: tmp_path / f"{name}.csv" for name in texts} | {
        "unseen": cycles / "unseen",
        "up": cycles / "up",
        "missing": tmp_path / "missing",
        "table": table,
        "model": model,
        "other": tmp_path / "other.json",
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
        read_thermal(tmp_path / "run", Columns())


@pytest.mark.parametrize(
    ("command", "why"),
    [
        ("train", "--out: expected a file to write"),
        ("apply", "--out: expected a file to write"),
        ("audit", "exists and is no folder of the testbed"),
    ],
)
def test_a_place_that_cannot_be_written_is_refused_before_the_work(
    cycles, model, tmp_path, monkeypatch, capsys, command, why
):
    """A folder where a file is asked for, and the other way round; the words of the work do not appear."""
    taken = tmp_path / "taken"
    taken.write_text("mine") if command == "audit" else taken.mkdir()
    sources = [cycles / "up"] if command == "train" else [model, cycles / "unseen"]
    status, text = ends_with([command, *sources, "--out", taken], monkeypatch, capsys)
    assert status == 2
    assert why in text
    assert "fog, 23.67 h" not in text
    assert [path.name for path in tmp_path.iterdir()] == ["taken"]


def test_every_command_says_what_it_read(cycles, model, table, tmp_path, monkeypatch, capsys):
    """Swapped columns: 20 degC to 60 and -30 become a rate, and a rate of 10.6 deg/h a temperature. No rule can know;
    the reader can.
    """
    arguments = ["apply", model, table, "--rate", "0.1", "--column", "temperature", "--temperature", "rate"]
    status, text = ends_with([*arguments, "--out", tmp_path / "swapped.csv"], monkeypatch, capsys)
    assert status == 0
    run = testbed.open_run(cycles / "unseen").sensors["fog"]
    rate, heat = run.rate / DEG_H, run.temperature - 273.15
    assert (
        f"rate {heat.min():.4g} to {heat.max():.4g} deg/h, temperature {rate.min():.1f} to {rate.max():.1f} degC"
        in text
    )


def test_a_model_audited_on_its_training_record_is_a_leak(cycles, tmp_path, monkeypatch, capsys):
    """A frozen model lets known rates pass, also on the record it has learned: only the record's identity tells."""
    ends_with(["train", cycles / "up", "--out", tmp_path / "one.json"], monkeypatch, capsys)
    status, text = ends_with(
        ["audit", tmp_path / "one.json", cycles / "up", "--out", tmp_path / "a"], monkeypatch, capsys
    )
    assert status == 1
    assert "LEAK: the model was trained on this very record" in text
    found = json.loads((tmp_path / "a" / "audit.json").read_text())
    assert found["trained_on_this_record"]
    assert found["trained_on"] == ["up, fog"]
    assert found["least_gain_in_drift_band"] == pytest.approx(1.0, abs=1e-9)
    status, _ = ends_with(
        ["audit", tmp_path / "one.json", cycles / "unseen", "--out", tmp_path / "b"], monkeypatch, capsys
    )
    assert not json.loads((tmp_path / "b" / "audit.json").read_text())["trained_on_this_record"]


def test_a_run_without_noise_has_nothing_to_audit(model, tmp_path, monkeypatch, capsys):
    text = (
        (FOG / "thermal_cycle.yaml").read_text().replace("bandwidth: 0.5 Hz", "bandwidth: 0.05 Hz").split("expect:")[0]
    )
    (tmp_path / "silent.yaml").write_text(text.replace("sample_rate: 1 Hz", "sample_rate: 0.1 Hz, noise: off"))
    testbed.run(testbed.load_scenario(tmp_path / "silent.yaml"), out=tmp_path / "silent")
    status, text = ends_with(["audit", model, tmp_path / "silent", "--out", tmp_path / "out"], monkeypatch, capsys)
    assert status == 2
    assert "expected noise, got a ramp alone" in text
    assert not (tmp_path / "out").exists()


def test_an_interrupted_audit_leaves_nothing(cycles, model, tmp_path, monkeypatch, capsys):
    def interrupt(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("testbed.drift.page.gain_figure", interrupt)
    status, text = ends_with(["audit", model, cycles / "unseen", "--out", tmp_path / "out"], monkeypatch, capsys)
    assert status == 130
    assert "nothing was left behind" in text
    assert list(tmp_path.iterdir()) == []
