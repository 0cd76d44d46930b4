"""The map that a recording's own words propose, and where they leave something open."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from testbed.errors import RunError, ScenarioError
from testbed.logs.logmap import ChannelMap, TimeMap
from testbed.logs.names import QUANTITIES
from testbed.logs.plan import Plan, channels_of, plan
from testbed.logs.reader import short_names
from testbed.logs.readers.text import TextTable

if TYPE_CHECKING:
    from pathlib import Path

    from testbed.logs.table import Table

_MOST_CHANNELS = 64


@dataclass(frozen=True)
class Proposal:
    """What a recording's own words propose.

    Parameters
    ----------
    plans : list of Plan
        How each channel is read.
    open : tuple of str
        What they leave open, with what would say it.
    """

    plans: list[Plan]
    open: tuple[str, ...]


def propose(table: Table) -> Proposal:
    """Return how the channels of a file are read, as far as its own words say.

    Parameters
    ----------
    table : Table
        The file.

    Returns
    -------
    Proposal
        At most 64 channels; the rest is told.
    """
    plans: list[Plan] = []
    left: list[str] = []
    places = channels_of(table) or list(range(len(table.columns)))
    for place in places[:_MOST_CHANNELS]:
        wanted = ChannelMap(column=str(place + 1))
        try:
            plans.append(plan(table.columns[place].name, wanted, table))
        except ScenarioError as error:
            left += [f"{problem.message} ({problem.key})" for problem in error.problems]
            plans.append(_untimed(table, place))
    if len(places) > _MOST_CHANNELS:
        left.append(f"{len(places) - _MOST_CHANNELS} of {len(places)} channels were left out")
    plans = short_names(plans)
    left += [unsaid(one) for one in plans if unsaid(one)]
    return Proposal(plans, tuple(dict.fromkeys(left)))


def _untimed(table: Table, place: int) -> Plan:
    """Return how a channel is read whose time is not clear: without."""
    found = plan(table.columns[place].name, ChannelMap(column=str(place + 1), time=TimeMap(rate=1.0)), table)
    return replace(found, rate_hz=None, stamps=None)


def unsaid(one: Plan) -> str:
    """Return what a file's own words leave open of a channel, with what would say it; empty if nothing.

    Parameters
    ----------
    one : Plan
        How it is read.
    """
    if not one.quantity:
        return f"{one.name}: unit (--unit, or --scale of a count)"
    if one.quantity == "angle" and one.kind is None:
        return f"{one.name}: increment or angle (--kind)"
    if one.stamps is None and one.rate_hz is None:
        return f"{one.name}: sample rate (--rate) or column of the time (--time)"
    return ""


def map_data(proposed: Proposal, file: str) -> dict[str, Any]:
    """Return a proposal as the content of a map; what is open is left out.

    Parameters
    ----------
    proposed : Proposal
        From `propose`.
    file : str
        Path of the recording as the map is to name it.
    """
    channels = {one.name: _channel(one) for one in proposed.plans}
    return {"file": file, "channels": channels, **_text(proposed.plans[0].table if proposed.plans else None)}


def _channel(one: Plan) -> dict[str, Any]:
    column = one.table.columns[one.value]
    found: dict[str, Any] = {"column": column.name}
    if one.unit:
        counted = one.unit[:1].isdigit() and one.quantity in QUANTITIES
        found["scale" if counted else "unit"] = one.unit
    if one.kind:
        found["kind"] = one.kind
    if one.stamps is not None:
        found["time"] = {"column": one.table.columns[one.stamps].name, "unit": _second(one.time_unit)}
    elif one.rate_hz is not None:
        found["time"] = {"rate": f"{one.rate_hz!r} Hz"}
    return found


def _second(unit_s: float) -> str:
    return {1.0: "s", 1e-3: "ms", 1e-6: "us", 1e-9: "ns"}.get(unit_s, f"{unit_s:.12g} s")


def _text(table: Table | None) -> dict[str, Any]:
    inner = getattr(table, "inner", table)
    if not isinstance(inner, TextTable):
        return {}
    dialect = inner.dialect
    asked = {key: value for key, value in vars(inner.said).items() if value}
    return {
        **asked,
        "separator": {"\t": "tab", " ": "blank"}.get(dialect.separator, dialect.separator),
        "decimal": dialect.decimal,
        "encoding": dialect.encoding,
    }


def write_map(path: Path, source: Path, proposed: Proposal) -> None:
    """Write the proposed map, with what it leaves open as comments.

    Parameters
    ----------
    path : Path
        The map.
    source : Path
        The recording.
    proposed : Proposal
        From `propose`.

    Raises
    ------
    RunError
        If it cannot be written.
    """
    import io

    from ruamel.yaml import YAML

    yaml = YAML(typ="safe", pure=True)
    yaml.default_flow_style = False
    yaml.sort_base_mapping_type_on_output = False
    stream = io.StringIO()
    yaml.dump(map_data(proposed, os.path.relpath(source, path.parent)), stream)
    head = "".join(f"# to be said: {text}\n" for text in proposed.open)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(head + stream.getvalue(), encoding="utf-8")
    except OSError as error:
        msg = f"{path} could not be written: {error.strerror or error}"
        raise RunError(msg) from error
