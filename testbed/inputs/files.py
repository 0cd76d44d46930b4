"""Regular files of bounded size."""

from __future__ import annotations

import os
import stat
from typing import TYPE_CHECKING

from testbed.errors import Problem, ScenarioError, shortened_path

if TYPE_CHECKING:
    from pathlib import Path


def read_bytes(path: Path, most: int, what: str) -> bytes:
    """Return the content of a regular file of at most `most` bytes.

    Parameters
    ----------
    path : Path
        The file; a device, a pipe or a socket is refused without waiting for it.
    most : int
        Largest size [byte].
    what : str
        What it should be, for the message, such as ``a scenario``.

    Raises
    ------
    ScenarioError
        If it cannot be read, is no regular file or too large.
    """
    try:
        # Not blocking: opening a pipe would wait for its other end.
        handle = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK)
        with os.fdopen(handle, "rb") as stream:
            mode = os.fstat(stream.fileno()).st_mode
            content = stream.read(most + 1) if stat.S_ISREG(mode) else None
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else error
        raise ScenarioError([Problem(f"cannot be read: {reason}", file=shortened_path(path))]) from error
    if content is None:
        raise ScenarioError([Problem(f"expected {what} in a regular file, got a device or a pipe", file=str(path))])
    if len(content) > most:
        raise ScenarioError([Problem(f"expected {what} of at most {most} bytes, got more", file=str(path))])
    return content
