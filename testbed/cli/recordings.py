"""What `testbed log inspect` and `testbed psd` print."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from rich.measure import Measurement

from testbed.cli.console import ruled, terminal
from testbed.logs.inspection import report_data
from testbed.logs.proposal import map_data
from testbed.units import DEG

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from rich.table import Table as Grid

    from testbed.judging.density import RateDensityEstimate
    from testbed.logs.clock import TimeBase
    from testbed.logs.inspection import Report
    from testbed.logs.proposal import Proposal
    from testbed.logs.table import Table
    from testbed.logs.values import Values

_BARS = " ▁▂▃▄▅▆▇█"
_WIDTH = 40
_LEAST, _FRAME = 8, 3  # bars that show something; the frame of a column


def document(table: Table, reports: Sequence[Report], proposed: Proposal) -> dict[str, Any]:
    """Return what a recording holds, for a program."""
    return {
        "file": str(table.path),
        "format": table.format,
        "header": dict(table.header),
        "channels": [report_data(report) for report in reports],
        "open": list(proposed.open),
        "notes": list(table.notes),
        "map": map_data(proposed, str(table.path)),
    }


def print_reports(table: Table, reports: Sequence[Report], proposed: Proposal) -> None:
    """Print what a recording holds, a row for each channel, then what is wrong and what is open."""
    out = terminal()
    out.print(f"{table.path}: {table.format}", soft_wrap=True)
    # The outline takes what room there is beside the numbers.
    room = out.width - Measurement.get(out, out.options.update(width=1000), _grid(reports, 0)).maximum - _FRAME
    out.print(_grid(reports, max(0, min(_WIDTH, room)) if room >= _LEAST else 0))
    for name, clock in _clocks(reports).items():
        out.print(f"time {name}: {_time(clock)}", soft_wrap=True)
    lines = [f"taken for granted: {text}" for report in reports for text in report.plan.assumed]
    lines += [f"finding: {finding.message}" for report in reports for finding in report.findings]
    lines += [*table.notes, *(f"to be said: {text}" for text in proposed.open)]
    for line in dict.fromkeys(lines):
        out.print(line, soft_wrap=True)


def _grid(reports: Sequence[Report], bars: int) -> Grid:
    """Return the table of the channels, each with an outline of so many bars."""
    headings = ("channel", "unit", "samples", "mean", "std", "lowest", "highest", "word")
    grid = ruled(*headings, *(["outline"] if bars else []))
    for column in grid.columns[1:]:
        column.no_wrap = True  # a number in two lines is none
    for report in reports:
        values = report.values
        numbers = (values.mean, values.std, values.low, values.high)
        word = f"{values.word:.3g}" if values.word else "-"
        cells = (report.plan.name, report.plan.unit or "?", str(values.n_time), *(f"{n:.4g}" for n in numbers), word)
        grid.add_row(*cells, *([outline(values, bars)] if bars else []))
    return grid


def _clocks(reports: Sequence[Report]) -> dict[str, TimeBase]:
    found = {}
    for report in reports:
        if report.clock is not None and report.plan.stamps is not None:
            found[repr(report.plan.table.columns[report.plan.stamps].name)] = report.clock
    return found


def _time(clock: TimeBase) -> str:
    span = 1e-9 * (clock.end_ns - clock.start_ns)
    parts = [f"{clock.said()}, {clock.n_time} samples in {span:.9g} s"]
    parts.append(f"steps {1e-9 * clock.step_ns:.6g} s with a standard deviation of {1e-9 * clock.step_std_ns:.2g} s")
    parts.append(f"stamps to {1e-9 * clock.quantum_ns:g} s")
    if clock.start_ns > 6e17:
        parts.append(f"from {np.datetime64(clock.start_ns, 'ns')} UTC on")
    return "; ".join(parts)


def outline(values: Values, bars: int) -> str:
    """Return a small plot of a channel: the highest value of each stretch of the record, as so many bars."""
    rows = values.outline
    if not rows.size or not values.high > values.low:
        return ""
    places = np.array_split(np.arange(len(rows)), min(bars, len(rows)))
    tops = np.array([rows[place, 1].max() for place in places])
    levels = np.rint((tops - values.low) / (values.high - values.low) * (len(_BARS) - 1)).astype(int)
    return "".join(_BARS[level] for level in levels)


def print_densities(found: Sequence[RateDensityEstimate], edges: list[float] | None, figure: Path) -> None:
    """Print the rms of each record in bands, and what its density is."""
    out = terminal()
    for one in found:
        out.print(one.record.content, style="bold", soft_wrap=True)
        grid = ruled("band [Hz]", "rate rms [deg/s]", "angle rms [urad]", "up to here [deg/s]", "up to here [urad]")
        rate = angle = 0.0
        for band in one.bands(edges or one.decades()):
            rate, angle = float(np.hypot(rate, band.rate)), float(np.hypot(angle, band.angle))
            cells = (band.rate / DEG, band.angle * 1e6, rate / DEG, angle * 1e6)
            grid.add_row(f"{band.low_hz:.4g} to {band.high_hz:.4g}", *(f"{cell:.4g}" for cell in cells))
        out.print(grid)
        low, high = np.sqrt(one.limits)
        sides = "one-sided" if one.sides == 1 else "two-sided"
        out.print(
            f"density {sides}, {one.method}; 95 % interval of a root density {low:.3f} to {high:.3f} times its value",
            soft_wrap=True,
        )
        for note in one.notes:
            out.print(note, soft_wrap=True)
    out.print(f"wrote {figure}", soft_wrap=True)
