"""How much disk a run takes, known from its first block."""

from __future__ import annotations

import shutil
from typing import TYPE_CHECKING

from testbed.errors import Problem, ScenarioError
from testbed.runs.attributes import is_precise
from testbed.runs.block import columns

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from testbed.runs.block import RunBlock

# What compression leaves, times and smooth truths shrinking more than noise. Recording, report and metrics are bounded.
_KEPT, _OTHER_FILES = 0.6, 10 << 20
_SPARE = 1.05


def disk_bytes(block: RunBlock, rates: Mapping[str, float], n_time: int) -> int:
    """Return about how large the folder of a run will be [byte].

    Parameters
    ----------
    block : RunBlock
        Any of its blocks: what signals there are.
    rates : mapping of str to float
        Of ``base`` and of every sensor and filter [Hz].
    n_time : int
        Base samples of the run.
    """
    per_sample = 0.0
    for _, name, _, rate, _ in columns(block, rates):
        per_sample += (8 if is_precise(name) else 4) * rate / rates["base"]
    return round(_KEPT * per_sample * n_time) + _OTHER_FILES


def require_space(place: Path, needed: int) -> None:
    """Refuse a run that its disk cannot hold.

    Parameters
    ----------
    place : Path
        A folder on that disk.
    needed : int
        Size of the run [byte].

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
        raise ScenarioError([Problem(msg, file=str(place))])
