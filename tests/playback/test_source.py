"""What a file's own words say, and what a stranger is told where they do not say enough."""

from __future__ import annotations

import re

import numpy as np
import pytest

import testbed
from testbed.errors import ScenarioError
from testbed.playback.source import open_source

N = 4000


def bench_csv(folder, head="t_us,mhd_ars [deg/s],mems_gyro [deg/s],temp [degC]", more=""):
    """Write a bench's text file in deg/s at 2 kHz."""
    path = folder / "bench.csv"
    rows = (
        f"{500 * k},{np.sin(0.02 * k):.6f},{np.sin(0.02 * k + 0.1):.6f},{21.5 + 1e-4 * k:.3f}{more}" for k in range(N)
    )
    path.write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")
    return path


def test_a_file_with_names_and_units_needs_no_map(tmp_path):
    source = open_source([bench_csv(tmp_path)])
    assert list(source.sensors) == ["mhd_ars", "mems_gyro"]
    assert source.reference is None
    assert source.name == "bench"
    run = testbed.replay(bench_csv(tmp_path), ["kalman"])
    assert run.sensors["mhd_ars"].sample_rate_hz == 2000.0
    np.testing.assert_allclose(np.rad2deg(run.sensors["mhd_ars"].rate), np.sin(0.02 * np.arange(N)), atol=6e-7)


def test_two_columns_of_time_are_told_with_the_way_out(tmp_path):
    path = bench_csv(tmp_path, "t_us,mhd_ars [deg/s],mems_gyro [deg/s],temp [degC],time [s]", ",0.5")
    with pytest.raises(ScenarioError) as error:
        testbed.replay(path, ["kalman"])
    text = str(error.value)
    assert "expected one column of time, got 't_us', 'time [s]'" in text
    assert f"testbed log inspect {path} --out log.yaml" in text


def test_a_map_names_the_sensors(tmp_path):
    path = bench_csv(tmp_path, "t_us,w1,w2,temp")
    time = {"column": "t_us", "unit": "us"}
    channels = {
        "mhd_ars": {"column": "w1", "unit": "deg/s", "time": time},
        "mems_gyro": {"column": "w2", "unit": "deg/s", "sign": -1, "time": time},
        "reference": {"column": "w1", "unit": "deg/s", "time": time},
        "temp": {"column": "temp", "unit": "degC", "time": time},
    }
    run = testbed.replay(path, ["kalman"], map={"channels": channels})
    assert run.metrics.replay.reference
    assert run.metrics.sensors["mhd_ars"].rmse_deg_s == 0.0
    assert run.metrics.replay.notes == ["temp: neither a rate nor an angle, left out"]
    np.testing.assert_allclose(np.rad2deg(run.sensors["mems_gyro"].rate), -np.sin(0.02 * np.arange(N) + 0.1), atol=6e-7)


def test_parts_of_a_recording_are_one(tmp_path):
    path = bench_csv(tmp_path)
    lines = path.read_text().splitlines()
    parts = [tmp_path / "one.csv", tmp_path / "two.csv"]
    parts[0].write_text("\n".join(lines[: N // 2]) + "\n")
    parts[1].write_text("\n".join([lines[0], *lines[N // 2 :]]) + "\n")
    channels = {name: {"column": f"{name} [deg/s]"} for name in ("mhd_ars", "mems_gyro")}
    whole, joined = (testbed.replay(log, ["kalman"], map={"channels": channels}) for log in (path, parts))
    np.testing.assert_array_equal(whole.fusion["kalman"].rate, joined.fusion["kalman"].rate)
    with pytest.raises(ScenarioError, match="expected a map with several files"):
        testbed.replay(parts, ["kalman"])


@pytest.mark.parametrize(
    ("head", "message"),
    [
        ("t_us,w1,w2,temp", r"to be said: w1: unit \(unit, or scale of a count\)"),
        ("t_us,w1 [deg],w2 [deg],temp [degC]", r"w1: increment or angle \(kind\)"),
        (
            "k,w1 [deg/s],w2 [deg/s],temp [degC]",
            r"w1: sample rate \(time.rate\) or column of the time \(time.column\)",
        ),
    ],
)
def test_everything_that_is_open_is_told_at_once(head, message, tmp_path):
    with pytest.raises(ScenarioError, match=message) as error:
        testbed.replay(bench_csv(tmp_path, head), ["kalman"])
    assert len(error.value.problems) >= 3  # both channels and the way out
    # Replay has no option of a single column: what is open stands in a map.
    options = set(re.findall(r"--[a-z-]+", str(error.value)))
    assert options == {"--map", "--out"}


def test_no_recording_is_told():
    with pytest.raises(ScenarioError, match="LOG: expected a recording"):
        testbed.replay([], ["kalman"])
    with pytest.raises(ScenarioError, match="expected a recording"):
        testbed.replay("nowhere.csv", ["kalman"])


def test_a_channel_without_a_plain_name_needs_one(tmp_path):
    path = bench_csv(tmp_path, "t_us,gyro[0] [deg/s],base [deg/s],temp [degC]")
    with pytest.raises(ScenarioError, match=r"channels.gyro\[0\]: expected a name of at most 64 letters") as error:
        testbed.replay(path, ["kalman"])
    assert [problem.key for problem in error.value.problems] == ["channels.gyro[0]", "channels.base"]


def test_a_filter_is_not_called_as_a_sensor(tmp_path):
    said = {"mems_gyro": {"type": "kalman"}}
    with pytest.raises(ScenarioError, match=r"fusion.mems_gyro: is the name of a sensor too"):
        testbed.replay(bench_csv(tmp_path), said)
