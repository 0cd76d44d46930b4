"""The changelog: one file per change, which towncrier joins at a release."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import testbed

ROOT = Path(__file__).parents[2]
TYPES = [
    kind["directory"] for kind in tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["towncrier"]["type"]
]
FRAGMENTS = sorted(path for path in (ROOT / "changes").iterdir() if path.name not in ("template.md", "README.md"))


def draft(folder: Path) -> str:
    """Return what a release from the folder's `changes/` would add."""
    command = [sys.executable, "-m", "towncrier", "build", "--draft", "--version", testbed.__version__]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True).stdout


def test_every_fragment_is_named_by_issue_slug_and_type():
    shape = re.compile(rf"\d+\.[a-z0-9_-]+\.({'|'.join(TYPES)})\.md")
    assert not [path.name for path in FRAGMENTS if not shape.fullmatch(path.name)]


def test_a_release_says_what_every_fragment_says():
    said = " ".join(draft(ROOT).split())
    for path in FRAGMENTS:
        assert " ".join(path.read_text(encoding="utf-8").split()) in said, path.name


def test_a_fragment_of_each_type_has_a_heading(tmp_path):
    (tmp_path / "pyproject.toml").write_bytes((ROOT / "pyproject.toml").read_bytes())
    (tmp_path / "changes").mkdir()
    (tmp_path / "changes" / "template.md").write_bytes((ROOT / "changes" / "template.md").read_bytes())
    for kind in TYPES:
        (tmp_path / "changes" / f"10.slug.{kind}.md").write_text(f"What a user sees of a {kind}.\n")
    text = draft(tmp_path)
    assert re.findall(r"^### \w+\n\n- What a user sees of a (\w+)\.\n", text, flags=re.MULTILINE) == TYPES
