"""A recording read: channels in SI with their time base."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.errors import Problem, ScenarioError, quoted
from testbed.logs.chain import FileChain
from testbed.logs.channel import FEWEST, Log, LogChannel, refuse_uneven
from testbed.logs.clock import ClockScan
from testbed.logs.formats import open_table
from testbed.logs.keeping import fitting, kept_columns
from testbed.logs.logmap import ChannelMap, LogMap, load_map
from testbed.logs.names import take_apart
from testbed.logs.options import refusal
from testbed.logs.plan import Plan, channels_of, plan
from testbed.logs.stamps import StampScan
from testbed.logs.table import RowsOf

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from testbed.logs.clock import TimeBase
    from testbed.logs.keeping import Timed
    from testbed.logs.table import Table


def read_log(
    path: str | Path,
    map: LogMap | Mapping[str, Any] | str | Path | None = None,
    average: int = 1,
) -> Log:
    r"""Read a recording of any format that the testbed knows.

    Parameters
    ----------
    path : str or Path
        The file, or a map that names it.
    map : LogMap, mapping, str or Path, optional
        Which column is what, or the YAML file that says so; left out: what the names of the columns say.
    average : int
        Samples of which the mean is kept, so that a recording of any length fits into memory [-].

    Returns
    -------
    Log
        Channels in SI with their stamps.

    Raises
    ------
    ScenarioError
        If it cannot be read, a column is not there, a unit is wrong, or time is missing; with line and option.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "log.csv"
    >>> _ = path.write_text("t [us],gyro [deg/s]\n" + "".join(f"{500 * k},{k % 2}\n" for k in range(100)))
    >>> channel = read_log(path).channels["gyro"]
    >>> round(channel.rate_hz, 6), round(float(channel.values[1]), 6)
    (2000.0, 0.017453)
    """
    if map is None and is_map(path):
        return read_map(None, load_map(Path(path)), average)
    return read_map(Path(path), as_map(map), average)


def is_map(path: str | Path) -> bool:
    """Return whether a file is a map, by its name."""
    return Path(path).suffix.lower() in {".yaml", ".yml"}


def as_map(given: LogMap | Mapping[str, Any] | str | Path | None) -> LogMap | None:
    """Return a map however it is given."""
    if isinstance(given, str | Path):
        return load_map(Path(given))
    if isinstance(given, Mapping):
        from pydantic import ValidationError

        try:
            return LogMap.model_validate(given, context={"border": True})
        except ValidationError as error:
            problems = [Problem(str(e["msg"]), key=".".join(map(str, e["loc"]))) for e in error.errors()]
            raise ScenarioError(problems) from error
    return given


def read_map(path: Path | None, found: LogMap | None, average: int | None = 1) -> Log:
    """Read the channels of a map from a file, or from the map's own files; the means of so many samples, None as many
    as memory asks for.
    """
    if found is None:
        assert path is not None
        table = open_table(path)
        plans = [plan(table.columns[i].name, ChannelMap(column=str(i + 1)), table) for i in channels_of(table)]
        return Log(path, read_plans(averaged(short_names(plans), average)))
    plans = averaged(plans_of(path, found), average)
    return Log(path or plans[0].table.path, read_plans(plans))


def plans_of(path: Path | None, found: LogMap) -> list[Plan]:
    """Return how the channels of a map are read."""
    said = found.file if isinstance(found.file, list) else [found.file] if found.file else []
    files = tuple(said if path is None else [path])
    tables: dict[tuple[Path, ...], Table] = {}
    plans = []
    for name, channel in found.channels.items():
        own = (channel.file,) if channel.file else files
        if not own:
            raise ScenarioError([Problem("expected the file of the recording", key=f"channels.{name}.file")])
        if own not in tables:
            opened = [open_table(one, found.text) for one in own]
            tables[own] = opened[0] if len(opened) == 1 else FileChain(opened)
        plans.append(plan(name, channel, tables[own], lambda field, name=name: f"channels.{name}.{field}"))  # type: ignore[misc]
    return plans


def short_names(plans: list[Plan]) -> list[Plan]:
    """Return plans named after their columns without unit, where that is enough to tell them apart."""
    short = [take_apart(one.name).name for one in plans]
    return [
        replace(one, name=name if short.count(name) == 1 else one.name) for one, name in zip(plans, short, strict=True)
    ]


def averaged(plans: Sequence[Plan], average: int | None) -> list[Plan]:
    """Return plans that keep the means of so many samples, None as many as memory asks for; ScenarioError if none."""
    if average is None:
        return [fitting(one) for one in plans]
    if average < 1:
        raise ScenarioError([Problem(f"expected a number of samples from 1 on, got {average}", key="--average")])
    return [replace(one, average=average) for one in plans]


def read_plans(plans: Sequence[Plan]) -> dict[str, LogChannel]:
    """Read channels, those of one group of a file in one pass.

    Raises
    ------
    ScenarioError
        As `read_log`.
    """
    groups: dict[tuple[int, str], list[Plan]] = {}
    for one in plans:
        groups.setdefault((id(one.table), one.table.columns[one.value].group), []).append(one)
    channels: dict[str, LogChannel] = {}
    for members in groups.values():
        channels.update(_read_group(members))
    return {one.name: channels[one.name] for one in plans}


def _read_group(plans: Sequence[Plan]) -> Iterator[tuple[str, LogChannel]]:
    scans = stamp_scans(plans)
    columns, times = kept_columns(plans[0].table, plans, scans)
    for one, values in zip(plans, columns, strict=True):
        key = (one.stamps, one.time_unit)
        clock = scans[key].result() if key in scans and not scans[key].broken else None
        yield one.name, _channel(one, values, times.get(key), clock)


def stamp_scans(plans: Sequence[Plan]) -> dict[Timed, StampScan]:
    """Return what looks at the stamps of channels of one group, by column and unit."""
    keys = {(one.stamps, one.time_unit) for one in plans}
    used = {(one.stamps, one.time_unit) for one in plans if one.time_said}
    return {
        (i, unit): StampScan(plans[0].table, i, unit, needed=(i, unit) in used) for i, unit in keys if i is not None
    }


def _channel(one: Plan, values: NDArray[Any], stamps: NDArray[np.int64] | None, clock: TimeBase | None) -> LogChannel:
    table = one.table
    numbers = values.astype(np.float64) if values.dtype.kind != "f" or values.dtype.itemsize != 8 else values
    _refuse_infinite(one, numbers)
    notes = [*one.contradictions, *table.notes]
    if clock is not None and not one.time_said:
        notes += _contradiction(one, clock)
        stamps, clock = None, None
    elif clock is not None and one.nominal_hz is not None and clock.even and not clock.agrees_with(one.nominal_hz):
        notes.append(
            f"contradiction: the file says {one.nominal_hz:g} Hz, its stamps {clock.said()}; the stamps are used"
        )
    if stamps is not None and clock is not None and is_sparse(numbers):
        table, numbers, stamps, clock = _own_rows(table, numbers, stamps, clock)
        notes.append(f"{one.label} has a value in fewer than half of the rows: the others are left out")
    _refuse_few_means(one, numbers)
    if clock is not None and one.average > 1:
        refuse_uneven(table, clock)
        notes.append(f"means of {one.average} samples of {clock.rate_hz:.6g} Hz")
    rate_hz = one.rate_hz if one.rate_hz is not None else clock.rate_hz if clock is not None else float("nan")
    return LogChannel(
        name=one.name,
        label=one.label,
        values=_in_si(numbers, one),
        unit=one.unit,
        quantity=one.quantity,
        kind=one.kind,
        stamps_ns=None if stamps is None else stamps + one.offset_ns,
        clock=clock,
        rate_hz=rate_hz / one.average,
        assumed=one.assumed,
        notes=tuple(notes),
        table=table,
        largest=one.largest,
        factor=one.factor,
        start_ns=one.offset_ns,
    )


def _refuse_infinite(one: Plan, numbers: NDArray[np.float64]) -> None:
    if np.isinf(numbers).any():
        row = int(np.argmax(np.isinf(numbers)))
        message = f"expected a finite number in {one.label}, got {float(numbers[row])!r}; fill it or cut the record"
        raise refusal(one.table.path, message, line=one.table.line(row * one.average))


def _refuse_few_means(one: Plan, numbers: NDArray[np.float64]) -> None:
    """Refuse a channel of which means leave too little, or nothing."""
    if one.average > 1 and numbers.size < FEWEST:
        message = (
            f"expected at least {FEWEST} means of {one.average} samples, got {numbers.size}: take fewer for a mean"
        )
        raise refusal(one.table.path, message, "--average")
    if one.average > 1 and np.isnan(numbers).all():
        message = f"{one.label} has a value in too few rows for means of {one.average} samples: --average 1 keeps all"
        raise refusal(one.table.path, message, "--average")


def is_sparse(numbers: NDArray[np.float64]) -> bool:
    """Return whether most values are missing, as those of a slow sensor are in the rows of a quick one."""
    n_missing = int(np.count_nonzero(np.isnan(numbers)))
    return numbers.size // 2 < n_missing < numbers.size


def _own_rows(
    table: Table, numbers: NDArray[np.float64], stamps: NDArray[np.int64], clock: TimeBase
) -> tuple[Table, NDArray[np.float64], NDArray[np.int64], TimeBase]:
    """Return a slow channel in the rows that it has a value in."""
    rows = np.flatnonzero(np.isfinite(numbers))
    scan = ClockScan(float(clock.quantum_ns))
    scan.add(stamps[rows])
    return RowsOf(table, rows), numbers[rows], stamps[rows], scan.result()


def _in_si(numbers: NDArray[np.float64], one: Plan) -> NDArray[np.float64]:
    """Return the numbers in SI, in place where they are ours."""
    if one.factor == 1.0 and one.zero == 0.0:
        return numbers
    si = numbers if numbers.flags.writeable and numbers.flags.owndata else numbers.copy()
    si *= one.factor
    if one.zero:
        si += one.zero
    return si


def _contradiction(one: Plan, clock: TimeBase) -> list[str]:
    assert one.rate_hz is not None
    assert one.stamps is not None
    name = one.table.columns[one.stamps].name
    if clock.agrees_with(one.rate_hz) or not clock.even:
        lost = f", in which {clock.gaps.missing} samples are missing" if clock.gaps.count else ""
        return [f"the stamps of {quoted(name)}{lost} are not used: --time {quoted(name)} does"] if lost else []
    said = f"the nominal rate is {one.rate_hz:g} Hz, the stamps of {quoted(name)} say {clock.said()}"
    return [f"contradiction: {said}; give --time {quoted(name)} instead of --rate if they are right"]
