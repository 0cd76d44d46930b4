"""What the command line prints: tables, and the understood scenario."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from rich.console import Console
from rich.table import Table
from rich.text import Text

from testbed.cli.understood import understood
from testbed.runs.table import HEADINGS, NOTHING, error_cells, error_title, error_unit, number

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from testbed.judging.allan_analysis import Analysis, Term
    from testbed.judging.table_facts import TableFacts
    from testbed.runs.metrics import Budget, LineMetrics, RunMetrics, SourceMetrics, TurntableMetrics
    from testbed.scenario.model import Scenario

# Columns of the terminal: errors of a filter beside its name, and gain, phase and error over optimum of one line.
_TABLE_WIDTH, _LINE_WIDTH = 61, 31


def _console() -> Console:
    console = Console()
    # Without a terminal there is no width to respect: a log keeps whole lines.
    return console if console.is_terminal else Console(width=180)


def print_metrics(metrics: RunMetrics, folder: Path) -> None:
    """Print the table of errors, the expectations and what was written."""
    console = _console()
    _, scale = error_unit(metrics)
    lines = metrics.line_freq_hz
    # With many lines, or on a narrow terminal, the table would not fit: the report has them all.
    longest = max(map(len, metrics.sources), default=0)
    width = _TABLE_WIDTH + longest + _LINE_WIDTH * len(lines)
    shown = lines if len(lines) <= 4 and console.width >= width else []
    headings = ("", *HEADINGS, *(f"{line:g} Hz gain, phase, x opt." for line in shown))
    rows = [
        [[name, *error_cells(source, scale), *_line_cells(source, shown)] for name, source in kind.items()]
        for kind in (metrics.sensors, metrics.fusion)
    ]
    # Not the table's own title, which would be folded to a narrow table's width.
    console.print(f"[italic]{error_title(metrics)}[/italic]", soft_wrap=True, highlight=False)
    _print_errors(console, headings, rows)
    for name, source in metrics.sensors.items():
        if source.missing:
            console.print(f"{name}: {source.missing} readings lost")
    _print_bounds(console, metrics)
    _print_budget(console, metrics.budget)
    _print_beliefs(console, metrics.fusion)
    _print_claims(console, metrics.fusion)
    _print_table(console, metrics.turntable)
    for bound in metrics.expectations:
        verdict = "[green]met[/green]" if bound.met else "[red]MISSED[/red]"
        console.print(f"expected {bound.subject} {bound.metric} {bound.bound}: {number(bound.value)} {verdict}")
    console.print(f"wrote {folder}: report.html, recording.rrd, run.nc, metrics.json, scenario.yaml", soft_wrap=True)


def _print_errors(console: Console, headings: Sequence[str], rows: Sequence[list[list[str]]]) -> None:
    """Print the columns that have a value, a line under each kind of source."""
    cells = [row for kind in rows for row in kind]
    table = Table()
    kept = [i for i in range(len(headings)) if i < 2 or any(row[i] != NOTHING for row in cells)]
    for i in kept:
        table.add_column(headings[i], justify="right" if i else "left", no_wrap=True)
    for kind in rows:
        for row in kind:
            table.add_row(*(row[i] for i in kept), end_section=row is kind[-1])
    console.print(table)


def _print_beliefs(console: Console, fusion: Mapping[str, SourceMetrics]) -> None:
    """Print what the filters were told of the sensors, those of one belief together."""
    for belief in dict.fromkeys(source.belief for source in fusion.values()):
        names = [name for name, source in fusion.items() if source.belief == belief]
        console.print(f"belief of {', '.join(names)}: {belief}", soft_wrap=True, highlight=False)


def _print_claims(console: Console, fusion: Mapping[str, SourceMetrics]) -> None:
    """Print the verdict on each filter's claims about itself."""
    claims = {name: source.consistency for name, source in fusion.items() if source.consistency is not None}
    words = [
        f"{name} {claim.verdict} (NEES {number(claim.nees)})"
        for name, claim in claims.items()
        if claim.verdict is not None
    ]
    if words:
        console.print(f"claims: {', '.join(words)}", soft_wrap=True, highlight=False)


def _print_table(console: Console, table: TurntableMetrics | None) -> None:
    """Print how the turntable did."""
    if table is None:
        return
    followed = ", ".join(
        f"{name} {number(rms)} deg/s rms{_gain(lines)}"
        for name, rms, lines in (
            ("encoder", table.command_to_encoder_rms_deg_s, table.command_to_encoder_lines),
            ("inertial", table.command_to_inertial_rms_deg_s, table.command_to_inertial_lines),
        )
    )
    torque = f"peak torque {number(table.peak_torque_nm)} N m"
    if table.torque_limit_nm is not None and table.torque_margin is not None:
        torque += f" of {number(table.torque_limit_nm)} N m, margin {100 * table.torque_margin:.0f} %"
    noise = f"arithmetic noise of the truth {number(table.truth_noise_deg_s)} deg/s"
    step = _step(table.engine, table.step_s, table.step_factor, table.step_error)
    console.print(f"turntable: command to {followed}; {torque}; {noise}; {step}", soft_wrap=True, highlight=False)


def _step(engine: str | None, step: float | None, factor: float | None, error: float | None) -> str:
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
    over = f", {line.error_deg_s / line.optimum_deg_s:.1f}" if line.error_deg_s and line.optimum_deg_s else ""
    return f"{line.gain:.4f}, {line.phase_deg:+.2f} deg{over}"


