"""What `testbed check` prints: departures from the presets, what follows from them, what the run takes, doubts."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from testbed.cli.console import ruled, terminal
from testbed.cli.sights import aim_words
from testbed.cli.understood import doubts, print_facts, print_sheets
from testbed.fusion.coloured import slow_noise
from testbed.scenario.departures import departures
from testbed.scenario.peaks import played

if TYPE_CHECKING:
    from testbed.chain.forecast import Forecast
    from testbed.judging.table_facts import TableFacts
    from testbed.scenario.model import Scenario


def size_document(size: Forecast) -> dict[str, Any]:
    """Return what a run will take, as `--json` says it.

    Parameters
    ----------
    size : Forecast
        Of the run.
    """
    document = asdict(size)
    del document["step"]
    return document


def size_words(size: Forecast) -> str:
    """Return what a run will take, in words.

    Parameters
    ----------
    size : Forecast
        Of the run.
    """
    room = f"{size.memory_bytes / 1e6:.0f} MB of memory, {size.disk_bytes / 1e6:.3g} MB of disk"
    return f"{size.samples} samples, about {_time(size.seconds)} on a free core, {room}"


def warnings(scenario: Scenario) -> list[str]:
    """Return what may be wrong with a scenario that is valid.

    Parameters
    ----------
    scenario : Scenario
        The scenario.
    """
    seen, whole = played(scenario), scenario.n_time
    windows = []
    if seen < whole:
        base = scenario.base_rate_hz
        shown = f"{seen / base:.3g} s in windows spread over {whole / base:g} s"
        windows = [f"motion: peaks of rate and torque and the stroke are those of {shown}"]
    return [*doubts(scenario), *windows]


def print_page(scenario: Scenario, facts: TableFacts, size: Forecast) -> None:
    """Print a page that reads: departures from the presets, data sheets, the turntable, what the run takes.

    Parameters
    ----------
    scenario : Scenario
        The scenario.
    facts : TableFacts
        Of its turntable.
    size : Forecast
        Of its run.
    """
    console, frame = terminal(), scenario.frame
    console.print(f"{scenario.name}: {scenario.file}", soft_wrap=True)
    if frame.description:
        console.print(frame.description, soft_wrap=True)
    begin = f"filters from {frame.fusion_from:g} s on, " if frame.fusion_from else ""
    console.print(
        f"{frame.duration:g} s at {scenario.base_rate_hz:g} Hz, {begin}metrics from {frame.settle:g} s on, "
        f"seed {frame.seed}: {size_words(size)}",
        soft_wrap=True,
    )
    for i, entry in enumerate(scenario.source.get("motion") or []):
        (kind, given), *_ = entry.items()
        words = ", ".join(f"{key} {_short(value)}" for key, value in (given or {}).items())
        console.print(f"motion {i + 1}: {kind} {words}", soft_wrap=True)
    _print_departures(scenario)
    print_sheets(console, scenario)
    print_facts(console, facts, scenario.rate_unit)
    if scenario.pointing is not None:
        console.print(f"pointing: {aim_words(scenario)}", soft_wrap=True, highlight=False)
    for line in slow_noise_lines(scenario):
        console.print(line, soft_wrap=True)
    console.print("The scenario is valid; --all shows every key.")


def slow_noise_lines(scenario: Scenario) -> list[str]:
    """Return, per sensor and fit, how many states carry its slow noise, how well, and in which filters.

    Parameters
    ----------
    scenario : Scenario
        The scenario.
    """
    users: dict[str, list[str]] = {}
    for name, spec in scenario.fusion.items():
        carried = spec.belief if getattr(spec.parameters, "coloured", False) else {}
        for sensor, belief in carried.items():
            noise = slow_noise(belief)
            if noise.size:
                words = f"slow noise of {sensor}: {noise.size} states, within {noise.error_db:.2g} dB of its density"
                users.setdefault(words, []).append(name)
    return [f"{words} ({', '.join(names)})" for words, names in users.items()]


def _print_departures(scenario: Scenario) -> None:
    console = terminal()
    table = ruled("part", "preset", "key", "here", "preset says", title="what differs from the presets")
    for part in departures(scenario):
        name, preset = part["part"], part["preset"] or "-"
        rows = part["differs"] or [{"key": "nothing", "here": None, "preset": None}]
        for row in rows:
            table.add_row(name, preset, row["key"], row["here"] or "-", row["preset"] or "-")
            name = preset = ""
    console.print(table)


def _short(value: Any) -> str:
    text = str(value)
    return text if len(text) <= 80 else f"{text[:77]}..."


def _time(seconds: float) -> str:
    if seconds < 120.0:
        return f"{seconds:.2g} s"
    return f"{seconds / 60.0:.2g} min" if seconds < 7200.0 else f"{seconds / 3600.0:.3g} h"
