"""Whole or not at all: exchange, its fallback, and what dead processes leave."""

from __future__ import annotations

import os
import signal
import subprocess
import sys

import pytest

from testbed.errors import ScenarioError
from testbed.notebook import open_run
from testbed.runs import atomic
from testbed.runs.atomic import exchange, write_text
from testbed.runs.leftovers import beside, heal
from tests.runs.test_manifest import small_run

pytestmark = pytest.mark.skipif(os.name != "posix", reason="locks and exchanges of POSIX systems")

# Begins a folder or a file, dies where it is told to, and is killed by nobody.
DIES = """\
import os, sys
from pathlib import Path
from testbed.runs import atomic
from testbed.runs.folder import RunFolder
from testbed.runs.leftovers import beside
how, place = sys.argv[1], Path(sys.argv[2])
kept = beside(place) if how == "file" else RunFolder(place)
kept.__enter__()
if how.startswith("after"):
    atomic.exchange = lambda *_: False
    rename, done = Path.rename, []
    def dying(self, target):
        if how == f"after {len(done)} renames":
            os._exit(9)
        done.append(self)
        return rename(self, target)
    (kept.path / "a.txt").write_text("second")
    Path.rename = dying
    kept.finish()
if how == "alive":
    print("ready", flush=True)
    import time; time.sleep(60)
os._exit(9)
"""


def die(how, place):
    assert subprocess.run([sys.executable, "-c", DIES, how, place], check=False).returncode == 9


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def test_exchange_swaps_two_folders(tmp_path):
    for name in "ab":
        (tmp_path / name).mkdir()
        (tmp_path / name / "content").write_text(name)
    if not exchange(tmp_path / "a", tmp_path / "b"):
        pytest.skip("this file system cannot exchange two folders")
    assert (tmp_path / "a" / "content").read_text() == "b"
    assert (tmp_path / "b" / "content").read_text() == "a"
    with pytest.raises(FileNotFoundError):
        exchange(tmp_path / "a", tmp_path / "nothing")


def test_without_exchange_the_earlier_one_is_moved_aside(tmp_path, monkeypatch):
    monkeypatch.setattr(atomic, "exchange", lambda *_: False)
    place = small_run(tmp_path / "run")
    assert (small_run(place, "second") / "a.txt").read_text() == "second"
    assert names(tmp_path) == ["run"]


@pytest.mark.parametrize(("renames", "found"), [(1, None), (2, "second"), (3, "second")])
def test_a_death_while_the_earlier_one_is_aside_is_healed(tmp_path, renames, found):
    """First the rename that meets the earlier folder, then the one that moves it aside, then the one into its place."""
    place = small_run(tmp_path / "run")
    die(f"after {renames} renames", place)
    assert place.exists() == (found is None or renames == 3)
    heal(place)
    assert (place / "a.txt").read_text() == (found or "first")
    small_run(place, "third")
    assert names(tmp_path) == ["run"]


def test_open_run_heals(tmp_path):
    place = small_run(tmp_path / "run")
    die("after 2 renames", place)
    with pytest.raises(ScenarioError, match=r"scenario\.yaml"):  # it is there again, though it is no run
        open_run(place)
    assert names(tmp_path) == ["run"]


@pytest.mark.parametrize("how", ["making", "file"])
def test_what_a_dead_process_left_is_swept_at_the_next_start(tmp_path, how):
    place = tmp_path / "run"
    die(how, place)
    (left,) = names(tmp_path)
    assert left.startswith(".run.")
    (tmp_path / ".run.other.partial").write_text("somebody's own")
    (tmp_path / ".run2.01234567.partial").write_text("of another place")
    small_run(place)
    assert names(tmp_path) == [".run.other.partial", ".run2.01234567.partial", "run"]


def test_what_a_living_process_makes_is_left_alone(tmp_path):
    process = subprocess.Popen([sys.executable, "-c", DIES, "alive", tmp_path / "run"], stdout=subprocess.PIPE)
    assert process.stdout.readline() == b"ready\n"
    small_run(tmp_path / "run", "third")
    assert len(names(tmp_path)) == 2
    process.send_signal(signal.SIGKILL)
    process.communicate()
    small_run(tmp_path / "run", "fourth")
    assert names(tmp_path) == ["run"]


def test_a_link_goes_on_pointing_to_the_run(tmp_path):
    (tmp_path / "disk").mkdir()
    link = tmp_path / "run"
    link.symlink_to("disk/run")
    for text in ("first", "second"):
        small_run(link, text)
        assert link.is_symlink()
        assert (tmp_path / "disk" / "run" / "a.txt").read_text() == text
    assert names(tmp_path / "disk") == ["run"]
    write_text(tmp_path / "file", "first")
    (tmp_path / "other").symlink_to("file")
    write_text(tmp_path / "other", "second")
    assert (tmp_path / "other").is_symlink()
    assert (tmp_path / "file").read_text() == "second"


def test_links_in_a_circle_are_refused(tmp_path):
    (tmp_path / "a").symlink_to("b")
    (tmp_path / "b").symlink_to("a")
    with pytest.raises(ScenarioError, match="is no folder of the testbed"):
        small_run(tmp_path / "a")


def test_new_files_and_folders_have_the_rights_that_the_user_gives(tmp_path):
    mask = os.umask(0o027)
    try:
        small_run(tmp_path / "run")
        write_text(tmp_path / "file", "text")
    finally:
        os.umask(mask)
    assert (tmp_path / "run").stat().st_mode & 0o777 == 0o750
    assert (tmp_path / "file").stat().st_mode & 0o777 == 0o640


def test_many_at_once_leave_one_whole_folder(tmp_path):
    """None takes the moment of another's exchange for somebody's own files: the files are slow to look at here."""
    code = """if True:
        import sys, time
        from pathlib import Path
        from testbed.runs import manifest
        from tests.runs.test_manifest import small_run
        quick = manifest.digest
        manifest.digest = lambda path: (time.sleep(0.01), quick(path))[1]
        for _ in range(8):
            small_run(Path(sys.argv[1]), sys.argv[2])
    """
    command = [sys.executable, "-c", code, tmp_path / "run"]
    writers = [subprocess.Popen([*command, str(i)], stderr=subprocess.PIPE, text=True) for i in range(3)]
    said = [writer.communicate()[1] for writer in writers]
    assert said == ["", "", ""]
    assert [writer.returncode for writer in writers] == [0, 0, 0]
    assert (tmp_path / "run" / "a.txt").read_text() == (tmp_path / "run" / "inner" / "b.txt").read_text()
    assert names(tmp_path) == ["run"]


def test_beside_leaves_nothing_when_it_fails(tmp_path):
    def fail():
        with beside(tmp_path / "a", folder=True) as folder:
            (folder / "b").write_text("b")
            raise KeyError

    with pytest.raises(KeyError):
        fail()
    assert names(tmp_path) == []