def _print_bounds(console: Console, metrics: RunMetrics) -> None:
    """Print what nothing gets below, or why there is nothing."""
    for source in [*metrics.fusion.values()][:1]:
        bounds = {
            "floor": source.floor_rmse_deg_s,
            "floor with the prior": source.prior_floor_rmse_deg_s,
            "optimum over this run": source.optimum_rmse_deg_s,
            "settled": source.optimum_settled_deg_s,
        }
        known = ", ".join(f"{name} {number(value)} deg/s" for name, value in bounds.items() if value is not None)
        reason = f"none {'else ' if known else ''}since {metrics.bounds_reason}" if metrics.bounds_reason else ""
        console.print(f"bounds: {'; '.join(filter(None, (known, reason)))}", soft_wrap=True, highlight=False)


def _print_budget(console: Console, budget: Budget | None) -> None:
    """Print in one line which sensor makes the noise floor, and where the better sensor changes."""
    if budget is None:
        return
    parts = []
    for name in budget.densities:
        variance = [band.sensors_deg_s[name] ** 2 for band in budget.bands]
        most = budget.bands[variance.index(max(variance))]
        parts.append(f"{name} {number(math.sqrt(sum(variance)))} deg/s (most at {most.low_hz:g}-{most.high_hz:g} Hz)")
    crossed = ", ".join(number(freq) for freq in budget.crossovers_hz)
    where = f"crossover {crossed} Hz; " if crossed else ""
    console.print(f"noise floor: {where}{', '.join(parts)}", soft_wrap=True, highlight=False)


def print_scenario(scenario: Scenario, facts: TableFacts) -> None:
    """Print every key of a scenario: as written, and in SI; then what the turntable will be asked for."""
    console = _console()
    table = Table(title=f"{scenario.name}: {scenario.file}", title_justify="left")
    for heading in ("key", "as written", "understood (SI)"):
        # Folded, never cut: a key is one long word.
        table.add_column(heading, overflow="fold")
    for key, value in understood(scenario).items():
        table.add_row(key, value["written"], value["si"])
    console.print(table)
    for name, sensor in scenario.sensors.items():
        if rows := sensor.datasheet():
            sheet = Table("quantity", "value", title=f"{name}: in data-sheet units", title_justify="left")
            for row in rows:
                sheet.add_row(*row)
            console.print(sheet)
    _print_facts(console, facts)
    console.print("The scenario is valid.")


def _print_facts(console: Console, facts: TableFacts) -> None:
    modes = [f"{f:.4g} Hz ({z:.2g})" for f, z in zip(facts.freq_hz, facts.damping, strict=True)]
    torque = f"required torque {facts.required_torque:.4g} N m"
    if facts.torque_limit is not None:
        used = facts.required_torque / facts.torque_limit
        torque += f" of {facts.torque_limit:.4g} N m, margin {100 * (1 - used):.0f} %"
    noise = f"arithmetic noise of the truth {number(math.degrees(facts.truth_noise))} deg/s rms"
    step = _step(facts.step.engine, facts.step.step, facts.step.holds / facts.step.substeps, facts.step.error)
    for line in (f"coupled modes (damping): {', '.join(modes)}" if modes else "", torque, noise, step):
        if line:
            console.print(f"turntable: {line}", soft_wrap=True, highlight=False)


def print_catalogue(table: Mapping[str, Mapping[str, str]]) -> None:
    """Print what there is to choose from, the summaries wrapped beside the names."""
    console = _console()
    width = max(len(name) for names in table.values() for name in names)
    for kind, names in table.items():
        console.print(f"[bold]{kind.replace('_', ' ')}[/bold]")
        grid = Table.grid(padding=(0, 2, 0, 0))
        grid.add_column(width=width + 2, no_wrap=True)
        grid.add_column()
        for name, summary in names.items():
            grid.add_row(f"  {name}", Text(summary))
        console.print(grid, highlight=False)


def print_allan(analyses: Sequence[Analysis], figure: Path) -> None:
    """Print the coefficients with their intervals, limits as limits, or why there are none."""
    from testbed.judging.allan_analysis import TERMS

    console = _console()
    for analysis in analyses:
        console.print(analysis.record.content, style="bold", soft_wrap=True, highlight=False, markup=False)
        console.print(
            f"{analysis.record.rate.size} samples at {analysis.record.sample_rate_hz:.6g} Hz", highlight=False
        )
        if analysis.fit.goodness.accepted:
            table = Table("", "term", "value", "95 % interval", "unit", "value in SI", "SI unit")
            for term in TERMS:
                table.add_row(*_allan_row(analysis, term))
            console.print(table)
        console.print(analysis.verdict(), soft_wrap=True, highlight=False)
    console.print(f"wrote {figure}", soft_wrap=True, highlight=False)


def _allan_row(analysis: Analysis, term: Term) -> tuple[str, ...]:
    found, name = analysis.coefficient(term), term.name.replace("_", " ")
    if not found.identified:
        limit = f"< {term.text(found.upper)}"
        return term.letter, name, limit, "not identified", term.unit, f"< {found.upper:.3g}", term.si
    interval = f"{term.text(found.lower)} to {term.text(found.upper)}"
    return term.letter, name, term.text(found.value), interval, term.unit, f"{found.value:.4g}", term.si
