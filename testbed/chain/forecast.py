"""What a run will take before it is made: samples, time, memory and disk, from a tried beginning of it."""

from __future__ import annotations

import resource
import sys
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

from testbed.chain.pipeline import Chain
from testbed.runs.outputs import OUTPUTS
from testbed.runs.size import disk_bytes
from testbed.signals import BLOCK

if TYPE_CHECKING:
    from collections.abc import Sequence

    from testbed.scenario.model import Scenario
    from testbed.scenario.step_choice import StepChoice

# Compiled functions are loaded in the first, the second is measured.
_WARM, _TRIED = 200, 1000
# Beside the chain, per byte that is written: compression, metrics and recording, on a core of 2020.
_SECONDS_PER_BYTE = 4e-8
# Once per run: recording, report.
_FIXED, _LIBRARIES = 3.0, 170 << 20
# Arrays of a block beside those that are written.
_WORKING = 3.0


@dataclass(frozen=True)
class Forecast:
    """About what a run takes.

    Parameters
    ----------
    samples : int
        Of the base clock.
    seconds : float
        On this machine, as it is now, compilation apart [s].
    memory_bytes, disk_bytes : int
        Of the process, and of the run folder.
    step : StepChoice
        How the plant is integrated.
    """

    samples: int
    seconds: float
    memory_bytes: int
    disk_bytes: int
    step: StepChoice


def forecast(scenario: Scenario, outputs: Sequence[str] = OUTPUTS) -> Forecast:
    """Play the first fraction of a second of a run, and return what all of it will take.

    Parameters
    ----------
    scenario : Scenario
        What would run.
    outputs : sequence of str, optional
        What it would write.

    Raises
    ------
    RunError
        If it fails already there.
    """
    samples = scenario.n_time
    chain = Chain(scenario)
    block = chain.tried(min(_WARM, samples))
    tried = min(_TRIED, samples - block.n_time)
    begin = time.process_time()
    if tried:
        block = chain.tried(tried)
    spent = (time.process_time() - begin) / max(tried, 1) + chain.untried_seconds
    disk = disk_bytes(block, chain.rates, samples, scenario.detail, outputs)
    per_block = _WORKING * disk / samples * min(BLOCK, samples)
    return Forecast(
        samples,
        spent * samples + _SECONDS_PER_BYTE * disk + _FIXED,
        memory_so_far() + _LIBRARIES + round(per_block),
        disk,
        chain.step,
    )


def memory_so_far() -> int:
    """Return the most memory that the process had so far [byte]; Linux counts in KiB."""
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return most if sys.platform == "darwin" else 1024 * most
