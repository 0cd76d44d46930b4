"""What the command line prints of a run: its errors, its claims, its turntable."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from rich.table import Table
from rich.text import Text

from testbed.cli.console import terminal
from testbed.cli.sights import print_sights
from testbed.pages.numbers import bounded
from testbed.pages.palette import color_of
from testbed.runs.table import HEADINGS, NOTHING, error_cells, error_title, error_unit, number, rate_text, ratio_text

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from pathlib import Path

    from rich.console import Console

    from testbed.runs.metrics import Budget, LineMetrics, RunMetrics, SourceMetrics, TurntableMetrics

# Columns of the terminal: errors of a filter beside its name, and gain, phase and error over optimum of one line.
_TABLE_WIDTH, _LINE_WIDTH = 61, 46
# What a run folder may hold, what is looked at first in front.
_FILES = ("report.html", "recording.rrd", "run.nc", "metrics.json", "scenario.yaml", "manifest.json")


def print_metrics(metrics: RunMetrics, folder: Path) -> None:
    """Print the table of errors, the expectations and what was written."""
    console = terminal()
    unit = error_unit(metrics)
    lines = metrics.line_freq_hz
    # With many lines, or on a narrow terminal, the table would not fit: the report has them all.
    longest = max(map(len, metrics.sources), default=0)
    width = _TABLE_WIDTH + longest + _LINE_WIDTH * len(lines)
    shown = lines if len(lines) <= 4 and console.width >= width else []
    optimum = any(line.optimum_deg_s for source in metrics.fusion.values() for line in source.lines or [])
    what = "gain, phase, x opt." if optimum else "gain, phase"
    headings = ("", *HEADINGS, *(f"{line:g} Hz {what}" for line in shown))
    rows = [
        [
            [f"{kind}/{name}", *error_cells(source, unit[1]), *_line_cells(source, shown)]
            for name, source in found.items()
        ]
        for kind, found in (("sensors", metrics.sensors), ("fusion", metrics.fusion))
    ]
    # Not the table's own title, which would be folded to a narrow table's width.
    console.print(error_title(metrics), soft_wrap=True, style="italic")
    _print_errors(console, headings, rows)
    for name, source in metrics.sensors.items():
        if source.missing:
            console.print(f"{name}: {source.missing} readings lost")
    for words in _start_and_gates(metrics):
        console.print(words, soft_wrap=True, highlight=False)
    _print_bounds(console, metrics, unit)
    _print_budget(console, metrics.budget, unit)
    _print_beliefs(console, metrics.fusion)
    _print_claims(console, metrics.fusion)
    _print_table(console, metrics.turntable, unit)
    print_sights(console, metrics.pointing)
    for bound in metrics.expectations:
        verdict = Text("met", "green") if bound.met else Text("MISSED", "red")
        console.print(f"expected {bound.subject} {bound.metric} {bound.bound}: {number(bound.value)}", verdict)
    # Which of them there are, the outputs say that were asked for.
    written = [name for name in _FILES if (folder / name).is_file()]
    console.print(f"wrote {folder}: {', '.join(written)}", soft_wrap=True)


def _start_and_gates(metrics: RunMetrics) -> Iterator[str]:
    """Yield what the filters knew of the start, and what their front part struck out."""
    rests = "the table rests" if metrics.replay is None else "all rests"
    for start, words in (("rest", f"knew that {rests} at t = 0"), ("unknown", "knew nothing of the start")):
        if names := [name for name, source in metrics.fusion.items() if source.start == start]:
            yield f"start: {', '.join(names)} {words}"
    for name, source in metrics.fusion.items():
        if source.caution:
            yield f"{name}: {source.caution}"
        if gated := {sensor: n for sensor, n in (source.gated or {}).items() if n}:
            yield f"{name}: struck out {', '.join(f'{n} readings of {sensor}' for sensor, n in gated.items())}"


def _print_errors(console: Console, headings: Sequence[str], rows: Sequence[list[list[str]]]) -> None:
    """Print the columns that have a value, a line under each kind of source, names in the colour of their signal."""
    cells = [row for kind in rows for row in kind]
    table = Table()
    kept = [0, *([i for i in range(1, len(headings)) if any(row[i] != NOTHING for row in cells)] or [1])]
    for i in kept:
        table.add_column(headings[i], justify="right" if i else "left", no_wrap=True)
    for kind in rows:
        for row in kind:
            name = Text(row[0].split("/", maxsplit=1)[1], style=color_of(row[0]))
            table.add_row(name, *(row[i] for i in kept[1:]), end_section=row is kind[-1])
    console.print(table)


def _print_beliefs(console: Console, fusion: Mapping[str, SourceMetrics]) -> None:
    """Print what the filters were told of the sensors, those of one belief together."""
    for belief in dict.fromkeys(source.belief for source in fusion.values()):
        names = [name for name, source in fusion.items() if source.belief == belief]
        console.print(f"belief of {', '.join(names)}: {belief}", soft_wrap=True)


def _print_claims(console: Console, fusion: Mapping[str, SourceMetrics]) -> None:
    """Print the verdict on each filter's claims about itself."""
    claims = {name: source.consistency for name, source in fusion.items() if source.consistency is not None}
    words = [
        f"{name} {claim.verdict}" + ("" if claim.nees is None else f" (NEES {number(claim.nees)})")
        for name, claim in claims.items()
        if claim.verdict is not None
    ]
    if words:
        meaning = (
            "by the innovations alone, since there is no reference"
            if all(claim.nees is None for claim in claims.values())
            else "NEES: mean of error squared over the variance that the filter claims, 1 if the claim holds"
        )
        console.print(f"claims: {', '.join(words)}; {meaning}", soft_wrap=True)


