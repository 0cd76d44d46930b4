"""A run that goes out as a recording comes back to the same bits, through every format."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from ruamel.yaml import YAML

import testbed
from testbed.errors import ScenarioError
from testbed.playback.export import FORMATS
from tests.playback.conftest import LINES, SETTLE


@pytest.mark.parametrize("name", FORMATS)
def test_an_exported_run_is_replayed_to_the_same_bits(name, bench, scenario_file, tmp_path):
    """Same belief, parameters and start: every rate, std and diagnostic, lost readings included; CSV holds every digit
    too, since its numbers are the shortest that are read back as they were.
    """
    run, folder = bench
    made = testbed.export(folder, name, tmp_path / name)
    again = testbed.replay(made / "log.yaml", scenario_file, start="rest", settle=SETTLE, lines=LINES)
    assert np.isnan(again.sensors["mems_gyro"].rate).any()
    for group, signals in again.groups.items():
        for signal in signals:
            np.testing.assert_array_equal(signals[signal], run.groups[group][signal], err_msg=f"{group}/{signal}")
    assert again.fusion.keys() == run.fusion.keys()
    for source in ("mhd_ars", "mems_gyro", "kalman", "arw_shakf", "wideband"):
        found, known = again.metrics.sources[source], run.metrics.sources[source]
        # Sums over the same blocks of the same numbers.
        assert found.rmse_deg_s == known.rmse_deg_s
        assert found.rmse_aligned_deg_s == known.rmse_aligned_deg_s
        assert [line.gain for line in found.lines] == [line.gain for line in known.lines]
        assert found.missing == known.missing


def test_the_run_folder_itself_is_a_recording(bench, scenario_file):
    run, folder = bench
    for log in (folder, folder / "run.nc"):
        again = testbed.replay(log, scenario_file, start="rest")
        np.testing.assert_array_equal(again.fusion["kalman"].rate, run.fusion["kalman"].rate)
        np.testing.assert_array_equal(again.truth.rate, run.truth.rate)


def test_a_filter_that_is_told_otherwise_gives_other_bits(bench, scenario_file):
    """The comparison above would see a start, or a belief, that is not handed on."""
    run, folder = bench
    unknown = testbed.replay(folder, scenario_file, start="unknown")
    assert not np.array_equal(unknown.fusion["kalman"].rate, run.fusion["kalman"].rate)
    other = testbed.replay(folder, scenario_file, start="rest", belief={n: testbed.belief_of(p) for n, p in OTHERS})
    assert not np.array_equal(other.fusion["kalman"].rate, run.fusion["kalman"].rate)


OTHERS = (("mhd_ars", "mhd03"), ("mems_gyro", "adis16505_filtered"))


def test_the_map_names_files_beside_it_and_the_rate_in_all_its_digits(bench, tmp_path):
    made = testbed.export(bench[1], "csv", tmp_path / "out")
    channels = YAML(typ="safe").load((made / "log.yaml").read_text())["channels"]
    assert list(channels) == ["mhd_ars", "mems_gyro", "reference"]
    assert channels["mems_gyro"] == {
        "file": "mems_gyro.csv",
        "column": "rate [rad/s]",
        "unit": "rad/s",
        "time": {"rate": "2000.0 Hz"},
    }
    assert (made / "mems_gyro.csv").read_text().splitlines()[0] == '"t [ns]","rate [rad/s]"'
    assert (made / "manifest.json").is_file()


def test_stamps_alone_give_the_same_rates(bench, tmp_path):
    """Who leaves the map and reads the columns of time gets 20000 and 2000 Hz, and the same samples."""
    run, folder = bench
    made = testbed.export(folder, "hdf5", tmp_path / "out")
    channels = {name: {"column": f"{name}/rate", "time": {"column": f"{name}/time"}} for name in run.sensors}
    again = testbed.replay(made / "data.h5", ["kalman"], map={"channels": dict(reversed(channels.items()))})
    assert {n: one.sample_rate_hz for n, one in again.sensors.items()} == {"mhd_ars": 20_000.0, "mems_gyro": 2_000.0}
    np.testing.assert_array_equal(again.sensors["mhd_ars"].rate, run.sensors["mhd_ars"].rate)


def test_what_cannot_be_exported_is_said(bench, tmp_path, monkeypatch):
    with pytest.raises(ScenarioError, match=r"--format: unknown format 'tmds'; did you mean 'tdms'\?"):
        testbed.export(bench[1], "tmds")
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.txt").write_text("years")
    with pytest.raises(ScenarioError, match="choose another --out"):
        testbed.export(bench[1], "csv", tmp_path / "mine")
    monkeypatch.setitem(sys.modules, "asammdf", None)
    with pytest.raises(ScenarioError, match=r"mdf needs asammdf: pip install '.*\[logs\]'"):
        testbed.export(bench[1], "mdf", tmp_path / "out")
    assert not (tmp_path / "out").exists()
