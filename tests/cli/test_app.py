"""The command line: what it prints, its exit status, no traceback for a user's mistake."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time

import jsonschema
import pytest
from ruamel.yaml import YAML

from tests.scenario.test_loader import GOOD, SCENARIOS
from tests.scenes import short_file
from tests.shell import assert_clear, call, spawn


def test_run_prints_a_table_and_writes_the_run_folder(tmp_path):
    result = spawn("run", short_file(tmp_path), cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    for text in (
        "error against the truth in deg/s",
        "RMSE",
        "claimed std",
        "x optimum",
        "mhd_ars",
        "mems_gyro",
        "kalman",
        "arw_shakf",
        "10 Hz gain, phase",
        "expected kalman rmse_deg_s < 1",
        "met",
        "wrote runs/short",
    ):
        assert text in result.stdout
    assert "short: 0 of 0.5 s" in result.stderr or "short: 1 of 0.5 s" in result.stderr
    assert (tmp_path / "runs" / "short" / "recording.rrd").is_file()
    again = call("report", "runs/short", cwd=tmp_path)
    assert again.returncode == 0, again.stderr


def test_run_out_seed_and_block_are_heard(tmp_path):
    result = call("run", short_file(tmp_path), "--out", "elsewhere", "--seed", "5", "--block", "0.1", cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    assert json.loads((tmp_path / "elsewhere" / "metrics.json").read_text())["seed"] == 5


def test_run_that_misses_an_expectation_ends_with_1_and_keeps_the_run(tmp_path):
    result = call("run", short_file(tmp_path, ('"< 1"', '"< 1e-9"')), cwd=tmp_path)
    assert result.returncode == 1
    assert "MISSED" in result.stdout
    assert (tmp_path / "runs" / "short" / "run.nc").is_file()


@pytest.mark.parametrize("command", ["run", "check"])
def test_bad_scenario_ends_with_2_and_every_finding(tmp_path, command):
    path = short_file(tmp_path, ("seed: 11", "sead: 11"), ("frequency: 10 Hz", "frequency: 10"))
    result = call(command, path, cwd=tmp_path)
    assert_clear(result, 2)
    assert f"{path}:2: sead: unknown key; did you mean 'seed'?" in result.stderr
    assert f"{path}:8: motion.0.sine.frequency" in result.stderr
    assert not (tmp_path / "runs").exists()


@pytest.mark.parametrize(
    "arguments",
    [
        ("run",),
        ("run", "missing.yaml"),
        ("run", "."),
        ("nonsense",),
        ("check", "missing.yaml"),
        ("report", "."),
        ("report", "nowhere"),
        ("run", "short.yaml", "--block", "0"),
        ("run", "short.yaml", "--seed", "-1"),
        ("view", "nowhere"),
    ],
    ids=" ".join,
)
def test_bad_calls_end_with_2(tmp_path, arguments):
    short_file(tmp_path)
    assert_clear(call(*arguments, cwd=tmp_path), 2)


def test_an_occupied_output_folder_ends_with_2(tmp_path):
    short_file(tmp_path)
    assert_clear(call("run", "short.yaml", "--out", ".", cwd=tmp_path), 2)


def test_a_diverging_run_ends_with_3_and_says_how_far_it_got(tmp_path):
    """A feed-forward that believes in ten times the inertia asks for 11 N m where the motion itself needs 1.1 N m of
    the motor's 6 N m.
    """
    path = short_file(
        tmp_path, ("{preset: air_bearing}", "{feedforward_inertia_error: 9}"), ("frequency: 10 Hz", "frequency: 200 Hz")
    )
    result = call("run", path, cwd=tmp_path)
    assert_clear(result, 3)
    assert "saturated" in result.stderr
    assert " t = 0." in result.stderr
    assert not list(tmp_path.glob("runs/*"))


def limit_file_size():
    import resource

    # A write beyond it fails with EFBIG instead of the signal: the nearest thing to a full disk that needs no
    # privilege.
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (400_000, 400_000))


@pytest.mark.skipif(os.name != "posix", reason="file size limits are POSIX")
def test_a_full_disk_ends_with_3_and_leaves_nothing(tmp_path):
    result = spawn("run", short_file(tmp_path), cwd=tmp_path, preexec_fn=limit_file_size)
    assert_clear(result, 3)
    assert "the run got as far as t = 0 s" in result.stderr
    assert not list(tmp_path.glob("runs/*"))
    assert not list(tmp_path.glob("runs/.*"))


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM], ids=["ctrl-c", "terminate"])
def test_an_interrupt_ends_with_130_and_leaves_nothing(tmp_path, how):
    path = short_file(tmp_path, ("duration: 0.5 s", "duration: 600 s"))
    process = subprocess.Popen(
        [sys.executable, "-m", "testbed", "run", str(path)],
        cwd=tmp_path,
        stderr=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    deadline = time.monotonic() + 120
    while not list(tmp_path.glob("runs/.*")) and time.monotonic() < deadline:
        time.sleep(0.05)
    time.sleep(1.0)
    process.send_signal(how)
    _, error = process.communicate(timeout=60)
    assert process.returncode == 130, error
    assert "interrupted" in error
    assert "Traceback" not in error
    assert not list(tmp_path.glob("runs/*"))
    assert not list(tmp_path.glob("runs/.*"))


def test_check_prints_what_was_written_and_what_was_understood(tmp_path):
    result = call("check", short_file(tmp_path), "--all", cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    row = next(line for line in result.stdout.splitlines() if "motion.0.sine.rate" in line)
    assert "1 deg/s" in row
    assert "0.017453292519943295 rad/s" in row
    row = next(line for line in result.stdout.splitlines() if "angle_random_walk" in line)
    assert "0.15 deg/sqrt(h)" in row


def test_list_names_every_part(tmp_path):
    from testbed.fusion import FILTERS
    from testbed.models.motions import MOTIONS
    from testbed.parts import preset_names
    from testbed.sensors import SENSORS

    result = call("list", cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    for name in (*MOTIONS, *SENSORS, *FILTERS, *preset_names("testbed.sensors"), *preset_names("testbed.models")):
        assert f"\n  {name} " in result.stdout


def test_schema_accepts_every_shipped_scenario_and_refuses_a_bad_one(tmp_path):
    result = call("schema", cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    schema = json.loads(result.stdout)
    validator = jsonschema.Draft202012Validator(schema)
    validator.check_schema(schema)
    yaml = YAML(typ="safe", pure=True)
    for path in SCENARIOS:
        validator.validate(yaml.load(path.read_text()))
    for old, new in (
        ("seed: 7", "sead: 7"),
        ("- sine:", "- sinus:"),
        ("duration: 2 s", "duration: 2"),
        ("angle: 5.555 mrad", "angel: 5.555 mrad"),
        ("preset: sx300", "preset: sx30"),
    ):
        assert not validator.is_valid(yaml.load(GOOD.replace(old, new))), new


# What takes long to load and only drawing, recording or single parts need.
SELDOM = "scipy.signal scipy.stats scipy.interpolate rerun control matplotlib pandas xarray h5py h5netcdf"
COMPUTING = f"numpy scipy numba mujoco pint {SELDOM}"


@pytest.mark.parametrize(
    ("words", "unwanted", "said"),
    [
        (["--help"], f"pydantic {COMPUTING}", "run"),
        (["list"], COMPUTING, "wideband"),
        (["check", "short.yaml"], SELDOM, "The scenario is valid"),
        (["run", "short.yaml", "--outputs", "metrics"], SELDOM, "RMSE"),
    ],
)
def test_a_command_loads_no_library_that_it_does_not_need(tmp_path, words, unwanted, said):
    short_file(tmp_path)
    code = (
        f"import sys; sys.argv = ['testbed', *{words!r}]\nfrom testbed.cli import main\ntry:\n    main()\nexcept "
        f"SystemExit:\n    pass\nprint([m for m in {unwanted.split()!r} if m in sys.modules])"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=tmp_path)
    assert result.stdout.splitlines()[-1] == "[]"
    assert said in result.stdout
