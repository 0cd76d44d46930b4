"""Replaying a recording: read, judged before it is used, sent through the filters, kept as a run."""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.chain.interrupt import held_interrupts
from testbed.chain.versions import versions
from testbed.errors import Problem, ScenarioError, quoted
from testbed.inputs.plugins import load_plugins
from testbed.logs.clock import NANO
from testbed.logs.options import saying_keys
from testbed.logs.reader import is_map
from testbed.notebook import Run, open_run
from testbed.playback.cross import sensor_agreement
from testbed.playback.description import description
from testbed.playback.filters import filter_specs
from testbed.playback.judge import ReplayJudge
from testbed.playback.judged import finding_entry, judged
from testbed.playback.lineup import Lineup, line_up
from testbed.playback.player import play_through, start_filters
from testbed.playback.reel import Reel, wind
from testbed.playback.sinks import Room, replay_sinks
from testbed.playback.source import OpenedSource, ReplaySource, open_source
from testbed.runs.folder import RunFolder, check_free, failing_as_run_error, write_metrics, write_scenario
from testbed.runs.metrics import ReplayMetrics, RunMetrics
from testbed.runs.outputs import chosen, require_place
from testbed.runs.results import MemoryStore
from testbed.signals import BLOCK

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from testbed.chain.sinks import Sink
    from testbed.fusion.analysis.finding import Verdict
    from testbed.logs.channel import Log, LogChannel
    from testbed.logs.logmap import LogMap
    from testbed.runs.block import PlayedBlock
    from testbed.scenario.model import FilterSpec
    from testbed.signals import FloatArray

    Progress = Callable[[float], None]

# Of a record that nothing is said of, this much is not judged, but at most so long [s].
_SETTLING, _LONGEST_SETTLING = 0.1, 10.0


@dataclass(frozen=True)
class Playback:
    """A recording that is ready to be played.

    Parameters
    ----------
    source : ReplaySource
        Where it is from.
    lineup : Lineup
        Its sensors on one time base.
    specs : mapping of str to FilterSpec
        The filters.
    facts : ReplayMetrics
        What is said of it.
    settle : float
        From when on it is judged [s].
    verdict : Verdict
        What stands against it, and what of that was put right.
    lines : tuple of float
        Frequencies that the reference is known to hold [Hz].
    plugins : tuple
        What was loaded.
    """

    source: ReplaySource
    lineup: Lineup
    specs: Mapping[str, FilterSpec]
    facts: ReplayMetrics
    settle: float
    verdict: Verdict
    lines: tuple[float, ...] = ()
    plugins: tuple[Any, ...] = ()

    @property
    def name(self) -> str:
        """Of the recording."""
        return self.source.name

    @property
    def rates(self) -> dict[str, float]:
        """Sample rate [Hz] of ``base`` and of every sensor and filter."""
        return {**self.lineup.rates, **dict.fromkeys(self.specs, self.lineup.rates["base"])}


