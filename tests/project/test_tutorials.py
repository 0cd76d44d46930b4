"""Tutorials and recipes: everything that they tell to type works, in that order, in one empty folder."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
from pathlib import Path

import pytest

import testbed
from tests.shell import call

ROOT = Path(__file__).parents[2]
TUTORIALS = sorted(ROOT.glob("docs/tutorials/*.md"))
FOLDER = ROOT / "docs" / "reference" / "run_folder.md"
PAGES = [*TUTORIALS, ROOT / "docs" / "howto.md", ROOT / "docs" / "replay.md", FOLDER]
SHORT = {
    "name": "short",
    "duration": "0.4 s",
    "settle": "0.2 s",
    "turntable": {"engine": "modal"},
    "motion": [{"sine": {"frequency": "10 Hz", "rate": "1 deg/s"}}],
    "sensors": {"mhd_ars": {"preset": "sx300"}, "mems_gyro": {"preset": "adis16505_filtered"}},
    "fusion": {"kalman": {}},
}
FENCE = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


@pytest.mark.slow
@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.stem)
def test_what_it_tells_to_type_works(page, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scenarios").symlink_to(ROOT / "scenarios")
    known = {}
    for kind, text in FENCE.findall(page.read_text(encoding="utf-8")):
        if kind == "yaml":
            name = text.split(maxsplit=2)[1]
            (tmp_path / name).write_text(text, encoding="utf-8")
        elif kind == "sh":
            commands(text)
        elif kind == "python":
            exec(compile(text, str(page), "exec"), known)  # noqa: S102 - a page of this repository
    said = capsys.readouterr().out
    print(said)
    assert "nan" not in said


def commands(text):
    for line in text.splitlines():
        word, *arguments = shlex.split(line)
        # What installs is tried by whoever clones the repository.
        if word != "make":
            assert word == "testbed"
            done = call(*arguments, cwd=".")
            assert done.returncode == 0, f"{line}\n{done.stderr}"


@pytest.mark.slow
def test_octave_reads_a_run_as_the_page_tells(tmp_path):
    octave = shutil.which("octave-cli")
    if octave is None:
        pytest.skip("octave is not installed (Debian: octave octave-netcdf)")
    (text,) = (text for kind, text in FENCE.findall(FOLDER.read_text(encoding="utf-8")) if kind == "octave")
    run = testbed.run(SHORT, out=tmp_path / "ten")
    (tmp_path / "read.m").write_text(text.replace("time >= 10", "time >= 0.2"), encoding="utf-8")
    done = subprocess.run([octave, "read.m"], cwd=tmp_path, capture_output=True, text=True, check=False)
    if "netcdf" in done.stderr and "not found" in done.stderr:
        pytest.skip(f"octave has no package netcdf (Debian: octave-netcdf): {done.stderr.strip()}")
    assert f"rmse {run.metrics.fusion['kalman'].rmse_deg_s:.6f} deg/s" in done.stdout, done.stderr


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.stem)
def test_what_the_base_install_lacks_is_said(page):
    text = page.read_text(encoding="utf-8")
    code = "".join(body for kind, body in FENCE.findall(text) if kind == "python")
    if re.search(r"to_pandas|to_xarray|import (?:xarray|duckdb|pandas)", code):
        assert "[notebook]'`" in text


def test_there_are_five_of_them_and_each_has_code():
    assert {"first_run", "data_sheet", "own_log", "campaign", "link"} <= {page.stem for page in TUTORIALS}
    for page in TUTORIALS:
        assert {"sh", "python"} <= {kind for kind, _ in FENCE.findall(page.read_text(encoding="utf-8"))}
