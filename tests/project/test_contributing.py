"""The recipes of CONTRIBUTING.md, done to the letter in a copy of the project."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
BLOCK = re.compile(r"^```(sh|python|yaml|html)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
EDIT = re.compile(r"^(?:#|<!--) (\S+), (?:(above|below): (.*?)|new)(?: -->)?\n", re.MULTILINE)


def recipes() -> dict[str, list[tuple[str, str]]]:
    """Return language and text of the blocks of each recipe, by its heading."""
    head, *parts = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8").split("\n## ")
    assert "run by `tests/project/test_contributing.py`" in head
    return {part.split("\n")[0]: BLOCK.findall(part) for part in parts}


def copy_of_the_project(folder: Path) -> Path:
    for name in ("testbed", "tests", "examples", "scenarios"):
        # With the compiled kernels, which know their source by its time.
        shutil.copytree(ROOT / name, folder / name)
    for name in ("pyproject.toml", "README.md"):
        shutil.copy2(ROOT / name, folder / name)
    return folder


def edit(project: Path, text: str) -> None:
    """Write a block where its first line says: into a new file, or above or below the one line that begins so."""
    path, place, anchor = EDIT.match(text).groups()
    if place is None:
        (project / path).write_text(EDIT.sub("", text, count=1), encoding="utf-8")
        return
    lines = (project / path).read_text(encoding="utf-8").split("\n")
    (at,) = [i for i, line in enumerate(lines) if line.strip().startswith(anchor)]
    at += place == "below"
    lines[at:at] = EDIT.sub("", text, count=1).rstrip("\n").split("\n")
    (project / path).write_text("\n".join(lines), encoding="utf-8")


@pytest.mark.slow
@pytest.mark.parametrize("recipe", recipes())
def test_recipe_works_as_it_is_written(recipe, tmp_path):
    project = copy_of_the_project(tmp_path)
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    for language, text in recipes()[recipe]:
        if language == "sh":
            done = subprocess.run(
                ["bash", "-e", "-c", text],
                cwd=project,
                env={**os.environ, "PYTHONPATH": str(project), "PATH": path},
                capture_output=True,
                text=True,
                check=False,
            )
            assert done.returncode == 0, f"{text}{done.stdout}{done.stderr}"
        else:
            edit(project, text)
