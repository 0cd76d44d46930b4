"""Tutorials and recipes: what they need, and Octave; test_blocks.py types them."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

import testbed

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
