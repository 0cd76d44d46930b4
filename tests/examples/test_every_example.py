"""Every program in examples/ is run by a test: those that no other test runs are run here, on little."""

from __future__ import annotations

import re
import sys
from functools import partial
from pathlib import Path

import pytest

from tests.examples.programs import EXAMPLES, example

TESTS = Path(__file__).parents[1]


def first(mapping, count=1):
    """Return the first entries of a mapping."""
    return dict(list(mapping.items())[:count])


# What makes a program small: new values of its globals by what it has; its arguments; a word of what it then prints.
SMALL = {
    "baselines": (
        lambda _its: {"SHORT": (1, 2.0, ("0.5 Hz",)), "COMPARED": ("kalman", "complementary")},
        [],
        "x optimum",
    ),
    "frequency_indicator": (
        lambda its: {
            "SIGNALS": first(its.SIGNALS),
            "AMPLITUDES": first(its.AMPLITUDES),
            "SWEEP_HZ": its.SWEEP_HZ[-2:],
            "LINES_HZ": its.LINES_HZ[-1:],
            "WINDOWS": its.WINDOWS[:1],
            "RECORDS": 1,
            "NOISIER": its.NOISIER[-1:],
        },
        ["figure.png"],
        "wrote figure.png",
    ),
    "fog_compensators": (
        lambda its: {
            "MODELS": {"gradient": ("gradient", None, ("paper, 1",))},
            "TRUTHS": first(its.TRUTHS),
            "UNSEEN": its.UNSEEN[2:4],
            "PERIODS": its.PERIODS[:1],  # without --full no searches; tests/compensation has them
        },
        [],
        "gain of an injected rate",
    ),
    "replay_with_faults": (lambda _its: {}, [], "sign -1 put right"),
    "identify_paper2": (lambda _its: {}, [], "largest error"),
    "mode_groups": (
        lambda its: {"SEEDS": range(2), "record": partial(its.record, 4000)},
        [],
        "single modes move by",
    ),
}


def test_each_is_named_by_a_test():
    tests = "".join(path.read_text("utf-8") for path in TESTS.rglob("test_*.py"))
    names = [path.stem for path in sorted(EXAMPLES.glob("*.py"))]
    assert len(names) > 15
    assert [name for name in names if not re.search(rf"\b{name}\b", tests)] == []


@pytest.mark.slow
@pytest.mark.parametrize("name", SMALL)
def test_it_prints_what_it_promises(name, monkeypatch, tmp_path, capsys):
    program, (smaller, words, said) = example(name), SMALL[name]
    for key, value in smaller(program).items():
        monkeypatch.setattr(program, key, value)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", [name, *words])
    program.main()
    assert said in capsys.readouterr().out
