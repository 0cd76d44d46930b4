"""manifest.json: every file by its SHA-256, and a rerun that replaces nothing else."""

from __future__ import annotations

import hashlib
import json

import pytest

import testbed
from testbed.errors import RunError, ScenarioError
from testbed.notebook import open_run
from testbed.report import write_report
from testbed.runs.folder import RunFolder
from testbed.runs.manifest import read_manifest, rewrite, strangers
from tests.scenes import short


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    folder = tmp_path_factory.mktemp("manifest")
    return short(folder), testbed.run(short(folder), out=folder / "run").folder


def small_run(place, text="first"):
    """Put a folder with a manifest there that holds one file and one below another folder."""
    with RunFolder(place) as folder:
        (folder.path / "a.txt").write_text(text)
        (folder.path / "inner").mkdir()
        (folder.path / "inner" / "b.txt").write_text(text)
        folder.finish({"versions": {"testbed": "0"}})
    return place


def test_the_manifest_lists_every_file_with_its_hash_and_the_versions(stored):
    _, folder = stored
    manifest = json.loads((folder / "manifest.json").read_text())
    files = {path.name: path.read_bytes() for path in folder.iterdir() if path.name != "manifest.json"}
    assert manifest["files"] == {
        name: {"sha256": hashlib.sha256(content).hexdigest(), "bytes": len(content)} for name, content in files.items()
    }
    assert manifest["versions"]["testbed"] == testbed.__version__


@pytest.mark.parametrize(
    ("spoil", "named"),
    [
        (lambda f: (f / "notes.txt").write_text("mine"), "notes.txt"),
        (lambda f: (f / "a.txt").write_text("changed"), "a.txt"),
        (lambda f: (f / "inner" / "c.txt").write_text("mine"), "inner/c.txt"),
        (lambda f: (f / "figures").mkdir(), "figures"),
        (lambda f: (f / "link").symlink_to("/"), "link"),
        (lambda f: (f / ".hidden").write_text("mine"), ".hidden"),
        (lambda f: (f / "manifest.json").write_text("{}"), "no manifest.json"),
        (lambda f: (f / "manifest.json").write_text("[" * 100_000), "no manifest.json"),
    ],
    ids=["unknown", "changed", "below", "folder", "link", "hidden", "empty manifest", "hostile manifest"],
)
def test_a_rerun_is_refused_before_it_begins_where_anything_else_lies(tmp_path, spoil, named):
    place = small_run(tmp_path / "run")
    spoil(place)
    before = sorted(path.name for path in place.rglob("*"))
    with pytest.raises(ScenarioError, match=named), RunFolder(place):
        raise AssertionError
    assert sorted(path.name for path in place.rglob("*")) == before
    assert [path.name for path in tmp_path.iterdir()] == ["run"]


def test_a_missing_file_and_what_a_file_browser_leaves_are_no_obstacle(tmp_path):
    place = small_run(tmp_path / "run")
    (place / "a.txt").unlink()
    (place / ".DS_Store").write_text("")
    assert (small_run(place, "second") / "a.txt").read_text() == "second"


def test_a_refused_run_simulates_nothing(stored, tmp_path, monkeypatch):
    monkeypatch.setattr("testbed.chain.runner.simulate", None)
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(ScenarioError, match=r"no folder of the testbed \(it has no manifest"):
        testbed.run(stored[0], out=tmp_path)


def test_a_stranger_that_comes_while_it_runs_is_kept_and_so_is_the_run(tmp_path):
    place = small_run(tmp_path / "run")
    with RunFolder(place) as folder:
        (place / "notes.txt").write_text("mine")
        (folder.path / "a.txt").write_text("second")
        with pytest.raises(RunError, match=r"notes.txt, since the run began; the finished run is in .*run\.2"):
            folder.finish()
    assert (place / "notes.txt").read_text() == "mine"
    assert (place / "a.txt").read_text() == "first"
    assert (tmp_path / "run.2" / "a.txt").read_text() == "second"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["run", "run.2"]


def test_the_manifest_follows_a_report_that_is_written_again(stored):
    scenario, folder = stored
    before = read_manifest(folder)["files"]["report.html"]["sha256"]
    write_report(folder)
    entry = read_manifest(folder)["files"]["report.html"]
    assert strangers(folder) == []
    assert entry["replaces"] == before
    (folder / "mine.txt").write_text("mine")
    write_report(folder)
    assert strangers(folder) == ["mine.txt"]
    (folder / "mine.txt").unlink()
    testbed.run(scenario, out=folder, seed=5)
    assert open_run(folder).metrics["seed"] == 5


def test_a_death_between_manifest_and_file_leaves_both_valid(tmp_path, monkeypatch):
    place = small_run(tmp_path / "run")

    def die(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("testbed.runs.manifest.write_bytes", die)
    with pytest.raises(KeyboardInterrupt):
        rewrite(place, "a.txt", b"second")
    assert strangers(place) == []
    monkeypatch.undo()
    rewrite(place, "a.txt", b"third")
    assert strangers(place) == []
    assert (place / "a.txt").read_text() == "third"


def test_a_folder_without_manifest_may_have_its_report_written_again(tmp_path):
    rewrite(tmp_path, "a.txt", b"text")
    assert [path.name for path in tmp_path.iterdir()] == ["a.txt"]
