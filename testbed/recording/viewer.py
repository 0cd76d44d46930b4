"""Opening a recording: in the viewer's window, or without a display for pictures."""

from __future__ import annotations

import contextlib
import importlib.util
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import IO, TYPE_CHECKING

from testbed.errors import RunError, ScenarioError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from rerun.experimental import ViewerClient

RECORDING = "recording.rrd"
START_TIMEOUT = 30.0  # s; it takes less than one on an idle machine
TOASTS = 4.5  # s; messages lie over the top right corner for this long after the start
DRAW_TIMEOUT = 45.0  # s


def open_viewer(run_dir: Path) -> int:
    """Show the recording of a run in the viewer and wait until its window is closed.

    The viewer listens on the loopback interface only and sends no usage data.

    Parameters
    ----------
    run_dir : Path
        Run folder.

    Returns
    -------
    int
        Exit status of the viewer.

    Raises
    ------
    RunError
        If the folder has no recording or the machine no display.
    """
    recording = _recording_of(run_dir)
    _require_display(str(recording), "copy the file to a machine that has one and run `rerun recording.rrd` there")
    with _process([str(recording), "--new", "--bind", "127.0.0.1"], None) as viewer:
        return viewer.wait()


@contextlib.contextmanager
def live_window() -> Iterator[tuple[str, subprocess.Popen[bytes]]]:
    """Open an empty window and yield its address, to which a recording may be sent, and its process.

    It listens on the loopback interface only and sends no usage data.

    Raises
    ------
    RunError
        If the machine has no display, or the viewer does not start.
    """
    _require_display("--live", "run without it, and look at the recording on a machine that has one")
    port = _free_port()
    with _process(["--bind", "127.0.0.1", "--port", str(port)], None) as viewer:
        deadline = time.monotonic() + START_TIMEOUT
        while not _listens(port):
            if viewer.poll() is not None or time.monotonic() > deadline:
                msg = f"--live: the viewer's window did not open (status {viewer.poll()})"
                raise RunError(msg)
            time.sleep(0.05)
        yield f"rerun+http://127.0.0.1:{port}/proxy", viewer


def _listens(port: int) -> bool:
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


def _require_display(subject: str, remedy: str) -> None:
    if sys.platform.startswith("linux") and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        msg = f"{subject}: expected a display to show it on (DISPLAY and WAYLAND_DISPLAY are unset); {remedy}"
        raise RunError(msg)


def screenshot(recording: Path, picture: Path, *, at: float, size: tuple[int, int] = (1600, 900)) -> None:
    """Draw a recording as the viewer shows it and save it as PNG, without a display.

    Parameters
    ----------
    recording : Path
        Recording (.rrd).
    picture : Path
        PNG to be written, one pixel per point.
    at : float
        Place of the time cursor [s].
    size : tuple of int
        Width and height of the window in points.

    Raises
    ------
    RunError
        If the viewer does not start (no Vulkan driver), does not open the file, or reports an error in a view.
    """
    with headless_viewer(size) as client:
        started = time.monotonic()
        show(client, recording, at)
        time.sleep(max(0.0, TOASTS - (time.monotonic() - started)))
        picture.write_bytes(settled_picture(client, client.take_screenshot))
        errors = [f"{v.name}: {r.summary}" for v in client.get_state().views for r in v.reports]
        if errors:
            msg = f"{recording}: the viewer reports {'; '.join(errors)}"
            raise RunError(msg)


@contextlib.contextmanager
def headless_viewer(size: tuple[int, int] = (1600, 900)) -> Iterator[ViewerClient]:
    """Run a viewer without a display and yield its client; the whole process group ends with the block.

    Parameters
    ----------
    size : tuple of int
        Width and height of the window in points.

    Raises
    ------
    RunError
        If it does not start, with what it said.
    """
    port = _free_port()
    options = ["--headless", "--hide-welcome-screen", "--bind", "127.0.0.1", "--port", str(port)]
    options += ["--window-size", f"{size[0]}x{size[1]}"]
    with tempfile.TemporaryFile() as log, _process(options, log) as viewer:
        client = _connect(viewer, port)
        if client is None:
            log.seek(0)
            msg = f"the headless viewer did not start (it needs a Vulkan driver): {_said(log.read())}"
            raise RunError(msg)
        yield client


