"""The short form of the fuzz: some hundred cases of each kind, the same ones in every run."""

from __future__ import annotations

import pytest

from tests.fuzz.cases import KINDS, case
from tests.fuzz.play import fairly, play
from tests.fuzz.texts import BASES, VALID


@pytest.mark.property
@pytest.mark.parametrize("kind", KINDS)
def test_no_case_raises_hangs_or_swells(tmp_path, kind):
    for seed in range(100):
        result = fairly(kind, case(kind, seed), tmp_path / "case.yaml")
        assert not result.fault, f"{kind} {seed}: {result.fault}"


@pytest.mark.parametrize("base", range(len(BASES)))
def test_what_is_mutated_is_valid(tmp_path, base):
    assert play("tree", BASES[base], tmp_path / "case.yaml").outcome == "accepted"


@pytest.mark.parametrize("kind", VALID)
def test_the_document_that_is_mutated_is_valid(tmp_path, kind):
    result = play(kind, VALID[kind], tmp_path / "case.yaml", 120.0)
    assert result.outcome == "accepted", result


def test_a_planted_fault_is_seen(tmp_path, monkeypatch):
    """A check that raises, one that echoes its input, and one that takes too long."""
    from testbed.errors import ScenarioError
    from tests.fuzz import play as module

    def raises(_path):
        raise KeyError

    def echoes(_path):
        raise ScenarioError("got " + "x" * 200)

    def sleeps(_path):
        while True:
            pass

    for planted, outcome in ((raises, "raised"), (echoes, "refused"), (sleeps, "hung")):
        monkeypatch.setitem(module.PLAYED, "text", planted)
        result = play("text", "name: a", tmp_path / "case.yaml", seconds=0.2)
        assert result.outcome == outcome
        assert result.fault
