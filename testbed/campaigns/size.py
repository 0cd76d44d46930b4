"""What a sweep takes, told before it begins."""

from __future__ import annotations

import contextlib
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

from testbed.campaigns.agenda import CHUNK
from testbed.campaigns.lockstep import Lockstep
from testbed.chain.forecast import memory_so_far

if TYPE_CHECKING:
    from testbed.campaigns.study import Study

# Base samples that are played to see how long they take, after as many that compile.
_TRIED = 4000
# Of a row on the disk, and of the page's share of it [byte].
_ROW_BYTES = 400


@dataclass(frozen=True)
class Size:
    """About what a sweep takes: `runs` at the most, processor time [s], memory and disk [byte]."""

    cases: int
    runs: int
    cpu_seconds: float
    memory_bytes: int
    disk_bytes: int


def warm(study: Study) -> None:
    """Play the first moments of the first case, so that what it compiles stands in the cache that workers read.

    Parameters
    ----------
    study : Study
        What will be played.
    """
    scenario = study.cases[0].scenario
    # A case that fails is a row with its reason, which whoever plays it writes.
    with contextlib.suppress(Exception):
        Lockstep([scenario], study.seeds[:1]).advance(min(_TRIED, scenario.n_time))


def size_of(study: Study, workers: int = 1) -> Size:
    """Play the first moments of the first case under the seeds of one task, and return what all of it takes.

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
    scenario, seeds = study.cases[0].scenario, study.seeds[:CHUNK]
    begun = time.process_time()
    lockstep = Lockstep([scenario], seeds)
    tried = max(1, min(_TRIED, scenario.n_time // 2))
    start = time.process_time() - begun
    lockstep.advance(tried)
    begun = time.process_time()
    lockstep.advance(min(tried, scenario.n_time - tried) or tried)
    per_sample = (time.process_time() - begun) / tried
    chunks = len(study.cases) * -(-len(study.seeds) // CHUNK)
    share = len(study.seeds) / (CHUNK * -(-len(study.seeds) // CHUNK))
    rows = len(study.cases) * len(study.seeds) * (len(scenario.sensors) + len(scenario.fusion))
    return Size(
        cases=len(study.cases),
        runs=len(study.cases) * len(study.seeds),
        cpu_seconds=chunks * (start + share * per_sample * scenario.n_time),
        memory_bytes=workers * memory_so_far(),
        disk_bytes=_ROW_BYTES * rows,
    )


def sweep_words(size: Size) -> str:
    """Return what a sweep takes, in words.

    Parameters
    ----------
    size : Size
        Of the sweep.
    """
    spent = f"{size.cpu_seconds:.0f} s" if size.cpu_seconds < 600.0 else f"{size.cpu_seconds / 60.0:.0f} min"
    room = f"{size.memory_bytes / 1e6:.0f} MB of memory, {size.disk_bytes / 1e6:.3g} MB of disk"
    return f"{size.cases} cases, at most {size.runs} runs, about {spent} of processor time, {room}"
