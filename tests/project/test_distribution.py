"""The source distribution: what the repository has, nothing less."""

from __future__ import annotations

import subprocess
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
# hatchling adds these by itself, and git's own file says nothing outside of git.
OF_ITS_OWN = {"pyproject.toml", ".gitignore"}


def test_it_holds_everything_that_the_repository_does():
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=False)
    if listed.returncode:
        pytest.skip("no repository")
    tracked = {Path(name).parts[0] for name in listed.stdout.splitlines()}
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["hatch"]["build"]
    assert tracked - OF_ITS_OWN == set(settings["targets"]["sdist"]["include"])
