"""A scenario key by key: as written, and as understood in SI."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from testbed.cli.console import ruled, terminal
from testbed.cli.terminal import step_words
from testbed.runs.table import rate_text, shown_in
from testbed.scenario.peaks import command_peaks

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rich.console import Console

    from testbed.judging.table_facts import TableFacts
    from testbed.scenario.model import Scenario
    from testbed.sensors.data_sheet import Step
    from testbed.units import RateUnit


def understood(scenario: Scenario) -> dict[str, dict[str, str]]:
    """Return every key that has a value, by its dotted name: what was `written`, and what it means in `si`."""
    written = {key: f"{_text(value)} (preset)" for key, value in _leaves(dict(scenario.presets))}
    written |= {key: _text(value) for key, value in _leaves(dict(scenario.source))}
    return {
        key: {"written": written.get(key, ""), "si": _text(value)}
        for key, value in _leaves(scenario.resolved())
        if value not in ("", None)
    }


def translations(scenario: Scenario) -> dict[str, list[Step]]:
    """Return, for each sensor that is given in the words of a data sheet, what they became."""
    steps = {
        name: type(sensor).sheet(scenario.presets["sensors"][name], border=True).steps
        for name, sensor in scenario.sensors.items()
    }
    return {name: found for name, found in steps.items() if found}


def doubts(scenario: Scenario) -> list[str]:
    """Return what does not fit together in the sensors, or between them and the motion, by name."""
    found = [f"{name}: {doubt}" for name, sensor in scenario.sensors.items() for doubt in sensor.doubts()]
    peaks = command_peaks(scenario)
    moved = [
        f"{name}: {doubt}"
        for name, sensor in scenario.sensors.items()
        for doubt in sensor.beyond(peaks.rate, peaks.stroke)
    ]
    return [*found, *moved]


def scenario_document(scenario: Scenario, facts: TableFacts) -> dict[str, Any]:
    """Return what `testbed check` tells a program."""
    return {
        "scenario": scenario.name,
        "file": str(scenario.file),
        "keys": understood(scenario),
        "translations": {name: [asdict(step) for step in steps] for name, steps in translations(scenario).items()},
        "doubts": doubts(scenario),
        "datasheets": {name: dict(sensor.datasheet()) for name, sensor in scenario.sensors.items()},
        "turntable": facts.summary(),
    }


def print_scenario(scenario: Scenario, facts: TableFacts) -> None:
    """Print every key of a scenario: as written, and in SI; then what the turntable will be asked for."""
    console = terminal()
    keys = ruled("key", "as written", "understood (SI)", title=f"{scenario.name}: {scenario.file}")
    for key, value in understood(scenario).items():
        keys.add_row(key, value["written"], value["si"])
    console.print(keys)
    print_sheets(console, scenario)
    print_facts(console, facts, scenario.rate_unit)
    console.print("The scenario is valid.")


def print_sheets(console: Console, scenario: Scenario) -> None:
    """Print what the words of data sheets became, and what each sensor is in those words.

    Parameters
    ----------
    console : Console
        Where to.
    scenario : Scenario
        Whose sensors.
    """
    for name, steps in translations(scenario).items():
        words = ruled("data sheet", "as written", "rule", "becomes", title=f"{name}: translated")
        for step in steps:
            words.add_row(step.key, step.written, step.rule, step.becomes)
        console.print(words)
    for name, sensor in scenario.sensors.items():
        if rows := sensor.datasheet():
            sheet = ruled("quantity", "value", title=f"{name}: in data-sheet units")
            for row in rows:
                sheet.add_row(*row)
            console.print(sheet)


def print_facts(console: Console, facts: TableFacts, unit: RateUnit) -> None:
    """Print what is known of the turntable before the run.

    Parameters
    ----------
    console : Console
        Where to.
    facts : TableFacts
        What is known.
    unit : str
        In which rates are shown.
    """
    modes = [f"{f:.4g} Hz ({z:.2g})" for f, z in zip(facts.freq_hz, facts.damping, strict=True)]
    torque = f"required torque {facts.required_torque:.4g} N m"
    if facts.torque_limit is not None:
        used = facts.required_torque / facts.torque_limit
        torque += f" of {facts.torque_limit:.4g} N m, margin {100 * (1 - used):.0f} %"
    noise = f"arithmetic noise of the truth {rate_text(math.degrees(facts.truth_noise), shown_in(unit))} rms"
    step = step_words(facts.step.engine, facts.step.step, facts.step.holds / facts.step.substeps, facts.step.error)
    for line in (f"coupled modes (damping): {', '.join(modes)}" if modes else "", torque, noise, step):
        if line:
            console.print(f"turntable: {line}", soft_wrap=True)


def _text(value: Any) -> str:
    return (", ".join(map(str, value)) or "none") if isinstance(value, list) else str(value)


def _leaves(node: Any, prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Yield (dotted key, value) of every scalar, lists of scalars kept whole."""
    if isinstance(node, dict):
        for key, value in node.items():
            yield from _leaves(value, f"{prefix}.{key}" if prefix else str(key))
    elif isinstance(node, list) and any(isinstance(item, dict) for item in node):
        for i, value in enumerate(node):
            yield from _leaves(value, f"{prefix}.{i}")
    else:
        yield prefix, node
