"""What a recording holds, channel by channel: time, numbers, and everything that a user should know before using it."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.logs.clock import NANO, ClockScan, Tally, TimeBase
from testbed.logs.plan import ROTATIONS
from testbed.logs.reader import is_sparse, stamp_scans
from testbed.logs.values import Values, ValueScan, word_size

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from testbed.logs.channel import LogChannel
    from testbed.logs.keeping import Timed
    from testbed.logs.plan import Plan
    from testbed.logs.table import Block, Table

_PLACES = 5
# Values looked at in one go: copies of all would take as much memory again, several times over.
_BLOCK = 1 << 20
_GYRO = re.compile(r"gyr|rate|omega|\bw\b|^[grw]_?[xyz]$", re.IGNORECASE)


@dataclass(frozen=True)
class Oddity:
    """Something that is wrong or odd.

    Parameters
    ----------
    kind : str
        ``gaps``, ``doubled``, ``backward``, ``uneven``, ``coarse``, ``wraps``, ``missing``, ``repeats``, ``stray``,
        ``saturation``, ``rounding``, ``unit`` or ``rate``.
    message : str
        What, where, and what may be done.
    """

    kind: str
    message: str


@dataclass(frozen=True)
class Report:
    """What a channel holds.

    Parameters
    ----------
    plan : Plan
        How it is read.
    values : Values
        Its numbers, in the unit of the file.
    clock : TimeBase, optional
        Its time base, where there are stamps.
    findings : tuple of Oddity
        What is wrong or odd.
    """

    plan: Plan
    values: Values
    clock: TimeBase | None
    findings: tuple[Oddity, ...]


def inspect(plans: Sequence[Plan]) -> list[Report]:
    """Look at channels, block by block, so that memory does not grow with the file.

    Parameters
    ----------
    plans : sequence of Plan
        From `plan.plan`.

    Returns
    -------
    list of Report
        One for each channel.

    Raises
    ------
    ScenarioError
        As `read_log`.
    """
    groups: dict[tuple[int, str, int | None], list[Plan]] = {}
    for one in plans:
        column = one.table.columns[one.value]
        groups.setdefault((id(one.table), column.group, column.n_time), []).append(one)
    found = {one.name: report for members in groups.values() for one, report in _inspect_group(members)}
    return [found[one.name] for one in plans]


def _inspect_group(plans: Sequence[Plan]) -> Iterator[tuple[Plan, Report]]:
    table = plans[0].table
    scans = [_ChannelScan(one) for one in plans]
    clocks = stamp_scans(plans)
    stamps = {one.stamps for one in plans if one.stamps is not None}
    for block in table.blocks(list(dict.fromkeys([*(one.value for one in plans), *stamps])), stamps):
        times = {key: stamp.add(block[stamp.column]) for key, stamp in clocks.items()}
        for scan in scans:
            scan.add(block, times)
    for one, scan in zip(plans, scans, strict=True):
        found = clocks.get((one.stamps, one.time_unit))
        clock, values = scan.clock() or (None if found is None else found.result()), scan.values.result()
        yield one, Report(one, values, clock, tuple(channel_findings(table, clock, values, one)))


class _ChannelScan:
    """The values of a channel; of one that is slower than its rows, which the first block shows, its own stamps too."""

    def __init__(self, one: Plan) -> None:
        self._one, self.values = one, ValueScan()
        self._clock: ClockScan | None = None
        self._first = True

    def add(self, block: Block, times: Mapping[Timed, NDArray[np.int64]]) -> None:
        numbers = np.asarray(block[self._one.value], np.float64)
        stamps = times.get((self._one.stamps, self._one.time_unit))
        if self._first and stamps is not None and is_sparse(numbers):
            self._clock = ClockScan()
        self._first = False
        if self._clock is not None and stamps is not None:
            known = np.isfinite(numbers)
            numbers = numbers[known]
            self._clock.add(stamps[known])
        self.values.add(numbers)

    def clock(self) -> TimeBase | None:
        return None if self._clock is None else self._clock.result()


def channel_findings(table: Table, clock: TimeBase | None, values: Values, one: Plan) -> Iterator[Oddity]:
    """Yield what is wrong or odd with a channel.

    Parameters
    ----------
    table : Table
        Its file.
    clock : TimeBase, optional
        Its time base.
    values : Values
        Its numbers.
    one : Plan
        How it is read.
    """
    yield from (Oddity("unit", text) for text in one.contradictions)
    if clock is not None:
        yield from _of_time(table, clock)
        nominal = one.rate_hz or one.nominal_hz
        if nominal is not None and clock.even and not clock.agrees_with(nominal):
            yield Oddity("rate", f"the nominal rate {nominal:g} Hz contradicts the stamps: {clock.said()}")
    if values.n_missing:
        yield Oddity("missing", f"{values.n_missing} values are missing in {one.label}")
    if not _turns(one):
        return
    if values.repeats > 1.0:
        yield Oddity("repeats", _repeats_text(values, one.label))
    if values.stray is not None:
        yield Oddity("stray", _stray_text(values.stray, one.label))
    limit = None if one.largest is None else one.largest / abs(one.factor)
    if values.saturated or (limit is not None and max(-values.low, values.high) >= 0.999 * limit):
        ends = f"{values.at_low} samples at {values.low:g}, {values.at_high} at {values.high:g}"
        yield Oddity(
            "saturation", f"{one.label} is out of range: {ends}, up to {max(values.row_low, values.row_high)} in a row"
        )
    if values.rounded:
        yield Oddity("rounding", f"{one.label} is rounding: words of {values.word:.4g}, noise of less than half a word")


def _repeats_text(values: Values, label: str) -> str:
    n = values.repeats
    if values.still:
        return f"{label} stands still for up to {values.row_equal} samples in a row, as no noise does: it was stuck"
    return f"each value stands {n:.3g} times in {label}: the sensor is slower; --average {n:.0f} takes each once"


def _stray_text(stray: tuple[float, int], label: str) -> str:
    value, count = stray
    word = f"--missing {value:.12g} if that means none"
    return f"{value:.12g} stands {count} times in {label}, far from all others: a fault, or a word ({word})"


def _turns(one: Plan) -> bool:
    """Return whether a channel is a rate or an angle, by its unit or, without one, by its name.

    A thermometer stands still at its highest word, a flag has two values, and both are as they should be.
    """
    return one.quantity in ROTATIONS or (not one.quantity and _GYRO.search(one.name) is not None)


def _of_time(table: Table, clock: TimeBase) -> Iterator[Oddity]:
    if clock.coarse:
        rounded = f"the stamps are rounded to {NANO * clock.quantum_ns:g} s, coarser than the samples"
        yield Oddity("coarse", f"{rounded}; --rate '{clock.mean_rate_hz:.6g} Hz' takes them as even")
        return
    if clock.gaps.count:
        yield Oddity("gaps", gap_text(table, clock))
    for kind, tally, what in (
        ("doubled", clock.doubled, "stamps stand twice"),
        ("backward", clock.backward, "stamps go back"),
        ("uneven", clock.uneven, "steps are no multiple of the usual one"),
    ):
        if tally.count:
            yield Oddity(kind, f"{tally.count} {what}: {_places(table, tally)}")
    if clock.wraps:
        yield Oddity("wraps", f"the counter of the stamps began anew {clock.wraps} times, which was taken into account")


def gap_text(table: Table, clock: TimeBase) -> str:
    """Return how many samples are lost, where, and which share of all.

    Parameters
    ----------
    table : Table
        For the lines.
    clock : TimeBase
        With at least one gap.
    """
    lost = clock.gaps.missing
    share = lost / (lost + clock.n_time)
    kept = f"{1.0 - share:.4g} of the samples are kept, {clock.mean_rate_hz:.6g} Hz in the mean"
    return f"{lost} samples lost in {clock.gaps.count} gaps ({_places(table, clock.gaps)}); {kept}"


def _places(table: Table, tally: Tally) -> str:
    """Return the first places, by line and by seconds from the start."""
    places: list[str] = []
    for event in tally.first[:_PLACES]:
        line = table.line(event.row) if len(places) < 1 else None
        where = f" (line {line})" if line is not None else f" (sample {event.row + 1})"
        places.append(f"{event.seconds:.6g} s{where}")
    more = f" and {tally.count - len(places)} more" if tally.count > len(places) else ""
    return f"at {', '.join(places)}{more}"


def remarks(channel: LogChannel) -> list[str]:
    """Return what a user of a channel should know: what contradicts, is missing, or began anew.

    Parameters
    ----------
    channel : LogChannel
        Of a recording.
    """
    said = list(channel.notes)
    if channel.clock is not None and channel.clock.gaps.count:
        said.append(gap_text(channel.table, channel.clock))
    if channel.clock is not None and channel.clock.wraps:
        said.append(f"the counter of the stamps began anew {channel.clock.wraps} times, which was taken into account")
    scan = ValueScan()
    for start in range(0, channel.values.size, _BLOCK):
        scan.add(channel.values[start : start + _BLOCK])
    values, factor = scan.result(), channel.factor
    if values.repeats > 1.0:
        said.append(_repeats_text(values, channel.label))
    if values.stray is not None:
        said.append(_stray_text((values.stray[0] / factor, values.stray[1]), channel.label))
    return said


def word_of(channel: LogChannel) -> float:
    """Return the word that a channel's values are multiples of [SI], 0 if there is none."""
    known = channel.values[np.isfinite(channel.values)][:200_000]
    return word_size(known)


