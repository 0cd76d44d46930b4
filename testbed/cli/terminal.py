"""What the command line prints: tables, the understood scenario, progress."""

from __future__ import annotations

import math
import sys
import time
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TaskProgressColumn, TextColumn, TimeRemainingColumn
from rich.table import Table

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence
    from pathlib import Path

    from testbed.judging.allan_analysis import Analysis, Term
    from testbed.judging.table_facts import TableFacts
    from testbed.scenario.model import Scenario

_PLAIN_EVERY = 5.0
# A tenth of the Earth's rate [deg/s].
_SLOW = 1.5 / 3600.0
# Columns of the terminal: errors of a filter beside its name, and gain, phase and error over optimum of one line.
_TABLE_WIDTH, _LINE_WIDTH = 61, 31


@contextmanager
def progress(name: str, duration: float) -> Iterator[Callable[[float], None]]:
    """Show progress on standard error: a bar with rate and remaining time, or plain lines without a terminal."""
    if sys.stderr.isatty():
        with _bar() as bar:
            task = bar.add_task(name, total=duration, speed="")
            yield _advance(bar, task)
    else:
        yield _plain(name, duration)


def _bar() -> Progress:
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TaskProgressColumn(),
        TextColumn("{task.fields[speed]}"),
        TimeRemainingColumn(),
    )
    return Progress(*columns, console=Console(stderr=True))


def _advance(bar: Progress, task: TaskID) -> Callable[[float], None]:
    begin = time.monotonic()

    def tick(done: float) -> None:
        bar.update(task, completed=done, speed=f"{done / max(time.monotonic() - begin, 1e-9):.1f} x real time")

    return tick


def _plain(name: str, duration: float) -> Callable[[float], None]:
    begin = last = time.monotonic()

    def tick(done: float) -> None:
        nonlocal last
        now = time.monotonic()
        if now - last >= _PLAIN_EVERY or done >= duration:
            speed = done / max(now - begin, 1e-9)
            line = (
                f"{name}: {done:.0f} of {duration:g} s, {speed:.1f} x real time, {(duration - done) / speed:.0f} "
                f"s remaining"
            )
            print(line, file=sys.stderr, flush=True)  # noqa: T201 - this is the terminal
            last = now

    return tick


def _console() -> Console:
    console = Console()
    # Without a terminal there is no width to respect: a log keeps whole lines.
    return console if console.is_terminal else Console(width=180)


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.4g}"


def print_metrics(metrics: Mapping[str, Any], folder: Path) -> None:
    """Print the table of errors, the expectations and what was written."""
    console = _console()
    unit, scale = _error_unit(metrics)
    title = (
        f"{metrics['scenario']}: error against the truth in {unit}, {metrics['settle_s']:g} s to "
        f"{metrics['duration_s']:g} s, seed {metrics['seed']}"
    )
    lines = sorted(
        {
            line["frequency_hz"]
            for row in (*metrics["sensors"].values(), *metrics["fusion"].values())
            for line in row["lines"]
        }
    )
    # With many lines, or on a narrow terminal, the table would not fit: the report has them all.
    longest = max(map(len, (*metrics["sensors"], *metrics["fusion"])), default=0)
    width = _TABLE_WIDTH + longest + _LINE_WIDTH * len(lines)
    shown = lines if len(lines) <= 4 and console.width >= width else []
    headings = (
        "",
        "RMSE",
        "aligned",
        "claimed std",
        "x floor",
        "x optimum",
        *(f"{line:g} Hz gain, phase, x opt." for line in shown),
    )
    rows = {
        kind: [_row(name, row, shown, scale) for name, row in metrics[kind].items()] for kind in ("sensors", "fusion")
    }
    # Not the table's own title, which would be folded to a narrow table's width.
    console.print(f"[italic]{title}[/italic]", soft_wrap=True, highlight=False)
    _print_errors(console, headings, rows)
    for name, row in metrics["sensors"].items():
        if row.get("missing"):
            console.print(f"{name}: {row['missing']} readings lost")
    _print_budget(console, metrics["budget"])
    _print_claims(console, metrics["fusion"])
    _print_table(console, metrics["turntable"])
    for bound in metrics["expectations"]:
        verdict = "[green]met[/green]" if bound["met"] else "[red]MISSED[/red]"
        console.print(
            f"expected {bound['subject']} {bound['metric']} {bound['bound']}: {_number(bound['value'])} {verdict}"
        )
    console.print(f"wrote {folder}: report.html, recording.rrd, run.nc, metrics.json, scenario.yaml", soft_wrap=True)


