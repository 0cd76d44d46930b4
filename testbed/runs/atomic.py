"""Files and folders that appear whole or not at all, also when the machine stops."""

from __future__ import annotations

import ctypes
import errno
import os
from typing import TYPE_CHECKING, Any

from testbed.runs.leftovers import beside

if TYPE_CHECKING:
    from pathlib import Path

_EXCHANGE = 2  # RENAME_EXCHANGE of Linux and RENAME_SWAP of macOS have the same value
_HERE = -100  # AT_FDCWD
# What a system call answers that the kernel, or the file system, does not have.
_MISSING = {errno.ENOSYS, errno.EINVAL, errno.ENOTSUP, errno.EOPNOTSUPP}


def write_text(path: Path, text: str) -> None:
    """Write a text file in UTF-8 whole or not at all."""
    write_bytes(path, text.encode())


def write_bytes(path: Path, content: bytes) -> None:
    """Write a file whole or not at all; a link goes on pointing to it."""
    place = path.resolve()
    with beside(place) as partial:
        partial.write_bytes(content)
        _sync(partial)
        partial.replace(place)
    _sync(place.parent)


def put(new: Path, place: Path) -> None:
    """Put the folder `new` at `place` in one step; what stood there is `new` then.

    Where the file system cannot exchange two folders, what stood there is moved to ``old`` beside `new` first: for a
    moment there is nothing at `place`, and `testbed.runs.leftovers.heal` mends a death in that moment.
    """
    try:
        new.rename(place)  # nothing there, or an empty folder
    except OSError as error:
        if error.errno not in {errno.ENOTEMPTY, errno.EEXIST}:
            raise
        if not exchange(new, place):
            place.rename(new.with_name("old"))
            new.rename(place)
    _sync(place.parent)


def exchange(one: Path, other: Path) -> bool:
    """Exchange two folders or files in one step; False where the system or the file system cannot."""
    libc: Any = ctypes.CDLL(None, use_errno=True) if os.name == "posix" else None
    a, b = os.fsencode(one), os.fsencode(other)
    if hasattr(libc, "renameat2"):
        failed = libc.renameat2(_HERE, a, _HERE, b, _EXCHANGE)
    elif hasattr(libc, "renamex_np"):
        failed = libc.renamex_np(a, b, _EXCHANGE)
    else:
        return False
    code = ctypes.get_errno()
    if failed and code not in _MISSING:
        raise OSError(code, os.strerror(code), str(other))
    return not failed


def sync_tree(folder: Path) -> None:
    """Make sure that a folder, and everything in it, is on the disk."""
    for root, _, names in os.walk(folder, topdown=False):
        for name in names:
            _sync(os.path.join(root, name))  # noqa: PTH118 - as os.walk gives them
        _sync(root)


def _sync(path: str | Path) -> None:
    if os.name != "posix":  # a folder cannot be opened there
        return
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
