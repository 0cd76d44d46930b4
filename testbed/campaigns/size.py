"""What a sweep takes, told before it begins."""

from __future__ import annotations

import contextlib
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

from testbed.campaigns.agenda import CHUNK
from testbed.campaigns.evaluate import by_itself
from testbed.campaigns.lockstep import Lockstep
from testbed.chain.forecast import memory_so_far
from testbed.chain.pipeline import Chain
from testbed.judging.judge import Judge

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from testbed.campaigns.study import Study, Variation
    from testbed.scenario.model import Scenario

T = TypeVar("T")
# Base samples that are played to see how long they take, after as many that compile.
_TRIED = 4000
# On the disk [byte]: a row; a point of the page, with its place in the figures; page and parts without any; a case.
_ROW, _POINT, _PAGE, _CASE = 60, 600, 45_000, 300
# Of each process of a cluster beside those that play: the scheduler, and who watches over a worker [byte].
_WATCHER = 60_000_000
# From the start of a cluster until its workers play [s].
_BEGIN = 6.0


@dataclass(frozen=True)
class Size:
    """About what a sweep takes, compilation apart: `runs` at the most, processor time and time on so many processors as
    workers [s], memory and disk [byte].
    """

    cases: int
    runs: int
    cpu_seconds: float
    seconds: float
    memory_bytes: int
    disk_bytes: int


def warm(study: Study) -> None:
    """Play the first moments of the first and the last case under the seeds of one task, so that what they compile
    stands in the cache that workers read, and counts for no case.

    Parameters
    ----------
    study : Study
        What will be played.
    """
    # A case that fails is a row with its reason, which whoever plays it writes.
    with contextlib.suppress(Exception):
        for case in _ends(study):
            _tried(case.scenario, study.seeds[:CHUNK])


def size_of(study: Study, workers: int = 1) -> Size:
    """Play the first moments of the first and the last case under the seeds of one task, and return what all of it
    takes.

    Parameters
    ----------
    study : Study
        What would be played.
    workers : int, optional
        Processes, each with its memory.

    Raises
    ------
    RunError
        If it fails already there.
    """
    warm(study)
    cases, seeds = study.cases, study.seeds[:CHUNK]
    tried = [_tried(case.scenario, seeds) for case in _ends(study)]
    foreseen = [_foreseen(case.scenario, seeds[0]) for case in _ends(study)]
    chunks, share = -(-len(study.seeds) // CHUNK), len(study.seeds) / len(seeds)
    # What the first case finds out the others need not, as far as they are like it: the last one tells.
    starts = tried[0][0] + (len(cases) * chunks - 1) * tried[-1][0]
    starts += foreseen[0] + (len(cases) - 1) * foreseen[-1]
    per_sample = sum(each for _, each in tried) / len(tried)
    cpu = starts + share * per_sample * sum(case.scenario.n_time for case in cases)
    sources = max(len(case.scenario.sensors) + len(case.scenario.fusion) for case in (cases[0], cases[-1]))
    points, each = len(cases) * sources, memory_so_far()
    alone = workers == 1
    return Size(
        cases=len(cases),
        runs=len(cases) * len(study.seeds),
        cpu_seconds=cpu,
        seconds=cpu if alone else _BEGIN + cpu / workers,
        memory_bytes=each if alone else (1 + workers) * (each + _WATCHER),
        disk_bytes=_PAGE + _CASE * len(cases) + points * (_POINT + _ROW * len(study.seeds)),
    )


def _ends(study: Study) -> Sequence[Variation]:
    """Return the first and the last case, which differ most, or the only one."""
    return (study.cases[0], study.cases[-1])[: len(study.cases)]


def _tried(scenario: Scenario, seeds: Sequence[int]) -> tuple[float, float]:
    """Return what a task of a case takes once, and per base sample [s]."""
    tried = min(_TRIED, scenario.n_time)
    if by_itself(scenario):
        once, chain = _spent(lambda: Chain(scenario))
        judge = Judge(scenario, chain.rates, chain.step)
        each, _ = _spent(lambda: judge.write(chain.process(tried)))
        return len(seeds) * once, len(seeds) * each / tried
    once, lockstep = _spent(lambda: Lockstep([scenario], seeds))
    each, _ = _spent(lambda: lockstep.advance(tried))
    return once, each / tried


def _foreseen(scenario: Scenario, seed: int) -> float:
    """Return what a case works out ahead for all its tasks [s]; it is kept, so that nothing must have asked before."""
    return 0.0 if by_itself(scenario) else _spent(Lockstep([scenario], [seed]).foresee)[0]


def _spent(task: Callable[[], T]) -> tuple[float, T]:
    """Return the processor time of a call [s], and what it returned."""
    begun = time.process_time()
    found = task()
    return time.process_time() - begun, found


def sweep_words(size: Size) -> str:
    """Return what a sweep takes, in words.

    Parameters
    ----------
    size : Size
        Of the sweep.
    """
    room = f"{size.memory_bytes / 1e6:.0f} MB of memory, {size.disk_bytes / 1e6:.3g} MB of disk"
    spent = f"{_time(size.cpu_seconds)} of processor time in {_time(size.seconds)}"
    return f"{_number(size.cases, 'case')}, at most {_number(size.runs, 'run')}, about {spent}, {room}"


def _number(count: int, what: str) -> str:
    return f"{count} {what}" if count == 1 else f"{count} {what}s"


def _time(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 600.0 else f"{seconds / 60.0:.0f} min"
