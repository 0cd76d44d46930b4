"""The last words of a fault of ours: one line, and a file with the rest to send with the report of it."""

from __future__ import annotations

import os
import platform
import sys
import tempfile
import traceback
from importlib import metadata
from pathlib import Path

from testbed._version import __version__

_LIBRARIES = ("mujoco", "numpy", "scipy", "numba", "pydantic", "rerun-sdk", "h5py", "typer")
_LONGEST = 200


def describe(error: BaseException) -> str:
    """Return the line that tells of `error`, and write the full report.

    Parameters
    ----------
    error : BaseException
        As it was caught.

    Returns
    -------
    str
        What, where, and the place of the report; the report itself where no file can be written.
    """
    report = _report(error)
    frames = traceback.extract_tb(error.__traceback__)
    where = f" in {Path(frames[-1].filename).name}, line {frames[-1].lineno}" if frames else ""
    said = " ".join(str(error).split())[:_LONGEST]
    what = f"{type(error).__name__}{where}: {said}; this is a fault of testbed"
    try:
        handle, name = tempfile.mkstemp(prefix="testbed-error-", suffix=".txt")
        with os.fdopen(handle, "w", encoding="utf-8", errors="backslashreplace") as stream:
            stream.write(report)
    except OSError as trouble:
        return f"{what} (no file could be written for it: {trouble})\n{report}"
    return f"{what}; full report: {name}"


def _report(error: BaseException) -> str:
    libraries = ", ".join(f"{name} {_version(name)}" for name in _LIBRARIES)
    lines = [
        f"testbed {__version__}, Python {platform.python_version()}, {platform.platform()}",
        libraries,
        f"called as {sys.argv!r} in {Path.cwd()}",
        "",
        *traceback.format_exception(error),
    ]
    return "\n".join(lines)


def _version(name: str) -> str:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return "missing"
