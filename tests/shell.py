"""The command line for tests: in this process, where the libraries are loaded, or in one of its own where that counts.

A new interpreter takes seconds of a core before it says a word: `spawn` is for what only a process has, such as limits
and signals, `call` for all else.
"""

from __future__ import annotations

import contextlib
import io
import signal
import subprocess
import sys
from typing import TYPE_CHECKING, Any
from unittest import mock

from testbed.cli import main

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

Said = subprocess.CompletedProcess[str]


def call(*arguments: object, cwd: str | Path, encoding: str = "utf-8") -> Said:
    """Return what the shell would see of ``testbed ARGUMENTS`` in a folder, said by this process."""
    words = ["testbed", *map(str, arguments)]
    out, error = (io.TextIOWrapper(io.BytesIO(), encoding=encoding, write_through=True) for _ in range(2))
    status: Any = 0
    with (
        contextlib.chdir(cwd),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(error),
        mock.patch.object(sys, "argv", words),
        signals_kept(),
    ):
        try:
            main()
        except SystemExit as end:
            status = end.code or 0
    said, complained = (stream.buffer.getvalue().decode(encoding) for stream in (out, error))
    return subprocess.CompletedProcess(words, status, said, complained)


def spawn(*arguments: object, cwd: str | Path, **options: Any) -> Said:
    """Return the same of a process of its own."""
    words = [sys.executable, "-m", "testbed", *map(str, arguments)]
    return subprocess.run(words, cwd=cwd, capture_output=True, text=True, timeout=240, check=False, **options)


def assert_clear(result: Said, status: int) -> None:
    """One message on standard error, the status of the contract, no traceback."""
    assert result.returncode == status, result.stderr
    assert result.stderr.strip()
    assert "Traceback" not in result.stderr


@contextlib.contextmanager
def signals_kept() -> Iterator[None]:
    """Put the handlers back that the command line replaces."""
    kept = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in kept.items():
            signal.signal(number, handler)
