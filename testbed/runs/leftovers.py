"""What is not finished stands hidden beside its place and is its process's own; what a dead process left is swept."""

from __future__ import annotations

import contextlib
import os
import re
import secrets
import shutil
import sys
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

_NAME = r"\.{}\.[0-9a-f]{{8}}\.partial"


@contextlib.contextmanager
def beside(place: Path, *, folder: bool = False) -> Iterator[Path]:
    """Yield a new hidden file or folder beside `place`, and remove it, or what has come in its stead, in the end.

    It is locked for as long as this process lives, however it ends: what is found unlocked is nobody's.

    Parameters
    ----------
    place : Path
        Absolute, without links.
    folder : bool, optional
        Make a folder.
    """
    with alone_in(place.parent) as alone:
        if alone:
            _sweep(place)
        path = place.with_name(f".{place.name}.{secrets.token_hex(4)}.partial")
        path.mkdir() if folder else path.touch(exist_ok=False)
        lock = _lock(path) if alone else None
    try:
        yield path
    finally:
        _remove(path)
        if lock is not None:
            os.close(lock)


@contextlib.contextmanager
def alone_in(folder: Path) -> Iterator[bool]:
    """Wait until no other process makes, sweeps or exchanges anything in `folder`; False where that cannot be had.

    Not to be asked for again by the one that has it.

    Parameters
    ----------
    folder : Path
        With the places.
    """
    lock = _lock(folder, wait=True)
    try:
        yield lock is not None
    finally:
        if lock is not None:
            os.close(lock)


def heal(place: Path) -> None:
    """Finish what a process left that died, where folders cannot be exchanged, while it replaced `place`."""
    place = Path(os.path.realpath(place))
    if place.exists():
        return
    with alone_in(place.parent) as alone:
        if alone:
            _sweep(place)


def is_partial(name: str, of: str) -> bool:
    """Return whether `name` is that of something unfinished beside `of`."""
    return re.fullmatch(_NAME.format(re.escape(of)), name) is not None


def _sweep(place: Path) -> None:
    """Remove what dead processes left beside `place`; a finished folder that they were putting there is put there."""
    for entry in list(place.parent.iterdir()):
        if is_partial(entry.name, place.name) and (lock := _lock(entry)) is not None:
            if (entry / "old").is_dir() and (entry / "run").is_dir() and not place.exists():
                (entry / "run").rename(place)
            _remove(entry)
            os.close(lock)


def _lock(path: Path, *, wait: bool = False) -> int | None:
    """Return the descriptor that holds the lock of `path`, None if another process has it or there are no locks."""
    if sys.platform == "win32":  # nothing is ever taken for dead there
        return None
    import fcntl

    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_NOFOLLOW)
    except OSError:
        return None
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX if wait else fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(descriptor)
        return None
    return descriptor


def _remove(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        with contextlib.suppress(OSError):
            path.unlink(missing_ok=True)
