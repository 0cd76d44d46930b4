"""What the command line prints: tables, the understood scenario, progress."""

from __future__ import annotations

import sys
import time
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TaskProgressColumn, TextColumn, TimeRemainingColumn
from rich.table import Table

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping
    from pathlib import Path

    from testbed.scenario import Scenario

_PLAIN_EVERY = 5.0


@contextmanager
def progress(name: str, duration: float) -> Iterator[Callable[[float], None]]:
    """Show progress on standard error: a bar with rate and remaining time, or plain lines where there is no terminal."""
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
            line = f"{name}: {done:.0f} of {duration:g} s, {speed:.1f} x real time, {(duration - done) / speed:.0f} s remaining"
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
    title = f"{metrics['scenario']}: error against the truth, {metrics['settle_s']:g} s to {metrics['duration_s']:g} s, seed {metrics['seed']}"
    lines = sorted(
        {
            line["frequency_hz"]
            for row in (*metrics["sensors"].values(), *metrics["fusion"].values())
            for line in row["lines"]
        }
    )
    # With many lines the table would not fit: the report has them all.
    shown = lines if len(lines) <= 4 else []
    table = Table(title=title, title_justify="left")
    for heading in (
        "",
        "RMSE deg/s",
        "aligned deg/s",
        "claimed std deg/s",
        "x floor",
        "x optimum",
        *(f"{line:g} Hz gain, phase" for line in shown),
    ):
        table.add_column(heading, justify="left" if not heading else "right", no_wrap=True)
    for kind in ("sensors", "fusion"):
        for name, row in metrics[kind].items():
            table.add_row(*_row(name, row, shown), end_section=name == list(metrics[kind])[-1])
    console.print(table)
    for bound in metrics["expectations"]:
        verdict = "[green]met[/green]" if bound["met"] else "[red]MISSED[/red]"
        console.print(
            f"expected {bound['subject']} {bound['metric']} {bound['bound']}: {_number(bound['value'])} {verdict}"
        )
    console.print(f"wrote {folder}: report.html, recording.rrd, run.nc, metrics.json, scenario.yaml", soft_wrap=True)


def _row(name: str, row: Mapping[str, Any], shown: list[float]) -> list[str]:
    rmse = row["rmse_deg_s"]
    gains = {line["frequency_hz"]: line for line in row["lines"]}
    cells = [name, _number(rmse), _number(row["rmse_aligned_deg_s"]), _number(row.get("mean_std_deg_s"))]
    bounds = row.get("floor_rmse_deg_s"), row.get("optimum_rmse_deg_s")
    cells += ["-" if not bound or rmse is None else f"{rmse / bound:.1f}" for bound in bounds]
    for line in shown:
        entry = gains[line]
        cells.append("-" if entry["gain"] is None else f"{entry['gain']:.4f}, {entry['phase_deg']:+.2f} deg")
    return cells


def print_scenario(scenario: Scenario) -> None:
    """Print every key of a scenario: as written, and in SI."""
    console = _console()
    written = {key: f"{value} (preset)" for key, value in _leaves(dict(scenario.presets))} | dict(
        _leaves(dict(scenario.source))
    )
    table = Table(
        "key", "as written", "understood (SI)", title=f"{scenario.name}: {scenario.file}", title_justify="left"
    )
    for key, value in _leaves(scenario.resolved()):
        if value not in ("", None):
            table.add_row(key, str(written.get(key, "")), str(value))
    console.print(table)
    console.print("The scenario is valid.")


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
