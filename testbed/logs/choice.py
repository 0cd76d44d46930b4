"""Channels that the options of a command ask for, from a file or by a map."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pydantic import ValidationError

from testbed.errors import Problem, ScenarioError, UnknownNameError
from testbed.logs.formats import open_table
from testbed.logs.logmap import ChannelMap, TimeMap, load_map
from testbed.logs.options import quantity, refusal
from testbed.logs.plan import ROTATIONS, channels_of, labels, measured_quantity, option_keys, plan, time_columns
from testbed.logs.reader import averaged, is_map, read_map, read_plans

if TYPE_CHECKING:
    from pathlib import Path

    from testbed.logs.channel import LogChannel
    from testbed.logs.selection import Selection, TextOptions
    from testbed.logs.table import Table


def select(path: Path, wanted: Selection, text: TextOptions | None = None) -> list[LogChannel]:
    """Return the channels that the options of a command ask for.

    Parameters
    ----------
    path : Path
        The recording, or a map that names it.
    wanted : Selection
        The options.
    text : TextOptions, optional
        How a text file is written.

    Returns
    -------
    list of LogChannel
        In the order of the options, or of the file.

    Raises
    ------
    ScenarioError
        If something is missing, contradicts, is not understood or not in the file; with the option.
    """
    if wanted.map is not None or is_map(path):
        return _mapped(path, wanted)
    table = open_table(path, text)
    rate_hz = quantity(wanted.rate, "Hz", "100 Hz", "--rate") if wanted.rate else None
    clock = wanted.time
    if clock is None and wanted.time_unit and rate_hz is None:
        # The unit alone was said: of the column that is the time by its name.
        found = time_columns(table, table.columns[0].group)
        clock = str(found[0] + 1) if len(found) == 1 else None
    time = time_map(clock, wanted.time_unit, None if wanted.time else rate_hz)
    columns = wanted.column or _rotations(table, wanted)
    maps = [channel_map(column=c, unit=wanted.unit, scale=wanted.scale, kind=wanted.kind, time=time) for c in columns]
    plans = [plan(one.column if wanted.column else _name(table, one), one, table) for one in maps]
    channels = list(read_plans(averaged(plans, wanted.average)).values())
    if rate_hz is not None and wanted.time is not None:
        _refuse_contradiction(channels[0], rate_hz)
    return channels


def channel_map(**fields: Any) -> ChannelMap:
    """Return the map of one channel made of options; ScenarioError names the option that is wrong."""
    try:
        return ChannelMap(**fields)
    except ValidationError as error:
        raise _as_options(error) from error


def time_map(column: str | None, unit: str | None, rate_hz: float | None) -> TimeMap | None:
    """Return the map of the time made of options, None for the file's own; ScenarioError names the wrong option."""
    try:
        return None if column is None and rate_hz is None else TimeMap(column=column, unit=unit, rate=rate_hz)
    except ValidationError as error:
        raise _as_options(error, "time.") from error


def _as_options(error: ValidationError, prefix: str = "") -> ScenarioError:
    problems = []
    for detail in error.errors():
        name = ".".join(map(str, detail["loc"])) or next((n for n in ("scale", "unit") if n in str(detail["msg"])), "")
        text = str(detail["msg"]).removeprefix("Value error, ")
        problems.append(Problem(text, key=option_keys(f"{prefix}{name or 'unit'}")))
    return ScenarioError(problems)


def _mapped(path: Path, wanted: Selection) -> list[LogChannel]:
    place = wanted.map or path
    if wanted.given:
        raise refusal(place, f"says this: leave out {', '.join(wanted.given)}", "--map")
    channels = read_map(None if wanted.map is None else path, load_map(place), wanted.average).channels
    unknown = [name for name in wanted.column or [] if name not in channels]
    if unknown:
        raise refusal(place, str(UnknownNameError("channel", unknown[0], channels)), "--column")
    if wanted.column:
        return [channels[name] for name in wanted.column]
    return [channel for channel in channels.values() if channel.quantity in ROTATIONS]


def _rotations(table: Table, wanted: Selection) -> list[str]:
    """Return the numbers of the columns that are rates or angles by their unit, or of the only column."""
    rest = channels_of(table)
    if wanted.time is not None:
        from testbed.logs.plan import find_column

        rest = [i for i in rest if i != find_column(table, wanted.time, "--time")]
    # A column without a name beside others is the number of the row.
    rest = [i for i in rest if table.columns[i].name] or rest
    named = [i for i in rest if measured_quantity(table, i) in ROTATIONS]
    # With increments and rates side by side, the rates are meant unless the kind is said.
    rates = [i for i in named if (measured_quantity(table, i) == "rate") == (wanted.kind in {None, "rate"})]
    found = rates or named or rest
    if len(found) != 1 and not named:
        names = [table.columns[i].name for i in found]
        shown = (
            ", ".join(name if name.startswith("column ") else repr(name) for name in names[:20]) or "several columns"
        )
        raise refusal(table.path, f"expected one of {shown}", "--column")
    return [str(i + 1) for i in found]


def _name(table: Table, one: ChannelMap) -> str:
    place = int(one.column) - 1
    names = [label.name for label in labels(table)]
    return names[place] if names.count(names[place]) == 1 else table.columns[place].name


def _refuse_contradiction(channel: LogChannel, rate_hz: float) -> None:
    clock = channel.clock
    if clock is not None and not clock.agrees_with(rate_hz):
        message = (
            f"the nominal rate {rate_hz:g} Hz contradicts the stamps, which say {clock.said()}: leave out one of both"
        )
        raise refusal(channel.table.path, message, "--rate")
