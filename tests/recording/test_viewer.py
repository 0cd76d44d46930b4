from __future__ import annotations

import os
import subprocess
import sys

import pytest

from testbed.errors import RunError, ScenarioError
from testbed.recording import viewer
from testbed.recording.viewer import headless_viewer, open_viewer

linux = pytest.mark.skipif(sys.platform != "linux", reason="asks for DISPLAY, /proc or a POSIX shell")


@pytest.fixture
def run_dir(tmp_path):
    (tmp_path / "recording.rrd").write_bytes(b"")
    return tmp_path


def stand_in(tmp_path, monkeypatch, script):
    """Put a shell script in the place of the viewer."""
    program = tmp_path / "viewer.sh"
    program.write_text(f"#!/bin/sh\n{script}\n")
    program.chmod(0o755)
    monkeypatch.setattr(viewer, "_program", lambda: program)


def test_folder_without_recording_is_named_with_the_remedy(tmp_path):
    with pytest.raises(ScenarioError, match=r"expected a run folder with recording\.rrd; make one with `testbed run"):
        open_viewer(tmp_path)


@linux
def test_machine_without_display_is_told_what_to_do(run_dir, monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    with pytest.raises(RunError, match="expected a display"):
        open_viewer(run_dir)


@linux
def test_window_listens_on_loopback_only_and_its_status_is_returned(run_dir, monkeypatch):
    monkeypatch.setenv("DISPLAY", ":99")
    monkeypatch.setenv("FORCE_RERUN_ANALYTICS", "1")
    stand_in(run_dir, monkeypatch, f'echo "$@" "CI=$CI" "FORCE=$FORCE_RERUN_ANALYTICS" > {run_dir}/said; exit 7')
    assert open_viewer(run_dir) == 7
    said = (run_dir / "said").read_text().split()
    assert said[0] == str(run_dir / "recording.rrd")
    assert said[said.index("--bind") + 1] == "127.0.0.1"
    assert said[-2:] == ["CI=true", "FORCE="]


@linux
def test_viewer_that_cannot_start_is_quoted(tmp_path, monkeypatch):
    stand_in(tmp_path, monkeypatch, "echo 'No graphics adapter was found' >&2; exit 102")
    with pytest.raises(RunError, match=r"Vulkan driver\): No graphics adapter was found"), headless_viewer():
        pass


@linux
def test_viewer_collects_no_usage_data_and_leaves_the_users_choice_alone(tmp_path):
    home = {"HOME": str(tmp_path), "XDG_CONFIG_HOME": str(tmp_path / "c"), "XDG_DATA_HOME": str(tmp_path / "d")}
    environment = viewer._environment() | home | {"RUST_LOG": "re_analytics=debug"}
    program = [str(viewer._program()), "rrd", "stats", os.devnull]
    done = subprocess.run(program, env=environment, capture_output=True, text=True, check=False, timeout=60)
    assert "Analytics disabled" in done.stderr
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == []
