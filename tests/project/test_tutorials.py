"""Tutorials and recipes: everything that they tell to type works, in that order, in one empty folder."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
TUTORIALS = sorted(ROOT.glob("docs/tutorials/*.md"))
PAGES = [
    *TUTORIALS,
    ROOT / "docs" / "howto.md",
    ROOT / "docs" / "replay.md",
    ROOT / "docs" / "reference" / "run_folder.md",
]
FENCE = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


@pytest.mark.slow
@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.stem)
def test_what_it_tells_to_type_works(page, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scenarios").symlink_to(ROOT / "scenarios")
    known = {}
    for kind, text in FENCE.findall(page.read_text(encoding="utf-8")):
        if kind == "yaml":
            name = text.split(maxsplit=2)[1]
            (tmp_path / name).write_text(text, encoding="utf-8")
        elif kind == "sh":
            commands(text)
        elif kind == "python":
            exec(compile(text, str(page), "exec"), known)  # noqa: S102 - a page of this repository
    said = capsys.readouterr().out
    print(said)
    assert "nan" not in said


def commands(text):
    for line in text.splitlines():
        word, *arguments = shlex.split(line)
        # What installs is tried by whoever clones the repository.
        if word != "make":
            assert word == "testbed"
            command = [sys.executable, "-m", "testbed", *arguments]
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            assert done.returncode == 0, f"{line}\n{done.stderr}"


def test_there_are_three_of_them_and_each_has_code():
    assert {"first_run", "data_sheet", "own_log"} <= {page.stem for page in TUTORIALS}
    for page in TUTORIALS:
        assert {"sh", "python"} <= {kind for kind, _ in FENCE.findall(page.read_text(encoding="utf-8"))}
