"""The versions that a result depends on."""

from __future__ import annotations

import platform
from importlib import metadata

from testbed._version import __version__

_LIBRARIES = ("mujoco", "numpy", "scipy", "numba", "rerun-sdk")


def versions() -> dict[str, str]:
    """Return the versions that a result depends on."""
    return {
        "testbed": __version__,
        "python": platform.python_version(),
        **{name: metadata.version(name) for name in _LIBRARIES},
    }
