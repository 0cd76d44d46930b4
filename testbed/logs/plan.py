"""From a map, or from options and the names of the columns, to what is to be read: places, factors, time."""

from __future__ import annotations

import difflib
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from testbed import units
from testbed.errors import quoted
from testbed.logs.clock import NANO
from testbed.logs.logmap import ChannelMap, TimeMap, measure, time_factor
from testbed.logs.names import QUANTITIES, Label, quantity_of, take_apart
from testbed.logs.options import quantity as as_quantity
from testbed.logs.options import refusal

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Sequence

    from testbed.errors import ScenarioError
    from testbed.logs.table import Table

    Keys = Callable[[str], str]

ROTATIONS = ("rate", "angle")
_COUNTS = re.compile(r"(lsb|counts?|digits?|raw|adc)", re.IGNORECASE)
_RATES = re.compile(
    r"(f_?s|odr|rate_?hz|(sample|sampling|data|update|output)[ _-]?(rate|freq\w*)([ _\[(]*hz[\])]?)?)", re.IGNORECASE
)
# Numbers that are a date in one unit only: 1990 to 2100.
_EPOCH_S = (6.3e8, 4.2e9)
_PREFERRED = ("timestamp_sample", "header.stamp")


@dataclass(frozen=True)
class Plan:
    """How a channel is read.

    Parameters
    ----------
    name, label : str
        Of the channel, and of its column for the reader.
    table : Table
        The file.
    value : int
        Place of its column.
    unit : str
        As written; empty if nothing says it.
    quantity : str
        What it measures; empty if nothing says it.
    factor, zero : float
        SI value = zero + factor * number.
    kind : str, optional
        ``rate``, ``increment`` or ``angle``, if said.
    stamps : int, optional
        Place of the column of time.
    time_unit : float
        Its unit [s].
    rate_hz : float, optional
        Sample rate that was said [Hz].
    nominal_hz : float, optional
        Sample rate that the file states beside its stamps [Hz].
    offset_ns : int
        What is added to all stamps [ns].
    time_said : bool
        Whether the stamps are to be used, or only compared with the rate.
    largest : float, optional
        Range of the sensor [SI].
    assumed : tuple of str
        What was taken for granted.
    contradictions : tuple of str
        What the file says otherwise.
    average : int
        Samples of which the mean is kept [-].
    """

    name: str
    label: str
    table: Table
    value: int
    unit: str
    quantity: str
    factor: float
    zero: float
    kind: str | None
    stamps: int | None
    time_unit: float
    rate_hz: float | None
    nominal_hz: float | None
    offset_ns: int
    time_said: bool
    largest: float | None
    assumed: tuple[str, ...]
    contradictions: tuple[str, ...]
    average: int = 1


def option_keys(field: str) -> str:
    """Return the option that a field of a channel's map has on the command line."""
    names = {"time.column": "time", "time.unit": "time-unit", "time.rate": "rate", "time_unit": "time-unit"}
    return f"--{names.get(field, field)}"


def labels(table: Table) -> list[Label]:
    """Return what the names of all columns say, those of scaled counts after the preamble."""
    return [take_apart(column.short, column.unit) for column in table.columns]


def find_column(table: Table, text: str, key: str, topic: str | None = None) -> int:
    """Return the place of a column given by its name, with or without its unit or group, or by its number.

    Raises
    ------
    ScenarioError
        If there is none, or more than one.
    """
    names = [column.name for column in table.columns]
    known = labels(table)
    inside = [
        i for i, c in enumerate(table.columns) if topic is None or c.group == topic or c.name.startswith(f"{topic}/")
    ]
    if not inside:
        groups = sorted({column.group for column in table.columns})
        raise refusal(table.path, f"no topic {quoted(topic)}; there are {_few(groups)}", key)
    tests: tuple[Callable[[int], bool], ...] = (
        lambda i: names[i] == text,
        lambda i: names[i].lstrip("#% ") == text.lstrip("#% "),
        lambda i: table.columns[i].short == text or known[i].name == text,
        lambda i: known[i].name.lower() == text.lower(),
    )
    for test in tests:
        found = [i for i in inside if test(i)]
        if len(found) == 1:
            return found[0]
        if found:
            where = ", ".join(f"{quoted(names[i])} (column {i + 1})" for i in found[:8])
            raise refusal(table.path, f"{quoted(text)} is {len(found)} columns: {where}; give its number or topic", key)
    if re.fullmatch("[0-9]{1,9}", text) and 1 <= int(text) <= len(names):
        return int(text) - 1
    raise _unknown(table, text, key, names)


def _unknown(table: Table, text: str, key: str, names: Sequence[str]) -> ScenarioError:
    fifo = getattr(table, "rows_of", {}).get(text)
    if fifo:
        return refusal(
            table.path, f"{quoted(text)} is one of the samples that a row holds: take column {quoted(fifo)}", key
        )
    if table.columns and names[0] == "column 1":
        message = f"no column {quoted(text)}; there are {len(names)} and no header: give a number from 1 on"
    else:
        near = difflib.get_close_matches(text, names, n=1)
        hint = f"; did you mean {quoted(near[0])}?" if near else ""
        message = f"no column {quoted(text)}; the header has {_few(names)}{hint}"
    return refusal(table.path, message, key)


