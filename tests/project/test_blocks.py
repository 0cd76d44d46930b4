"""Every block of every page works: commands, Python and files, in the order in which they stand."""

from __future__ import annotations

import os
import re
import subprocess
import sys

import pytest

from tests.project.blocks import FENCE, PAGES, ROOT, Reader, blocks
from tests.project.given import LONG, SAID, given

# CONTRIBUTING.md edits the project: test_contributing.py follows it in a copy.
TRIED = [page for page in PAGES if blocks(page) and page.stem != "CONTRIBUTING"]
SLOW = {"first_run", "campaign", "link", "data_sheet", "run_folder", "replay", "identify", "noise_and_allan", "audit"}
SLOW |= {"campaigns", "howto"}


@pytest.mark.parametrize(
    "page", [pytest.param(page, id=page.stem, marks=[pytest.mark.slow] * (page.stem in SLOW)) for page in TRIED]
)
def test_what_it_shows_works(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    reader = Reader(tmp_path, given(page.stem, tmp_path))
    for kind, text in blocks(page):
        reader.follow(kind, text)
    print(reader.said)
    assert not re.search(r"\bnan\b", reader.said)
    for printed, sentence in SAID.get(page.stem, {}).items():
        (found,) = re.findall(printed, reader.said, re.MULTILINE)
        wanted = sentence(*([found] if isinstance(found, str) else found))
        assert wanted in " ".join(page.read_text(encoding="utf-8").split())


def test_what_is_left_out_stands_on_a_page_and_is_tested_where_it_says():
    typed = "".join(text for page in TRIED for kind, text in blocks(page) if kind == "sh")
    assert [line for line in LONG if line not in typed] == []
    places = {place for reason in LONG.values() for place in re.findall(r"tests/[\w/.]+", reason)}
    assert [place for place in places if not (ROOT / place).exists()] == []
    assert all("tests/" in reason for reason in LONG.values())


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.stem)
def test_no_code_is_hidden_in_an_indent(page):
    """A paragraph that begins with four blanks is shown as code too, and nobody would try it."""
    outside = FENCE.sub("", page.read_text(encoding="utf-8"))
    assert re.findall(r"\n\n( {4}[a-z].*)", outside) == []


@pytest.mark.slow
def test_the_snippet_for_slurm_asks_for_its_jobs(tmp_path, monkeypatch):
    pytest.importorskip("dask_jobqueue", reason="dask-jobqueue is not installed: the snippet is compiled only")
    for name, does in (("sbatch", f'cat "$1" > {tmp_path}/job.$$; echo "Submitted batch job $$"'), ("scancel", "true")):
        (tmp_path / name).write_text(f"#!/bin/sh\n{does}\n", encoding="utf-8")
        (tmp_path / name).chmod(0o755)
    (text,) = (text for _, text in blocks(ROOT / "docs" / "campaigns.md") if "SLURMCluster" in text)
    program = f"{text}\nimport time\ntime.sleep(5)\ncluster.close()\n"
    path = f"{tmp_path}{os.pathsep}{os.environ['PATH']}"
    subprocess.run([sys.executable, "-c", program], env={**os.environ, "PATH": path}, check=True, timeout=60)
    assert len(list(tmp_path.glob("job.*"))) == 100
    assert "-t 08:00:00" in next(tmp_path.glob("job.*")).read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("kind", "text"),
    [
        ("", "testbed list"),
        ("sh", "testbed check no_such.yaml"),
        ("sh", "make no_such_target"),
        ("sh", "rm -r /tmp/any"),
        ("console", "$ testbed list papers --quiet\nnothing\n"),
        ("python", "import testbed\ntestbed.no_such_name"),
        ("pycon", ">>> 1 + 1\n3\n"),
        ("yaml", "fusion: {kalmann: {}}"),
    ],
)
def test_a_mistake_is_found(kind, text, tmp_path):
    with pytest.raises((AssertionError, AttributeError, ValueError)):
        Reader(tmp_path).follow(kind, text)