def show(client: ViewerClient, recording: Path, at: float) -> None:
    """Open a recording in a running viewer and put the time cursor there.

    Parameters
    ----------
    client : ViewerClient
        The viewer.
    recording : Path
        Recording (.rrd).
    at : float
        Place of the time cursor [s].

    Raises
    ------
    RunError
        If the viewer does not open it.
    """
    opened = client.open(str(recording.resolve()))
    if not opened.store_ids:
        said = [entry.message for entry in client.get_logs() if entry.level == "ERROR"]
        msg = f"{recording}: the viewer could not open it: {'; '.join(said) or 'no reason given'}"
        raise RunError(msg)
    client.set_time("sim_time", duration=at, play_state="paused")


def settled_picture(client: ViewerClient, take: Callable[[], bytes]) -> bytes:
    """Return a PNG of a viewer once three in a row are equal.

    Parameters
    ----------
    client : ViewerClient
        The viewer.
    take : callable
        Takes a picture of it, or of one of its views.

    Raises
    ------
    RunError
        If the picture is still changing after 45 s.
    """
    last: Sequence[bytes] = ()
    deadline = time.monotonic() + DRAW_TIMEOUT
    while time.monotonic() < deadline:
        # Before it is painted for the first time a view is unknown to the viewer.
        with contextlib.suppress(ConnectionError):
            last = [*last[-2:], take()]
        if len(last) == 3 and last[0] == last[1] == last[2] and not client.get_state().loading:
            return last[0]
        time.sleep(0.2)
    msg = f"the viewer was still drawing after {DRAW_TIMEOUT:g} s"
    raise RunError(msg)


def _recording_of(run_dir: Path) -> Path:
    recording = Path(run_dir) / RECORDING
    if not recording.is_file():
        msg = f"{run_dir}: expected a run folder with {RECORDING}; make one with `testbed run SCENARIO.yaml`"
        raise ScenarioError(msg)
    return recording


def _program() -> Path:
    # The console script is a Python shim that would leave the viewer behind when killed; this is the viewer itself.
    package = importlib.util.find_spec("rerun_cli")
    if package is None or package.origin is None:
        msg = "the package rerun-sdk, which contains the viewer, is not installed"
        raise RunError(msg)
    return Path(package.origin).parent / ("rerun.exe" if sys.platform == "win32" else "rerun")


def _environment() -> dict[str, str]:
    # The viewer knows no option against usage statistics, but it collects none where CI is set; this leaves the
    # user's own configuration of it alone.
    environment = {key: value for key, value in os.environ.items() if key != "FORCE_RERUN_ANALYTICS"}
    return environment | {"CI": "true", "RUST_LOG": os.environ.get("RUST_LOG", "error")}


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@contextlib.contextmanager
def _process(options: Sequence[str], log: IO[bytes] | None) -> Iterator[subprocess.Popen[bytes]]:
    """Run the viewer for as long as the block; what it leaves behind when it is killed goes with its own TMPDIR."""
    with tempfile.TemporaryDirectory(prefix="testbed-viewer-") as folder:
        command, environment = [str(_program()), *options], _environment() | {"TMPDIR": folder}
        viewer = subprocess.Popen(command, env=environment, stdout=log, stderr=log, start_new_session=True)
        try:
            yield viewer
        finally:
            _kill(viewer)


def _connect(viewer: subprocess.Popen[bytes], port: int) -> ViewerClient | None:
    """Return the client once the viewer draws, or None if it does not: it listens before it has looked for a driver."""
    from rerun.experimental import ViewerClient

    deadline = time.monotonic() + START_TIMEOUT
    while viewer.poll() is None and time.monotonic() < deadline:
        with contextlib.suppress(OSError):
            client = ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy")
            client.take_screenshot(max_size=16)
            return client
        time.sleep(0.05)
    return None


def _kill(viewer: subprocess.Popen[bytes]) -> None:
    if sys.platform == "win32":
        viewer.kill()
    else:
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(viewer.pid, signal.SIGKILL)
    viewer.wait()


def _said(log: bytes) -> str:
    before_trace = log.decode(errors="replace").split("stack backtrace", maxsplit=1)[0]
    lines = [line.strip() for line in before_trace.splitlines() if line.strip()]
    return " / ".join(lines[-3:]) or "it said nothing"
