"""Generated source as a module whose compiled code is kept: in the user's cache folder, named by its content."""

from __future__ import annotations

import hashlib
import importlib.util
import os
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import platformdirs

if TYPE_CHECKING:
    from types import ModuleType

_PREFIX = "testbed_generated_"


def module_of(source: str) -> ModuleType:
    """Return the module that a source makes; a second process finds what the first compiled.

    Numba keeps compiled code beside the file of a module that can be found by its name, so the file is there and the
    module is known before the source is run. The folder belongs to the user alone; where it cannot be had, this
    process has one of its own, and compiles each time.

    Parameters
    ----------
    source : str
        Python.
    """
    name = _PREFIX + hashlib.sha256(source.encode()).hexdigest()[:32]
    if name in sys.modules:
        return sys.modules[name]
    path = _folder() / f"{name}.py"
    if not path.is_file() or path.read_text(encoding="utf-8") != source:
        _put(path, source)
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    try:
        spec.loader.exec_module(module)
    except BaseException:
        # Interrupted, it is not there: who asks again shall not find the first half of it.
        del sys.modules[name]
        raise
    return module


def _folder() -> Path:
    """Return a folder that nobody else can write to."""
    folder = platformdirs.user_cache_path("testbed") / "kernels"
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        folder.chmod(0o700)
        if os.access(folder, os.W_OK) and (not hasattr(os, "getuid") or folder.stat().st_uid == os.getuid()):
            return folder
    except OSError:
        pass
    return Path(tempfile.mkdtemp(prefix=_PREFIX))


def _put(path: Path, source: str) -> None:
    """Write a file in one step: another process sees all of it or nothing."""
    handle, partial = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    with os.fdopen(handle, "w", encoding="utf-8") as stream:
        stream.write(source)
    Path(partial).replace(path)