def _few(names: Sequence[str]) -> str:
    shown = ", ".join(map(repr, names[:20]))
    return shown if len(names) <= 20 else f"{shown} and {len(names) - 20} more"


def time_columns(table: Table, group: str) -> list[int]:
    """Return the columns of a group whose names say that they hold the time, the preferred one alone where there is."""
    found = [
        i
        for i, (c, label) in enumerate(zip(table.columns, labels(table), strict=True))
        if c.group == group and label.quantity == "time"
    ]
    if not found:
        # A column without a name that holds times is the time, if there is one of them.
        dated = sorted(getattr(getattr(table, "inner", table), "dated", ()))
        found = dated if len(dated) == 1 else []
    if len(found) > 1:
        # A large T beside another time is a temperature.
        found = [i for i in found if table.columns[i].short != "T"]
    preferred = [i for i in found if labels(table)[i].name in _PREFERRED]
    stamped = [i for i in found if table.columns[i].short in {"timestamp", "time", "t", "log_time_ns"}]
    return preferred or (found if len(found) < 2 or len(stamped) != 1 else stamped)


def channels_of(table: Table) -> list[int]:
    """Return the columns that are no time."""
    dated: Collection[int] = getattr(getattr(table, "inner", table), "dated", ())
    return [
        i
        for i, label in enumerate(labels(table))
        if label.quantity != "time" and i not in unreadable(table) and i not in dated
    ]


def unreadable(table: Table) -> Collection[int]:
    """Return the columns that hold words, or times that are not understood."""
    found: Collection[int] = getattr(getattr(table, "inner", table), "unreadable", ())
    return found


def measured_quantity(table: Table, place: int) -> str:
    """Return what a column measures by its own unit or the preamble's scale, or an empty text."""
    label = labels(table)[place]
    return label.quantity or ("rate" if _preamble_scale(table, label.name) else "")


def plan(name: str, channel: ChannelMap, table: Table, keys: Keys = option_keys) -> Plan:
    """Return how a channel is read.

    Parameters
    ----------
    name : str
        Of the channel.
    channel : ChannelMap
        What is said of it.
    table : Table
        Its file.
    keys : callable
        Where a field of the map was said, for messages.

    Returns
    -------
    Plan
        With the unit and the time of the file where the map says none.

    Raises
    ------
    ScenarioError
        If a column is not there, or a unit or kind does not fit.
    """
    place = find_column(table, channel.column, keys("column"), channel.topic)
    unit, quantity, factor, zero, assumed = _measured(channel, table, place)
    if channel.kind and quantity and quantity != {"rate": "rate"}.get(channel.kind, "angle"):
        good = "deg/s" if channel.kind == "rate" else "arcsec"
        raise refusal(
            table.path, f"kind {channel.kind} expects a unit such as {good}, got {quoted(unit)}", keys("kind")
        )
    stamps, time_unit, rate, said, time_notes = _timed(channel.time, table, place, keys)
    column = table.columns[place]
    largest = measure(channel.range)[0] if channel.range else None
    return Plan(
        name=name,
        label=repr(column.name) if column.name != f"column {place + 1}" else column.name,
        table=table,
        value=place,
        unit=unit,
        quantity=quantity,
        factor=channel.sign * factor,
        zero=zero,
        kind=channel.kind or ("rate" if quantity == "rate" else None),
        stamps=stamps,
        time_unit=time_unit,
        rate_hz=rate,
        nominal_hz=column.rate_hz or _header_rate(table),
        offset_ns=0 if channel.time is None else round(channel.time.offset / NANO) + channel.time.epoch_ns,
        time_said=said,
        largest=largest,
        assumed=(*assumed, *time_notes),
        contradictions=_other_unit(channel, labels(table)[place]),
    )


def _measured(channel: ChannelMap, table: Table, place: int) -> tuple[str, str, float, float, list[str]]:
    """Return unit, quantity, factor, zero of a column, and what was taken for granted."""
    label = labels(table)[place]
    if channel.scale is not None:
        value, quantity = measure(channel.scale)
        return channel.scale, quantity, value, 0.0, []
    unit = channel.unit or label.unit
    if channel.unit is None and not unit and (said := _preamble_scale(table, label.name)):
        unit, value = said, measure(said)[0]
        return unit, "rate", value, 0.0, [f"{label.name}: {unit} a count, as the preamble says"]
    quantity = quantity_of(unit)
    if not quantity:
        return unit if not _COUNTS.fullmatch(unit) else "", "", 1.0, 0.0, []
    if quantity == "temperature":
        zero = units.parse(f"0 {unit}", "K")
        return unit, quantity, units.parse(f"1 {unit}", "K") - zero, zero, []
    return unit, quantity, _factor(unit), 0.0, []