def replay(
    log: Log | str | Path | Sequence[str | Path],
    filters: Iterable[str] | Mapping[str, Any] | str | Path = (),
    *,
    map: LogMap | Mapping[str, Any] | str | Path | None = None,
    belief: Mapping[str, Any] | str | Path | None = None,
    start: str | None = None,
    fix: bool = False,
    settle: float | None = None,
    lines: Sequence[float] = (),
    out: str | Path | None = None,
    outputs: Iterable[str] | None = None,
    block: int = BLOCK,
    plugins: Iterable[str] = (),
    progress: Progress | None = None,
) -> Run:
    r"""Send a recording through filters.

    Parameters
    ----------
    log : Log, str, Path or sequence of these
        What `testbed.read_log` returned; or the recording, in consecutive files if there are several, a map that names
        it, or a run folder.
    filters : iterable of str, str, mapping or Path, optional
        Names of filters, also with commas between them; or filters by name with parameters, as under `fusion` in a
        scenario, or a file of them.
    map : LogMap, mapping, str or Path, optional
        Which channel is what; without it the file's own words must say enough. The channel that is called
        ``reference`` is taken for the truth; every other rate is a sensor.
    belief : mapping, str or Path, optional
        What the filters believe of the sensors, instead of what `filters` says: the name of a shipped belief, a file or
        a mapping; by default equation (39) with the presets' noise.
    start : {"unknown", "rest"}, optional
        What the filters know of the start, instead of what `filters` says; by default nothing.
    fix : bool, optional
        Put right what the verdict finds and what is safe: sign, unit, gain, offset and rate.
    settle : float, optional
        From when on it is judged [s]; by default a tenth of the record, at most 10 s.
    lines : sequence of float, optional
        Frequencies [Hz] that the reference is known to hold: gain and phase are given at them.
    out : str or Path, optional
        Run folder to write; then the signals are read from it when they are asked for.
    outputs : iterable of str, optional
        What to write into it, as for `testbed.run`.
    block : int, optional
        Samples of a block; the signals do not depend on it.
    plugins : iterable of str, optional
        Modules that are loaded first, as for `testbed.load_scenario`.
    progress : callable, optional
        Called after every block with the time that is done [s].

    Returns
    -------
    Run
        As `testbed.run` gives it; `truth` is the reference, and empty without one.

    Raises
    ------
    ScenarioError
        If the recording cannot be read or used, or a filter, belief or map does not fit it: everything at once.
    RunError
        If a plug-in fails, or the disk is full.
    ValueError
        If there are `outputs` and no folder that they go to.

    Examples
    --------
    A second at rest, as two sensors without noise would read it:

    >>> import pathlib, tempfile
    >>> folder = pathlib.Path(tempfile.mkdtemp())
    >>> for name, n in (("mhd_ars", 20_000), ("mems_gyro", 2_000)):
    ...     rows = "".join(f"{k * 1_000_000_000 // n},{k % 2}e-5\n" for k in range(n))
    ...     _ = (folder / f"{name}.csv").write_text("t [ns],w [rad/s]\n" + rows)
    >>> channels = {n: {"file": folder / f"{n}.csv", "column": "w"} for n in ("mhd_ars", "mems_gyro")}
    >>> run = replay([], ["kalman"], map={"channels": channels})
    >>> run.fusion["kalman"].rate.shape, run.metrics.replay.reference
    ((20000,), False)
    """
    require_place(outputs, out)
    wanted = None if outputs is None else tuple(outputs)
    check_target(out, wanted)
    made = prepare(
        log, filters, map=map, belief=belief, start=start, fix=fix, settle=settle, lines=lines, plugins=plugins
    )
    return play_back(made, out, outputs=wanted, block=block, progress=progress)


def check_target(out: str | Path | None, outputs: Iterable[str] | None) -> None:
    """Raise ScenarioError before a recording is read if there are no such outputs, or `out` holds something else."""
    chosen(outputs)
    if out is not None:
        check_free(Path(out))