def _print_table(console: Console, table: TurntableMetrics | None, unit: tuple[str, float]) -> None:
    """Print how the turntable did."""
    if table is None:
        return
    followed = ", ".join(
        f"{name} {rate_text(rms, unit)} rms{_gain(lines)}"
        for name, rms, lines in (
            ("encoder", table.command_to_encoder_rms_deg_s, table.command_to_encoder_lines),
            ("inertial", table.command_to_inertial_rms_deg_s, table.command_to_inertial_lines),
        )
    )
    torque = f"peak torque {number(table.peak_torque_nm)} N m"
    if table.torque_limit_nm is not None and table.torque_margin is not None:
        torque += f" of {number(table.torque_limit_nm)} N m, margin {100 * table.torque_margin:.0f} %"
    noise = f"arithmetic noise of the truth {rate_text(table.truth_noise_deg_s, unit)}"
    step = step_words(table.engine, table.step_s, table.step_factor, table.step_error)
    console.print(f"turntable: command to {followed}; {torque}; {noise}; {step}", soft_wrap=True)


def step_words(engine: str | None, step: float | None, factor: float | None, error: float | None) -> str:
    """Return how the plant is integrated, in words; lengths in s."""
    if step is None or factor is None:
        return "integration step unknown"
    measured = "" if error is None else f", error {error:.1e} of the largest rate against MuJoCo at 50 us"
    if engine == "modal":
        return f"played by its modes, exact over each hold of {1e6 * step:g} us{measured}"
    length = f"{step:g} s" if step >= 1.0 else f"{1e6 * step:g} us"
    return f"integration step {length}, {factor:g} times the hold{measured}"


def _gain(lines: Sequence[LineMetrics]) -> str:
    """Return the line that is followed worst, in words."""
    known = [(abs(line.gain - 1.0), line) for line in lines if line.gain is not None]
    if not known:
        return ""
    _, worst = max(known, key=lambda pair: pair[0])
    change = f"{100 * ((worst.gain or 0.0) - 1.0):+.2g} %, {worst.phase_deg:+.2g} deg"
    return f" ({change} at {number(worst.frequency_hz)} Hz)"


def _line_cells(source: SourceMetrics, shown: Sequence[float]) -> list[str]:
    """Return gain, phase and error over optimum of each line that is shown."""
    lines = {line.frequency_hz: line for line in source.lines or []}
    return [_line_cell(lines[freq]) if freq in lines else NOTHING for freq in shown]


def _line_cell(line: LineMetrics) -> str:
    if line.gain is None:
        return NOTHING
    over = f", {ratio_text(line.error_deg_s / line.optimum_deg_s)}" if line.error_deg_s and line.optimum_deg_s else ""
    lost = line.phase_ci95_deg is not None and line.phase_ci95_deg >= 90.0
    phase = "phase lost" if lost else f"{bounded(line.phase_deg, line.phase_ci95_deg)} deg"
    return f"{bounded(line.gain, line.gain_ci95)}, {phase}{over}".replace("−", "-")


def _print_bounds(console: Console, metrics: RunMetrics, unit: tuple[str, float]) -> None:
    """Print what nothing gets below, or why there is nothing."""
    for source in [*metrics.fusion.values()][:1]:
        bounds = {
            "floor": source.floor_rmse_deg_s,
            "floor with the prior": source.prior_floor_rmse_deg_s,
            "optimum over this run": source.optimum_rmse_deg_s,
            "settled": source.optimum_settled_deg_s,
        }
        known = ", ".join(f"{name} {rate_text(value, unit)}" for name, value in bounds.items() if value is not None)
        reason = f"none {'else ' if known else ''}since {metrics.bounds_reason}" if metrics.bounds_reason else ""
        console.print(f"bounds: {'; '.join(filter(None, (known, reason)))}", soft_wrap=True, highlight=False)


def _print_budget(console: Console, budget: Budget | None, unit: tuple[str, float]) -> None:
    """Print in one line which sensor makes the noise floor, and where the better sensor changes."""
    if budget is None:
        return
    parts = []
    for name in budget.densities:
        variance = [band.sensors_deg_s[name] ** 2 for band in budget.bands]
        most = budget.bands[variance.index(max(variance))]
        whole = rate_text(math.sqrt(sum(variance)), unit)
        parts.append(f"{name} {whole} (most at {most.low_hz:g}-{most.high_hz:g} Hz)")
    crossed = ", ".join(number(freq) for freq in budget.crossovers_hz)
    where = f"crossover {crossed} Hz; " if crossed else ""
    console.print(f"noise floor: {where}{', '.join(parts)}", soft_wrap=True)
