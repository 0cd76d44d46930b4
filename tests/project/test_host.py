"""What a public host and a citing author read: it says what the project itself says."""

from __future__ import annotations

import tomllib
from pathlib import Path

from ruamel.yaml import YAML

import testbed

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def read(path: str):
    return YAML(typ="safe", pure=True).load((ROOT / path).read_text(encoding="utf-8"))


def test_the_citation_is_of_this_version():
    citation = read("CITATION.cff")
    assert citation["version"] == testbed.__version__
    assert citation["license"] == PROJECT["license"]
    assert set(citation["keywords"]) == set(PROJECT["keywords"])
    assert citation["cff-version"] == "1.2.0"
    assert all(paper["authors"] and paper["title"] for paper in citation["references"])


def test_pre_commit_runs_what_make_lint_runs():
    (repository,) = read(".pre-commit-config.yaml")["repos"]
    assert repository["repo"] == "local"
    recipe = (ROOT / "Makefile").read_text(encoding="utf-8").split("\nlint:")[1].split("\n\n")[0]
    commands = [line.strip().replace("$(BIN)", ".venv/bin") for line in recipe.splitlines()[1:]]
    assert [hook["entry"] for hook in repository["hooks"]] == [command.removesuffix(" .") for command in commands]


def test_the_workflow_tests_every_promised_python():
    workflow = read(".github/workflows/test.yml")
    least = PROJECT["requires-python"].removeprefix(">=")
    for job in workflow["jobs"].values():
        assert job["strategy"]["matrix"]["python"][0] == least
    assert {"run": ".ci/run"} in workflow["jobs"]["linux"]["steps"]
    assert "untried" in workflow["jobs"]["untried"]["name"]