def prepare(
    log: Log | str | Path | Sequence[str | Path],
    filters: Iterable[str] | Mapping[str, Any] | str | Path = (),
    *,
    fusion: str | Path | None = None,
    map: LogMap | Mapping[str, Any] | str | Path | None = None,
    belief: Mapping[str, Any] | str | Path | None = None,
    start: str | None = None,
    fix: bool = False,
    settle: float | None = None,
    lines: Sequence[float] = (),
    plugins: Iterable[str] = (),
    named: Callable[[str], None] | None = None,
) -> Playback:
    """Read a recording and what it is to go through; arguments as `replay`, names of filters and a file of them may
    both be given. `named` hears the recording's name before it is read.
    """
    if start not in {None, "unknown", "rest"}:
        raise ScenarioError([Problem(f"expected unknown or rest, got {quoted(start)}", "--start")])
    loaded = load_plugins(plugins)
    with saying_keys():
        opened = open_source([log] if isinstance(log, str | Path) else log, map)
    names, file = _asked(filters)
    specs = filter_specs(opened.sensors, names, fusion if file is None else file, belief, start, loaded)
    both = [name for name in specs if name in opened.sensors]
    if both:
        message = (
            f"is the name of a sensor too: give the filter another one, such as 'mine: {{type: {specs[both[0]].type}}}'"
        )
        raise ScenarioError([Problem(message, f"fusion.{both[0]}")])
    # What is wrong is told before a long recording is read.
    _check_asked(settle, lines, opened)
    if named is not None:
        named(opened.name)
    with saying_keys():
        source = opened.read()
        wound = [wind(channel) for channel in source.sensors.values()]
        reference = None if source.reference is None else wind(source.reference, middle=True)
    said = {name: 1.0 / abs(one.factor) for name, one in source.sensors.items() if one.kind == "rate"}
    reels, found = judged(wound, specs, said, fix=fix)
    lineup = line_up(reels, reference, source.log)
    chosen_settle = min(_SETTLING * lineup.duration, _LONGEST_SETTLING) if settle is None else settle
    if chosen_settle >= lineup.duration:
        message = f"expected less than the {lineup.duration:g} s of the recording, got {chosen_settle:g} s"
        raise ScenarioError([Problem(message, "--settle")])
    _check_lines(lines, lineup)
    facts = _facts(source, reels, reference, lineup)
    return Playback(source, lineup, specs, facts, chosen_settle, found, tuple(sorted(lines)), loaded.used)


def _asked(
    filters: Iterable[str] | Mapping[str, Any] | str | Path,
) -> tuple[Iterable[str], Mapping[str, Any] | str | Path | None]:
    """Return names of filters, and filters with parameters or their file."""
    if isinstance(filters, str) and not is_map(filters):
        return filters.split(","), None
    if isinstance(filters, Mapping | str | Path):
        return (), filters
    return filters, None


def play_back(
    made: Playback,
    out: str | Path | None = None,
    *,
    outputs: Iterable[str] | None = None,
    block: int = BLOCK,
    progress: Progress | None = None,
) -> Run:
    """Play what `prepare` made ready; arguments as `replay`."""
    if out is None:
        memory = MemoryStore(made.rates, None if made.lineup.stamps_ns is None else made.lineup.times())
        metrics = _played(made, [memory], block, progress)
        return Run.of(memory.groups(), metrics)
    wanted = chosen(outputs)
    with ExitStack() as stack:
        folder = stack.enter_context(RunFolder(Path(out)))
        reach = stack.enter_context(failing_as_run_error(str(out)))
        check_interrupt = stack.enter_context(held_interrupts())
        room = Room(folder.path, Path(out), made.lineup, made.rates, made.settle, wanted)
        sinks = [room, *replay_sinks(stack, folder.path, made.name, made.lineup, list(made.specs), made.settle, wanted)]

        def tick(done: float) -> None:
            reach(done)
            check_interrupt()
            if progress is not None:
                progress(done)

        metrics = _played(made, sinks, block, tick)
        for sink in sinks:
            sink.close()
        write_metrics(folder.path, metrics.to_dict())
        said = description(made.name, made.facts, made.specs, made.settle, made.lineup.duration, made.lines)
        write_scenario(folder.path, said, versions())
        if "report" in wanted:
            # Drawing is heavy.
            from testbed.report import write_report

            write_report(folder.path)
        check_interrupt()
        return open_run(folder.finish({"versions": versions(), "plugins": metrics.plugins, "outputs": list(wanted)}))


