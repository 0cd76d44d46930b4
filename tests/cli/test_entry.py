"""How a command ends: one line and the exit status of the contract, whatever happens and wherever it prints."""

from __future__ import annotations

import os
import pickle
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from testbed.errors import Problem, RunError, ScenarioError, UnknownNameError
from tests.scenes import short_file
from tests.shell import assert_clear, call

# Runs the command line after a piece of it was replaced.
BROKEN = """\
import sys, testbed.cli.app as app
{fault}
app.app.registered_commands.clear()
app.app.command("list")(fail)
app.app.command("other")(lambda: None)
sys.argv = ["testbed", "list"]
from testbed.cli import main
main()
"""


def broken(fault, cwd, **options):
    return subprocess.run(
        [sys.executable, "-c", BROKEN.format(fault=fault)],
        cwd=cwd,
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "TMPDIR": str(cwd)},
        **options,
    )


def test_an_internal_error_ends_with_4_and_one_line_that_names_the_full_report(tmp_path):
    result = broken("def fail():\n    raise KeyError('two\\nlines ' + 'x' * 1000)", tmp_path)
    assert_clear(result, 4)
    (line,) = result.stderr.splitlines()
    assert line.startswith("internal error: KeyError in <string>, line 3:")
    assert len(line) < 500
    report = Path(re.search(r"full report: (\S+)$", line)[1])
    assert report.parent == tmp_path
    text = report.read_text()
    for part in ("Traceback", "KeyError", "testbed 0.", "Python 3.", "numpy ", "called as"):
        assert part in text


def test_an_exit_inside_a_library_is_an_internal_error(tmp_path):
    """An exit that nobody of ours asked for must not pass for success."""
    assert_clear(broken("def fail():\n    sys.exit(0)", tmp_path), 4)


def test_too_little_memory_ends_with_3(tmp_path):
    assert_clear(broken("def fail():\n    raise MemoryError('1 TB')", tmp_path), 3)


def test_without_a_place_for_the_report_it_stands_in_the_output(tmp_path):
    fault = "import tempfile\ndef no(*_, **__):\n    raise OSError('read-only')\ntempfile.mkstemp = no\n"
    result = broken(f"{fault}def fail():\n    raise KeyError('x')", tmp_path)
    assert result.returncode == 4
    assert "no file could be written for it: read-only" in result.stderr
    assert result.stderr.rstrip().endswith("KeyError: 'x'")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no /dev/full")
def test_an_output_that_is_full_ends_with_3(tmp_path):
    with Path("/dev/full").open("w") as full:
        result = subprocess.run(
            [sys.executable, "-m", "testbed", "list"], stdout=full, stderr=subprocess.PIPE, text=True, check=False
        )
    assert result.returncode == 3
    assert result.stderr.splitlines() == ["error: could not be written: [Errno 28] No space left on device"]


