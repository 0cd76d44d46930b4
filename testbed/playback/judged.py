"""The verdict on a recording before anything is estimated from it, and what of it is put right."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from testbed.fusion.analysis.remedy import remedied
from testbed.fusion.analysis.verdict import verdict

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from testbed.fusion.analysis.finding import Finding, Verdict
    from testbed.playback.reel import Reel
    from testbed.scenario.model import FilterSpec


def judged(
    reels: Sequence[Reel], specs: Mapping[str, FilterSpec], said: Mapping[str, float], *, fix: bool
) -> tuple[list[Reel], Verdict]:
    """Return the sensors of a recording, put right if that is asked for, and what stands against them.

    Parameters
    ----------
    reels : sequence of Reel
        Of the sensors.
    specs : mapping of str to FilterSpec
        The filters; the belief of the first is held against the readings.
    said : mapping of str to float
        How many of the unit that was said of a sensor's readings are 1 rad/s [-].
    fix : bool
        Put right what is safe.
    """
    belief = next(iter(specs.values())).belief
    readings, stamps = {reel.name: reel.rate for reel in reels}, {reel.name: reel.stamps() for reel in reels}
    found = verdict(readings, stamps, belief, said)
    if not fix or not found.findings:
        return list(reels), found
    done = remedied(readings, stamps, found)
    return [reel.put_right(done.readings[reel.name], done.time_ns[reel.name]) for reel in reels], done.verdict


def finding_entry(finding: Finding) -> dict[str, Any]:
    """Return a finding as metrics.json has it, None where undefined.

    Parameters
    ----------
    finding : Finding
        Of the verdict.
    """
    values = {key: getattr(finding, key) for key in ("value", "lower", "upper")}
    return {
        "kind": finding.kind,
        "sensor": finding.sensor,
        **{key: value if math.isfinite(value) else None for key, value in values.items()},
        "unit": finding.unit,
        "remedy": finding.remedy,
        "fixed": finding.fixed,
    }
