"""A run folder holds the motion that it was recorded from: it runs again anywhere, to the same bits."""

from __future__ import annotations

import hashlib
import math
import shutil

import numpy as np
import pytest

import testbed
from testbed.errors import ScenarioError
from testbed.runs.manifest import read_manifest
from testbed.scenario.loader import load_scenario
from tests.scenes import short

RECORDED = "recorded: {file: hall/rate.csv, time: {column: t, unit: s}, rate: {column: w, unit: deg/s}}"


@pytest.fixture(scope="module")
def moved(tmp_path_factory):
    """Return the content of the record and the run folder, elsewhere, when neither scenario nor record are there."""
    folder = tmp_path_factory.mktemp("recorded")
    (folder / "hall").mkdir()
    t = np.arange(1200) / 1000.0
    rows = [f"{time!r},{math.sin(20 * time)!r}" for time in t.tolist()]
    record = folder / "hall" / "rate.csv"
    record.write_text("\n".join(["t,w", *rows]) + "\n")
    edit = ("sine: {frequency: 10 Hz, rate: 1 deg/s}", RECORDED)
    run = testbed.run(short(folder, edit), out=folder / "run")
    content, rate = record.read_bytes(), np.array(run.fusion["arw_shakf"].rate)
    shutil.rmtree(folder / "hall")
    elsewhere = tmp_path_factory.mktemp("elsewhere") / "run"
    shutil.move(folder / "run", elsewhere)
    return content, rate, elsewhere


def test_the_record_is_in_the_folder_and_its_hash_in_the_scenario(moved):
    content, _, folder = moved
    sha256 = hashlib.sha256(content).hexdigest()
    assert (folder / "motion_0.csv").read_bytes() == content
    assert read_manifest(folder)["files"]["motion_0.csv"] == {"sha256": sha256, "bytes": len(content)}
    text = (folder / "scenario.yaml").read_text()
    assert "file: motion_0.csv" in text
    assert f"sha256: {sha256}" in text


def test_it_runs_again_from_the_folder_alone_to_the_same_bits(moved, tmp_path):
    _, rate, folder = moved
    again = testbed.run(load_scenario(folder / "scenario.yaml"), out=tmp_path / "again")
    assert np.array_equal(again.fusion["arw_shakf"].rate, rate)
    assert (tmp_path / "again" / "motion_0.csv").is_file()


def test_a_record_that_has_changed_since_is_refused(moved, tmp_path):
    _, _, folder = moved
    copy = shutil.copytree(folder, tmp_path / "copy")
    with (copy / "motion_0.csv").open("a") as stream:
        stream.write("1.2,0.0\n")
    with pytest.raises(ScenarioError, match=r"motion_0\.csv: expected the file whose SHA-256 is [0-9a-f]{64}, got"):
        load_scenario(copy / "scenario.yaml")