def _other_unit(channel: ChannelMap, label: Label) -> tuple[str, ...]:
    """Return that the file gives a column another unit than the one asked for, if it does."""
    if not (channel.unit and quantity_of(channel.unit) and quantity_of(label.unit)):
        return ()
    if quantity_of(channel.unit) == quantity_of(label.unit) and _factor(channel.unit) == _factor(label.unit):
        return ()
    return (f"contradiction: {label.name} is in {label.unit} by the file; {channel.unit} was asked for and is used",)


def _factor(unit: str) -> float:
    return units.parse(f"1 {unit}", QUANTITIES[quantity_of(unit)])


def _preamble_scale(table: Table, name: str) -> str:
    """Return the scale per count that the preamble of a camera's motion log gives its rates."""
    scale = table.header.get("gscale")
    return f"{scale} rad/s" if scale and re.fullmatch(r"[gr][xyz]", name, re.IGNORECASE) else ""


def _timed(
    said: TimeMap | None, table: Table, place: int, keys: Keys
) -> tuple[int | None, float, float | None, bool, list[str]]:
    """Return place and unit of the stamps, the rate, whether the stamps are to be used, what was taken for granted."""
    column = table.columns[place]
    if said is not None and said.column is not None:
        stamps = find_column(table, said.column, keys("time.column"))
        unit, note = _time_unit(table, stamps, said.unit, keys, guessed=False)
        return stamps, unit, None, True, note
    if said is not None:
        found = [i for i in time_columns(table, column.group) if i not in unreadable(table)]
        if len(found) == 1 and not _ambiguous_unit(table, found[0]):
            return found[0], _time_unit(table, found[0], None, keys, guessed=True)[0], said.rate, False, []
        return None, 1.0, said.rate, False, []
    found = [i for i in time_columns(table, column.group) if table.columns[i].n_time == column.n_time]
    if len(found) > 1:
        names = _few([table.columns[i].name for i in found])
        raise refusal(table.path, f"expected one column of time, got {names}: say which", keys("time.column"))
    if found and found[0] in unreadable(table):
        name = table.columns[found[0]].name
        message = f"the times in {quoted(name)} are no numbers and not ISO 8601: convert them, or give --rate"
        raise refusal(table.path, message, keys("time.column"))
    if found:
        unit, note = _time_unit(table, found[0], None, keys, guessed=True)
        return found[0], unit, None, True, note
    stated = column.rate_hz or _header_rate(table)
    return None, 1.0, stated, False, [f"{stated:.9g} Hz, as the file says"] if stated else []


def _header_rate(table: Table) -> float | None:
    for name, text in table.header.items():
        match = re.match(r"[\d.eE+]+( ?[kM]?Hz)?$", text.strip())
        if _RATES.fullmatch(name.strip()) and match:
            return as_quantity(match[0], "Hz", "100 Hz", "--rate")
    return None


def _ambiguous_unit(table: Table, stamps: int) -> bool:
    label = labels(table)[stamps]
    return not label.unit and "tscale" not in table.header and _looks(table, stamps)[0] == "integer"


def _time_unit(table: Table, stamps: int, said: str | None, keys: Keys, *, guessed: bool) -> tuple[float, list[str]]:
    """Return the unit of the stamps [s] and what was taken for granted."""
    label = labels(table)[stamps]
    kind, epoch_unit = _looks(table, stamps)
    if said is not None:
        return time_factor(said), []
    if kind == "date":
        return NANO, []
    if label.unit and quantity_of(label.unit) == "time":
        return time_factor(label.unit), []
    if "tscale" in table.header:
        return float(table.header["tscale"]), [f"time in {table.header['tscale']} s, as the preamble says"]
    if epoch_unit:
        return time_factor(epoch_unit), [f"time {quoted(label.name)} in {epoch_unit}: only so it is a date"]
    if kind == "integer" and guessed:
        message = f"expected the unit of the time {quoted(label.name)}, such as us: its whole numbers may be anything"
        raise refusal(table.path, message, keys("time.unit"))
    return 1.0, [f"time {quoted(label.name)} in s: no unit was given"]


def _looks(table: Table, stamps: int) -> tuple[str, str]:
    """Return whether the first stamps are ``date``, ``integer`` or ``number``, and the unit that makes them a date."""
    import numpy as np

    first = next(iter(table.blocks([stamps], [stamps])), {stamps: np.zeros(0)})[stamps]
    if first.dtype.kind == "M":
        return "date", ""
    kind = "integer" if first.dtype.kind in "iu" or bool(np.all(first == np.floor(first))) else "number"
    value = float(first[0]) if first.size else 0.0
    units_ = [
        u
        for u, size in (("s", 1.0), ("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9))
        if _EPOCH_S[0] < value * size < _EPOCH_S[1]
    ]
    return kind, units_[0] if len(units_) == 1 else ""
