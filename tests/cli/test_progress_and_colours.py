"""The remaining time is that of the simulation, and what compiles does not count."""

from __future__ import annotations

import re

import pytest

from testbed.cli import progress as module
from testbed.cli.progress import Pace, progress


class Clock:
    def __init__(self):
        self.now = 100.0

    def __call__(self):
        return self.now


@pytest.mark.parametrize("compiling", [0.0, 3.0, 60.0])
@pytest.mark.parametrize("of_a_block", [0.02, 1.0, 30.0])
def test_the_first_estimate_is_within_a_factor_of_two_whatever_compiling_took(
    monkeypatch, capsys, compiling, of_a_block
):
    """Twenty blocks of a second that take from 0.7 to 1.3 of their mean, the compilation before the first one."""
    clock = Clock()
    monkeypatch.setattr(module.time, "monotonic", clock)
    lengths = [of_a_block * (0.7 + 0.6 * ((7 * k) % 11) / 10) for k in range(20)]
    with progress("run", 20.0) as tick:
        clock.now += compiling
        for k, length in enumerate(lengths, 1):
            clock.now += length
            tick(float(k))
    lines = capsys.readouterr().err.splitlines()
    first = re.search(r"run: (\d+) of 20 s, .* x real time, (\d+) s of simulation remaining", lines[0])
    done, estimate = int(first[1]), float(first[2])
    truly = sum(lengths[done:])
    # Whole seconds are printed.
    assert truly / 2 - 0.5 <= estimate <= 2 * truly + 0.5
    assert lines[-1].endswith("writing recording and report")


def test_the_first_block_says_nothing_of_the_pace():
    clock = Clock()
    pace = Pace(clock)
    clock.now += 50.0
    assert pace.note(1.0) is None
    clock.now += 0.5
    assert pace.note(2.0) == pytest.approx(2.0)


def test_a_run_of_one_block_has_no_pace_and_one_line(capsys):
    with progress("short", 0.5) as tick:
        tick(0.5)
    assert capsys.readouterr().err == "short: 0 of 0.5 s, writing recording and report\n"


def test_the_terminal_writes_a_name_in_the_colour_of_its_signal(monkeypatch):
    from rich.console import Console

    from testbed.cli.terminal import _print_errors
    from testbed.pages.palette import color_of, rgb

    monkeypatch.delenv("NO_COLOR", raising=False)
    console = Console(force_terminal=True, color_system="truecolor", width=100, record=True)
    with console.capture() as captured:
        _print_errors(console, ("", "RMSE"), [[["fusion/wideband", "0.1"]], [["sensors/fog", "0.2"]]])
    for key, name in (("fusion/wideband", "wideband"), ("sensors/fog", "fog")):
        red, green, blue = rgb(color_of(key))
        assert f"38;2;{red};{green};{blue}m{name}" in captured.get()
