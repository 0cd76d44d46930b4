"""What is to be replayed: files and a map, a file whose own words say enough, or a run."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from testbed.errors import Problem, ScenarioError, shortened
from testbed.logs.channel import Log
from testbed.logs.formats import open_table
from testbed.logs.logmap import LogMap
from testbed.logs.options import refusal
from testbed.logs.plan import ROTATIONS, Plan
from testbed.logs.proposal import propose, unsaid
from testbed.logs.reader import as_map, is_map, plans_of, read_plans
from testbed.runs.folder import SIGNALS
from testbed.runs.results import RunRecord

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from testbed.logs.channel import LogChannel
    from testbed.runs.signals import Signals

REFERENCE = "reference"
_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]{0,63}")


@dataclass(frozen=True)
class ReplaySource:
    """The channels of a recording that are rates or angles.

    Parameters
    ----------
    name : str
        Of the recording, for its run folder.
    log : str
        The file, or the map, as it was named.
    sensors : dict
        Channels by name.
    reference : LogChannel, optional
        The channel that is called ``reference``: what is taken for the truth.
    notes : tuple of str
        What was left out.
    """

    name: str
    log: str
    sensors: dict[str, LogChannel]
    reference: LogChannel | None
    notes: tuple[str, ...]


@dataclass(frozen=True)
class OpenedSource:
    """A recording of which it is known what is to be replayed, before it is read.

    Parameters
    ----------
    name, log, notes : str, str, tuple of str
        As of `ReplaySource`.
    sensors : tuple of str
        Names of the channels that are rates or angles.
    reference : str, optional
        Name of the one that is taken for the truth.
    channels : mapping of str to Plan or LogChannel
        All that it holds, to be read or read.
    """

    name: str
    log: str
    sensors: tuple[str, ...]
    reference: str | None
    notes: tuple[str, ...]
    channels: Mapping[str, Plan | LogChannel]

    def read(self) -> ReplaySource:
        """Return the channels read, those of one group of a file in one pass; ScenarioError if that fails."""
        wanted = (*self.sensors, *([] if self.reference is None else [self.reference]))
        chosen = {name: self.channels[name] for name in wanted}
        found = {name: one for name, one in chosen.items() if not isinstance(one, Plan)}
        found |= read_plans([one for one in chosen.values() if isinstance(one, Plan)])
        reference = None if self.reference is None else found[self.reference]
        return ReplaySource(self.name, self.log, {name: found[name] for name in self.sensors}, reference, self.notes)


def open_source(
    logs: Sequence[str | Path] | Log, map: LogMap | Mapping[str, Any] | str | Path | None = None
) -> OpenedSource:
    """Return what is to be replayed, not yet read.

    Parameters
    ----------
    logs : sequence of str or Path, or Log
        The recording, in consecutive files if there are several; a map that names them; a run folder or its ``run.nc``;
        or what `testbed.read_log` returned. Empty: the files that the map names.
    map : LogMap, mapping, str or Path, optional
        Which channel is what; without it a file's own words must say enough.

    Raises
    ------
    ScenarioError
        If something cannot be read, is missing or open: everything at once, with its remedy.
    """
    if isinstance(logs, Log):
        return _opened(logs.path, logs.channels)
    files = [Path(one) for one in logs]
    if len(files) == 1 and (folder := _run_folder(files[0])) is not None and map is None:
        return _planned(files[0], plans_of(folder / SIGNALS, _map_of_run(folder)))
    if map is None and len(files) == 1 and is_map(files[0]):
        files, map = [], files[0]
    if map is None:
        return _unmapped(files)
    found = as_map(map)
    assert found is not None
    if len(files) > 1:
        found, files = found.model_copy(update={"file": files}), []
    plans = plans_of(files[0] if files else None, found)
    place = files[0] if files else Path(map) if isinstance(map, str | Path) else plans[0].table.path
    return _planned(place, plans)


def _run_folder(path: Path) -> Path | None:
    """Return the run folder that a path is, or whose signals it is; None if it is none."""
    folder = path if path.is_dir() else path.parent
    return folder if (path.is_dir() or path.name == SIGNALS) and (folder / "metrics.json").is_file() else None


def _map_of_run(folder: Path) -> LogMap:
    """Return the map of a run: what its sensors read, in the order of its scenario, and the truth."""
    run = RunRecord.open(folder)

    def entry(group: str, signals: Signals) -> dict[str, Any]:
        even = {"rate": f"{signals.sample_rate_hz!r} Hz"}
        stamped = {"column": f"{group}/time", "unit": "s"}
        return {"column": f"{group}/rate", "unit": "rad/s", "time": stamped if signals.stamped else even}

    channels = {name: entry(f"sensors/{name}", run.sensors[name]) for name in run.metrics.sensors}
    if "rate" in run.truth:
        channels[REFERENCE] = entry("truth", run.truth)
    return LogMap.model_validate({"channels": channels}, context={"border": True})


def _unmapped(files: Sequence[Path]) -> OpenedSource:
    if not files:
        message = "expected a recording: name a file, or a map that does with --map"
        raise ScenarioError([Problem(message, "LOG")])
    if len(files) > 1:
        message = "expected a map with several files: testbed log inspect FILE --out log.yaml writes one"
        raise ScenarioError([Problem(message, "--map")])
    proposed = propose(open_table(files[0]))
    plans = [one for one in proposed.plans if one.quantity in ROTATIONS]
    others = tuple(f"{one.name}: " for one in proposed.plans if one not in plans)
    left = [text for text in proposed.open if not text.startswith(others)] if any(map(unsaid, plans)) else []
    if not plans or left:
        remedy = f"testbed log inspect {files[0]} --out log.yaml writes a map to fill in; give it with --map"
        words = left or [*proposed.open, "no column is a rate or an angle by its unit"]
        raise ScenarioError([Problem(f"to be said: {text}", "--map", str(files[0])) for text in words] + [
            Problem(remedy, "--map", str(files[0]))
        ])  # fmt: skip
    return _planned(files[0], [_named(one, plans) for one in plans])


def _named(one: Plan, plans: Sequence[Plan]) -> Plan:
    """Return a channel under the last part of its name, where that tells the channels apart."""
    short = [other.name.rpartition("/")[2] for other in plans]
    name = one.name.rpartition("/")[2]
    return replace(one, name=name) if short.count(name) == 1 else one


def _check_names(sensors: Iterable[str], place: Path) -> None:
    """Refuse names that a signal of a run cannot have: letters, digits and underscores, and not that of the clock."""
    odd = [name for name in sensors if not _NAME.fullmatch(name) or name == "base"]
    message = "expected a name of at most 64 letters, digits and underscores, and not 'base': give it one in a map"
    if odd:
        raise ScenarioError([Problem(message, f"channels.{shortened(name)}", str(place)) for name in odd])


def _planned(place: Path, plans: Iterable[Plan]) -> OpenedSource:
    return _opened(place, {one.name: one for one in plans})


def _opened(place: Path, channels: Mapping[str, Plan | LogChannel]) -> OpenedSource:
    turning = {name: one for name, one in channels.items() if one.quantity in ROTATIONS or one.kind is not None}
    others = [name for name in channels if name not in turning]
    notes = (f"{', '.join(others)}: neither a rate nor an angle, left out",) if others else ()
    sensors = tuple(name for name in turning if name.lower() != REFERENCE)
    reference = next((name for name in turning if name.lower() == REFERENCE), None)
    if not sensors:
        raise refusal(place, "expected a channel that is a rate or an angle beside the reference, got none")
    _check_names(sensors, place)
    stem = place.resolve().name.split(".")[0]
    name = place.resolve().parent.name if stem in {"log", "run", "data"} else stem
    return OpenedSource(name or "recording", str(place), sensors, reference, notes, channels)