def report_data(report: Report) -> dict[str, Any]:
    """Return a report as plain data, for JSON."""
    one, values, clock = report.plan, report.values, report.clock
    numbers = {
        name: _plain(getattr(values, name))
        for name in ("n_time", "n_missing", "low", "high", "mean", "std", "step_std", "word", "equal", "repeats")
    }
    return {
        "name": one.name,
        "column": one.table.columns[one.value].name,
        "unit": one.unit or None,
        "quantity": one.quantity or None,
        "time": _clock_data(clock, one),
        "values": numbers,
        "saturated": values.saturated,
        "assumed": list(one.assumed),
        "findings": [{"kind": finding.kind, "message": finding.message} for finding in report.findings],
    }


def _clock_data(clock: TimeBase | None, one: Plan) -> dict[str, Any]:
    if clock is None:
        return {"rate_hz": one.rate_hz, "column": None}
    low, high = clock.rate_limits_hz
    tallies = {name: getattr(clock, name) for name in ("gaps", "doubled", "backward", "uneven")}
    assert one.stamps is not None
    return {
        "column": one.table.columns[one.stamps].name,
        "unit_s": one.time_unit,
        "start_ns": clock.start_ns,
        "end_ns": clock.end_ns,
        "rate_hz": _plain(clock.rate_hz),
        "rate_low_hz": _plain(low),
        "rate_high_hz": _plain(high),
        "mean_rate_hz": _plain(clock.mean_rate_hz),
        "jitter_s": _plain(NANO * clock.step_std_ns),
        "rounded_to_s": NANO * clock.quantum_ns,
        "samples_lost": clock.gaps.missing,
        **{name: {"count": t.count, "first": [vars(e) for e in t.first[:_PLACES]]} for name, t in tallies.items()},
    }


def _plain(value: float) -> float | None:
    return value if np.isfinite(value) else None