def _print_errors(console: Console, headings: Sequence[str], rows: Mapping[str, list[list[str]]]) -> None:
    """Print the columns that have a value, a line under each kind of source."""
    cells = [row for kind in rows.values() for row in kind]
    table = Table()
    kept = [i for i in range(len(headings)) if i < 2 or any(row[i] != "-" for row in cells)]
    for i in kept:
        table.add_column(headings[i], justify="right" if i else "left", no_wrap=True)
    for kind in rows.values():
        for row in kind:
            table.add_row(*(row[i] for i in kept), end_section=row is kind[-1])
    console.print(table)


def _error_unit(metrics: Mapping[str, Any]) -> tuple[str, float]:
    """Return the unit of the errors and what deg/s is multiplied by for it: deg/h where all are below a tenth of the
    Earth's rate.
    """
    errors = [row["rmse_deg_s"] for kind in ("sensors", "fusion") for row in metrics[kind].values()]
    known = [error for error in errors if error is not None]
    return ("deg/h", 3600.0) if known and 0.0 < max(known) < _SLOW else ("deg/s", 1.0)


def _print_claims(console: Console, fusion: Mapping[str, Mapping[str, Any]]) -> None:
    """Print the verdict on each filter's claims about itself."""
    words = [
        f"{name} {row['consistency']['verdict']} (NEES {_number(row['consistency']['nees'])})"
        for name, row in fusion.items()
        if row["consistency"]["verdict"] is not None
    ]
    if words:
        console.print(f"claims: {', '.join(words)}", soft_wrap=True, highlight=False)


def _print_table(console: Console, table: Mapping[str, Any]) -> None:
    """Print how the turntable did."""
    followed = ", ".join(
        f"{name} {_number(table[f'command_to_{name}_rms_deg_s'])} deg/s rms{_gain(table[f'command_to_{name}_lines'])}"
        for name in ("encoder", "inertial")
    )
    torque = f"peak torque {_number(table['peak_torque_nm'])} N m"
    if table["torque_limit_nm"] is not None:
        torque += f" of {_number(table['torque_limit_nm'])} N m, margin {100 * table['torque_margin']:.0f} %"
    noise = f"arithmetic noise of the truth {_number(table['truth_noise_deg_s'])} deg/s"
    step = _step(table["step_s"], table["step_factor"], table["step_error"])
    console.print(f"turntable: command to {followed}; {torque}; {noise}; {step}", soft_wrap=True, highlight=False)


def _step(step: float, factor: float, error: float | None) -> str:
    measured = "" if error is None else f", error {error:.1e} of the largest rate against 50 us"
    length = f"{step:g} s" if step >= 1.0 else f"{1e6 * step:g} us"
    return f"integration step {length}, {factor:g} times the hold{measured}"


def _gain(lines: Sequence[Mapping[str, Any]]) -> str:
    """Return the line that is followed worst, in words."""
    known = [line for line in lines if line["gain"] is not None]
    if not known:
        return ""
    worst = max(known, key=lambda line: abs(line["gain"] - 1.0))
    change = f"{100 * (worst['gain'] - 1.0):+.2g} %, {worst['phase_deg']:+.2g} deg"
    return f" ({change} at {_number(worst['frequency_hz'])} Hz)"


