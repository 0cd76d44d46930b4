"""How much disk a run takes, known from its first block."""

from __future__ import annotations

import shutil
from typing import TYPE_CHECKING

import numpy as np

from testbed.errors import Problem, ScenarioError
from testbed.runs.attributes import is_precise
from testbed.runs.block import columns
from testbed.runs.outputs import OUTPUTS

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from testbed.runs.block import PlayedBlock, RunBlock

# What is left of a diagnostic, those that stay at one value aside; a rate is stored as it is.
_KEPT = 0.5
# The recording: bytes of a sample with its time, two samples in each of 4000 bins.
_SAMPLE, _BINNED = 16, 8000
# Report, metrics, scenario, and what the headers of the other files take.
_OTHER_FILES = 600_000
_SPARE = 1.05


def disk_bytes(
    block: RunBlock | PlayedBlock,
    rates: Mapping[str, float],
    n_time: int,
    detail: tuple[float, float],
    outputs: Sequence[str] = OUTPUTS,
) -> int:
    """Return about how large the folder of a run will be [byte].

    Parameters
    ----------
    block : RunBlock or PlayedBlock
        Any of its blocks: what signals there are. One that stays at one value in it is taken to do so to the end.
    rates : mapping of str to float
        Of ``base`` and of every sensor and filter [Hz].
    n_time : int
        Base samples of the run.
    detail : tuple of float
        From when to when the recording holds every sample [s].
    outputs : sequence of str, optional
        What is written, of `OUTPUTS`.
    """
    stored = recorded = 0.0
    for group, name, _, rate, values in columns(block, rates):
        n = n_time * rate / rates["base"]
        if not values.size or np.ptp(values) != 0.0:
            stored += 8 * n if is_precise(name) else _KEPT * 4 * n
        recorded += min(n, _BINNED)
        if name == "rate":
            lines = 2 if group.startswith("fusion/") else 1  # the error beside the estimate
            recorded += lines * min(n, (detail[1] - detail[0]) * rate)
    stored *= "netcdf" in outputs
    recorded *= "recording" in outputs
    return round(stored + _SAMPLE * recorded) + _OTHER_FILES


def require_space(place: Path, needed: int, name: Path) -> None:
    """Refuse a run that its disk cannot hold.

    Parameters
    ----------
    place : Path
        A folder on that disk.
    needed : int
        Size of the run [byte].
    name : Path
        Where it will appear, for the message.

    Raises
    ------
    ScenarioError
        If it has less room.
    """
    free = shutil.disk_usage(place).free
    if _SPARE * needed > free:
        msg = (
            f"the run takes about {needed / 1e9:.3g} GB, but its disk has room for {free / 1e9:.3g} GB: shorten the "
            "run, use fewer filters or choose another --out"
        )
        raise ScenarioError([Problem(msg, file=str(name))])
