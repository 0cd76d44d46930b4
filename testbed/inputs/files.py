"""Regular files of bounded size."""

from __future__ import annotations

import os
import stat
from pathlib import Path
from typing import TYPE_CHECKING, Any

from testbed.errors import Problem, ScenarioError, shortened_path

if TYPE_CHECKING:
    from collections.abc import Mapping


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
            found = os.fstat(stream.fileno())
            # What the kernel makes up is regular and has no length: reading may wait for what it has to say.
            regular = stat.S_ISREG(found.st_mode)
            content = stream.read(min(most + 1, found.st_size)) if regular else None
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else error
        raise ScenarioError([Problem(f"cannot be read: {reason}", file=shortened_path(path))]) from error
    if content is None:
        raise ScenarioError([Problem(f"expected {what} in a regular file, got a device or a pipe", file=str(path))])
    if len(content) > most:
        raise ScenarioError([Problem(f"expected {what} of at most {most} bytes, got more", file=str(path))])
    return content


def beside_scenario(path: Path, context: Mapping[str, Any]) -> Path:
    """Return a path that a scenario names, relative to the scenario's folder and not to where the command is typed.

    Parameters
    ----------
    path : Path
        As it stands there.
    context : mapping
        Of the validation: `folder` of the scenario, nothing for one that Python gives; `allow_outside`.

    Raises
    ------
    ValueError
        If it leads out of that folder and may not, or is no path.
    """
    if not context.get("folder"):
        return path
    folder = Path(context["folder"]).resolve()
    try:
        place = (folder / path).resolve()
    except (OSError, ValueError, RuntimeError) as error:
        msg = "expected a path"
        raise ValueError(msg) from error
    if not place.is_relative_to(folder) and not context.get("allow_outside"):
        msg = "expected a file in the scenario's folder; --allow-outside (allow_outside=True) lets it read others"
        raise ValueError(msg)
    return place