def _row(name: str, row: Mapping[str, Any], shown: list[float], scale: float) -> list[str]:
    rmse = row["rmse_deg_s"]
    errors = (rmse, row["rmse_aligned_deg_s"], row.get("mean_std_deg_s"))
    gains = {line["frequency_hz"]: line for line in row["lines"]}
    cells = [name, *(_number(None if error is None else scale * error) for error in errors)]
    bounds = row.get("floor_rmse_deg_s"), row.get("optimum_rmse_deg_s")
    cells += ["-" if not bound or rmse is None else f"{rmse / bound:.1f}" for bound in bounds]
    for line in shown:
        entry = gains[line]
        cells.append(
            "-" if entry["gain"] is None else f"{entry['gain']:.4f}, {entry['phase_deg']:+.2f} deg{_over(entry)}"
        )
    return cells


def _over(line: Mapping[str, Any]) -> str:
    """Return the error of a line over its optimum, in a cell."""
    return f", {line['error_deg_s'] / line['optimum_deg_s']:.1f}" if line.get("optimum_deg_s") else ""


def _print_budget(console: Console, budget: Mapping[str, Any] | None) -> None:
    """Print in one line which sensor makes the noise floor, and where the better sensor changes."""
    if budget is None:
        return
    parts = []
    for name in budget["densities"]:
        variance = [band["sensors_deg_s"][name] ** 2 for band in budget["bands"]]
        most = budget["bands"][variance.index(max(variance))]
        parts.append(
            f"{name} {_number(math.sqrt(sum(variance)))} deg/s (most at {most['low_hz']:g}-{most['high_hz']:g} Hz)"
        )
    crossed = ", ".join(_number(freq) for freq in budget["crossovers_hz"])
    where = f"crossover {crossed} Hz; " if crossed else ""
    console.print(f"noise floor: {where}{', '.join(parts)}", soft_wrap=True, highlight=False)


def print_scenario(scenario: Scenario, facts: TableFacts) -> None:
    """Print every key of a scenario: as written, and in SI; then what the turntable will be asked for."""
    console = _console()
    written = {key: f"{_plain_list(value)} (preset)" for key, value in _leaves(dict(scenario.presets))} | dict(
        _leaves(dict(scenario.source))
    )
    table = Table(
        "key", "as written", "understood (SI)", title=f"{scenario.name}: {scenario.file}", title_justify="left"
    )
    for key, value in _leaves(scenario.resolved()):
        if value not in ("", None):
            table.add_row(key, _plain_list(written.get(key, "")), _plain_list(value))
    console.print(table)
    for name, sensor in scenario.sensors.items():
        if rows := sensor.datasheet():
            sheet = Table("quantity", "value", title=f"{name}: in data-sheet units", title_justify="left")
            for row in rows:
                sheet.add_row(*row)
            console.print(sheet)
    _print_facts(console, facts)
    console.print("The scenario is valid.")


def _plain_list(value: Any) -> str:
    return ", ".join(map(str, value)) if isinstance(value, list) else str(value)


def _print_facts(console: Console, facts: TableFacts) -> None:
    modes = [f"{f:.4g} Hz ({z:.2g})" for f, z in zip(facts.freq_hz, facts.damping, strict=True)]
    torque = f"required torque {facts.required_torque:.4g} N m"
    if facts.torque_limit is not None:
        used = facts.required_torque / facts.torque_limit
        torque += f" of {facts.torque_limit:.4g} N m, margin {100 * (1 - used):.0f} %"
    noise = f"arithmetic noise of the truth {_number(math.degrees(facts.truth_noise))} deg/s rms"
    step = _step(facts.step.step, facts.step.holds / facts.step.substeps, facts.step.error)
    for line in (f"coupled modes (damping): {', '.join(modes)}" if modes else "", torque, noise, step):
        if line:
            console.print(f"turntable: {line}", soft_wrap=True, highlight=False)


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


def print_catalogue(table: Mapping[str, Mapping[str, str]]) -> None:
    """Print what there is to choose from."""
    console = _console()
    width = max(len(name) for names in table.values() for name in names)
    for kind, names in table.items():
        console.print(f"[bold]{kind}s[/bold]")
        for name, line in names.items():
            console.print(f"  {name:<{width}}  {line}", soft_wrap=True, highlight=False)


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