def test_a_reader_that_goes_ends_the_command_quietly(tmp_path):
    process = subprocess.Popen(
        [sys.executable, "-m", "testbed", "list"], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    process.stdout.close()
    with process.stderr:
        assert process.stderr.read() == b""
    assert process.wait(60) == 141


@pytest.mark.parametrize("delay", [0, 1, 2, 4, 6, 9])
def test_ctrl_c_while_libraries_load_ends_with_130_and_no_traceback(tmp_path, delay):
    """From where our own code has begun, which is told by what it has loaded, over half a second of imports."""
    code = (
        "import os, sys, threading, time, signal\n"
        f"def kill():\n    time.sleep({0.02 + 0.05 * delay})\n    os.kill(os.getpid(), signal.SIGINT)\n"
        "from testbed.cli import entry\n"
        "install = entry._Stopped.__init__\n"
        "def begin(self):\n    install(self)\n    threading.Thread(target=kill).start()\n"
        "entry._Stopped.__init__ = begin\n"
        f"sys.argv = ['testbed', 'check', {str(short_file(tmp_path))!r}]\n"
        "entry.main()\n"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, cwd=tmp_path)
    assert result.returncode == 130, result.stderr
    assert result.stderr.splitlines() == ["interrupted; nothing was left behind"]


def test_an_interrupt_that_a_library_turns_into_its_own_error_is_an_interrupt(tmp_path):
    fault = (
        "import os, signal\ndef fail():\n    try:\n        os.kill(os.getpid(), signal.SIGINT)\n        "
        "__import__('time').sleep(5)\n    except KeyboardInterrupt as stop:\n        raise ImportError('no') from stop"
    )
    assert_clear(broken(fault, tmp_path), 130)


@pytest.mark.parametrize("encoding", ["ascii", "latin-1", "cp1252", "utf-8"])
def test_any_encoding_of_the_output_does(tmp_path, encoding):
    for arguments in (("list",), ("check", short_file(tmp_path))):
        result = call(*arguments, cwd=tmp_path, encoding=encoding)
        assert result.returncode == 0, result.stderr
        assert result.stderr == ""


def test_a_process_whose_output_has_another_encoding_does(tmp_path):
    environment = {**os.environ, "PYTHONIOENCODING": "ascii", "PYTHONUTF8": "0"}
    command = [sys.executable, "-m", "testbed", "list"]
    result = subprocess.run(command, capture_output=True, check=True, cwd=tmp_path, env=environment)
    assert result.stderr == b""
    assert b"deg/s" in result.stdout


def test_what_the_encoding_lacks_is_said_plainly(tmp_path):
    environment = {**os.environ, "PYTHONIOENCODING": "ascii", "PYTHONUTF8": "0"}
    fault = "def fail():\n    print('deg\\u00b2/s \\u00b5rad \\u221ah \\u2713 \\udcff')"
    result = subprocess.run(
        [sys.executable, "-c", BROKEN.format(fault=fault)], capture_output=True, check=True, env=environment
    )
    assert result.stdout.decode("ascii") == "deg^2/s urad sqrth \\u2713 \\udcff\n"


def test_a_file_name_that_is_no_text_is_refused_with_2(tmp_path):
    result = subprocess.run(
        [sys.executable.encode(), b"-m", b"testbed", b"check", b"\xff.yaml"], capture_output=True, check=False
    )
    assert result.returncode == 2
    assert b"udcff.yaml: cannot be read" in result.stderr


@pytest.mark.parametrize("column", ["²", "٣", "1" * 5000, "-1", "1.0", ""])
def test_a_column_that_is_no_number_of_ours_is_refused_with_the_remedy(tmp_path, column):
    (tmp_path / "log.csv").write_text("".join(f"{i},{i}\n" for i in range(9)))
    result = call("allan", "log.csv", "--column", column, "--unit", "deg/s", "--rate", "1", cwd=tmp_path)
    assert_clear(result, 2)
    assert "--column" in result.stderr
    assert "give a number from 1 on" in result.stderr


@pytest.mark.parametrize(
    "error",
    [
        UnknownNameError("filter", "kalmann", ["kalman", "shakf"]),
        UnknownNameError("filter", "a:B", [], reason="no module"),
        ScenarioError([Problem("expected more", "seed", "a.yaml", 3), Problem("and less")]),
        ScenarioError("one"),
        RunError("diverged at t = 1 s"),
    ],
    ids=lambda error: str(error)[:20],
)
def test_errors_travel_between_processes(error):
    copy = pickle.loads(pickle.dumps(error))
    assert type(copy) is type(error)
    assert str(copy) == str(error)
    assert getattr(copy, "problems", None) == getattr(error, "problems", None)


def test_an_interrupt_in_a_run_still_ends_with_130_after_the_libraries(tmp_path):
    """In the middle of the imports of a whole run, found by the clock."""
    path = short_file(tmp_path, ("duration: 0.5 s", "duration: 600 s"))
    for wait in (0.4, 1.0):
        process = subprocess.Popen(
            [sys.executable, "-m", "testbed", "run", str(path)], cwd=tmp_path, stderr=subprocess.PIPE, text=True
        )
        time.sleep(wait)
        process.send_signal(signal.SIGINT)
        _, error = process.communicate(timeout=60)
        assert process.returncode == 130, error
        assert "Traceback" not in error
        assert not list(tmp_path.glob("runs/*"))


def test_an_interrupted_campaign_says_that_its_runs_are_kept(tmp_path):
    fault = (
        "from testbed.cli.interruption import keeping_runs\n"
        "def fail():\n    with keeping_runs():\n        raise KeyboardInterrupt"
    )
    result = broken(fault, tmp_path)
    assert_clear(result, 130)
    assert "every run that was finished is kept: the same command again goes on from there" in result.stderr
