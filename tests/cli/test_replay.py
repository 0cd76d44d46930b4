"""`testbed replay` and `testbed export` as a stranger types them: what they print, write and answer."""

from __future__ import annotations

import json

import numpy as np
import pytest

from testbed.fusion.analysis.finding import Finding, Verdict
from tests.cli.test_grammar import say

N = 2000


@pytest.fixture
def spoken(monkeypatch, capsys, tmp_path):
    monkeypatch.chdir(tmp_path)
    rows = (f"{500 * k},{0.5 * np.sin(0.03 * k):.7f},{0.5 * np.sin(0.03 * k):.7f}" for k in range(N))
    (tmp_path / "bench.csv").write_text("t_us,mhd_ars [deg/s],mems_gyro [deg/s]\n" + "\n".join(rows) + "\n")
    return lambda *words: say(*words, monkeypatch=monkeypatch, capsys=capsys)


@pytest.fixture
def stands(monkeypatch):
    """Let the verdict find what it is told to."""

    def find(*findings):
        monkeypatch.setattr("testbed.playback.judged.verdict", lambda *_: Verdict(findings, ("The gain: no motion.",)))

    return find


def finding(kind="sign", value=-1.0, unit="1"):
    return Finding(kind, "mems_gyro", value, 1.1 * value, 0.9 * value, unit, "turn the axis round: sign: -1 in the map")


def test_a_bench_file_is_replayed(spoken, stands, tmp_path):
    stands()
    status, out, err = spoken("replay", "bench.csv", "--filter", "kalman, blending", "--filter", "wideband")
    assert status == 0, err
    filters = ("kalman", "blending", "wideband")
    for text in ("bench, replayed: mean and spread", "nothing stands against", "wrote runs/replay_bench", *filters):
        assert text in out
    assert "bench: text" in err
    assert "without a reference" in err
    assert (tmp_path / "runs" / "replay_bench" / "recording.rrd").is_file()
    for command in ("report", "psd", "allan"):
        assert spoken(command, "runs/replay_bench")[0] == 0
    refused = spoken("pointing", "runs/replay_bench", "--pointing", pointing_file(tmp_path))
    assert refused[0] == 2
    assert "has no reference" in refused[2]


def test_a_default_folder_that_holds_something_else_is_told_before_the_recording_is_read(spoken, tmp_path, monkeypatch):
    monkeypatch.setattr("testbed.playback.source.read_plans", lambda _: pytest.fail("the recording was read"))
    (tmp_path / "runs").mkdir()
    (tmp_path / "runs" / "replay_bench").write_text("mine")
    status, _, err = spoken("replay", "bench.csv", "--filter", "kalman")
    assert status == 2
    assert "replay_bench: exists and is no folder of the testbed" in err


def pointing_file(folder):
    path = folder / "pointing.yaml"
    path.write_text("tracker: {bandwidth: 5 Hz}\nwindows: [100 ms]\n", encoding="utf-8")
    return path


def test_a_finding_is_said_first_and_gives_status_1_though_the_folder_is_there(spoken, stands, tmp_path):
    stands(finding())
    status, out, err = spoken("replay", "bench.csv", "--filter", "kalman")
    assert status == 1
    assert "warning: mems_gyro: sign -1.0000" in err
    assert out.splitlines()[0].startswith("finding: mems_gyro: sign")
    assert "STANDS AGAINST IT: sign of mems_gyro" in out
    assert "not decided: The gain: no motion." in out
    page = (tmp_path / "runs" / "replay_bench" / "report.html").read_text(encoding="utf-8")
    assert "✗ stands" in page
    assert "Against it stands: sign of mems_gyro" in page
    metrics = json.loads((tmp_path / "runs" / "replay_bench" / "metrics.json").read_text())
    assert metrics["findings"] == [
        {
            "kind": "sign",
            "sensor": "mems_gyro",
            "value": -1.0,
            "lower": -1.1,
            "upper": -0.9,
            "unit": "1",
            "remedy": "turn the axis round: sign: -1 in the map",
            "fixed": False,
        }
    ]
    assert metrics["undecided"] == ["The gain: no motion."]


def test_fix_puts_it_right_and_gives_status_0(spoken, stands):
    stands(finding())
    status, out, err = spoken("replay", "bench.csv", "--filter", "kalman", "--fix", "--json", "--quiet")
    assert (status, err) == (0, "")
    document = json.loads(out)
    assert [one["fixed"] for one in document["findings"]] == [True]
    assert document["written"] == "runs/replay_bench"
    turned = document["sensors"]["mems_gyro"]["mean_deg_s"]
    stands()
    straight = json.loads(spoken("replay", "bench.csv", "--filter", "kalman", "--json", "--quiet")[1])
    assert turned == pytest.approx(-straight["sensors"]["mems_gyro"]["mean_deg_s"], rel=1e-12)


def test_what_is_not_safe_stands_though_it_was_asked_to_be_put_right(spoken, stands):
    stands(finding("saturation", 0.2))
    assert spoken("replay", "bench.csv", "--filter", "kalman", "--fix")[0] == 1


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("bench.csv",), "--filter: expected at least one filter"),
        (("bench.csv", "--filter", "kalman,"), "--filter: expected one or more with commas between them"),
        (("bench.csv", "--filter", "kalman", "--lines", "1,,2"), "--lines: expected one or more with commas"),
        (("bench.csv", "--filter", "kalman", "--outputs", "metrics,"), "--outputs: expected one or more with commas"),
        (("bench.csv", "--filter", "calman", "--filter", "kalman"), "unknown filter 'calman'"),
        (("bench.csv", "--filter", "calman"), "unknown filter 'calman'"),
        (("--filter", "kalman"), "LOG: expected a recording"),
        (("none.csv", "--filter", "kalman"), "none.csv: expected a recording"),
        (("bench.csv", "--filter", "kalman", "--settle", "2 Hz"), "--settle"),
        (("bench.csv", "--filter", "kalman", "--fusion", "none.yaml"), "none.yaml"),
        (("bench.csv", "--filter", "kalman", "--start", "moving"), "--start: expected unknown or rest"),
    ],
)
def test_a_mistake_is_answered_with_its_remedy(words, message, spoken):
    status, out, err = spoken("replay", *words)
    assert (status, out) == (2, "")
    assert message in err
    assert "Traceback" not in err


def test_export_names_what_it_wrote(spoken, tmp_path):
    spoken("replay", "bench.csv", "--filter", "kalman", "--out", "again")
    status, out, _ = spoken("export", "again", "--format", "csv")
    assert status == 0
    assert out == "wrote runs/again_csv: log.yaml, manifest.json, mems_gyro.csv, mhd_ars.csv\n"
    status, out, _ = spoken("export", "again", "--format", "tdms", "--out", "bus", "--json")
    assert json.loads(out) == {"format": "tdms", "files": ["data.tdms", "log.yaml", "manifest.json"], "written": "bus"}
    assert spoken("export", "again", "--format", "xls")[0] == 2
    assert spoken("export", "bench.csv", "--format", "csv")[0] == 2