def _played(made: Playback, sinks: Sequence[Sink | MemoryStore], block: int, tick: Progress | None) -> RunMetrics:
    lineup = made.lineup
    known = lineup.references is not None
    judge = ReplayJudge(lineup.times(), made.settle, lineup.duration, made.specs, made.lines, reference=known)
    for part in play_through(lineup, start_filters(made.specs, lineup), block):
        judge.write(part, _reference(part, lineup))
        for sink in sinks:
            sink.write(part)
        if tick is not None:
            tick((part.start + part.n_time) / lineup.rates["base"])
    return RunMetrics.model_validate(
        {
            "scenario": made.name,
            "seed": None,
            "duration_s": lineup.duration,
            "settle_s": made.settle,
            "rate_unit": lineup.rate_unit,
            **judge.result(),
            "replay": made.facts,
            "findings": [finding_entry(one) for one in made.verdict.findings],
            "undecided": list(made.verdict.undecided),
            "cross": sensor_agreement(lineup, next(iter(made.specs.values())).belief, made.settle),
            "versions": versions(),
        }
    )


def _reference(part: PlayedBlock, lineup: Lineup) -> dict[str, FloatArray]:
    """Return the reference of a block at the instants of ``base`` and of every sensor."""
    if lineup.references is None:
        return {}
    spans = {name: (first, part.sensors[name].size) for name, first in part.first.items()}
    spans["base"] = part.start, part.n_time
    return {name: lineup.references[name][first : first + n] for name, (first, n) in spans.items()}


def _check_asked(settle: float | None, lines: Sequence[float], opened: OpenedSource) -> None:
    problems = []
    if settle is not None and not 0.0 <= settle < math.inf:
        problems.append(Problem(f"expected a time from 0 s on, got {settle:g} s", "--settle"))
    problems += [
        Problem(f"expected frequencies above 0 Hz, got {line:g} Hz", "--lines")
        for line in lines
        if not 0.0 < line < math.inf
    ]
    if lines and opened.reference is None:
        message = "gain and phase need a reference: name the channel that is the truth 'reference' in the map"
        problems.append(Problem(message, "--lines"))
    if problems:
        raise ScenarioError(problems)


def _check_lines(lines: Sequence[float], lineup: Lineup) -> None:
    half = 0.5 * lineup.rates["base"]
    problems = [
        Problem(f"expected frequencies below {half:g} Hz, half the fastest rate, got {line:g} Hz", "--lines")
        for line in lines
        if line >= half
    ]
    if problems:
        raise ScenarioError(problems)


def _channel(channel: LogChannel, reel: Reel, lineup: Lineup) -> dict[str, Any]:
    return {
        "column": channel.label.strip("'"),
        "file": str(channel.table.path),
        "unit": channel.unit or None,
        "rate_hz": reel.sample_rate_hz,
        "start_s": NANO * (reel.start_ns - lineup.start_ns),
        "n_time": int(reel.rate.size),
        "missing": reel.missing,
        "dropped": reel.doubled,
        "notes": [*channel.assumed, *channel.notes],
    }


def _of_reference(source: ReplaySource) -> list[str]:
    """Return what is taken for granted of a reference that has stamps of its own."""
    if source.reference is None or any(one.table is source.reference.table for one in source.sensors.values()):
        return []
    words = "the reference's clock is taken for that of the sensors, and nothing here compares the two"
    return [f"{words}: testbed identify --input reference tells its rate, and an offset as dead time"]


def _facts(source: ReplaySource, reels: Sequence[Reel], reference: Reel | None, lineup: Lineup) -> ReplayMetrics:
    channels = {
        reel.name: {
            **_channel(source.sensors[reel.name], reel, lineup),
            "rate_hz": lineup.rates[reel.name],
            "n_time": int(lineup.readings[reel.name].size),
            "missing": int(np.count_nonzero(np.isnan(lineup.readings[reel.name]))),
            "dropped": lineup.dropped[reel.name],
        }
        for reel in reels
    }
    known = None if reference is None or source.reference is None else _channel(source.reference, reference, lineup)
    formats = dict.fromkeys(channel.table.format for channel in source.sensors.values())
    return ReplayMetrics.model_validate(
        {
            "log": source.log,
            "format": "; ".join(formats),
            "reference": lineup.references is not None,
            "clock": lineup.clock_words(),
            "channels": channels,
            "reference_channel": known,
            "start_ns": lineup.start_ns,
            "notes": [*source.notes, *_of_reference(source)],
        }
    )
