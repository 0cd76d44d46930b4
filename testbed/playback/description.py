"""What stands in the scenario.yaml of a replay: the recording, its channels, how it was judged, and the filters."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from testbed.scenario.resolved import resolved_fusion

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from testbed.runs.metrics import ReplayMetrics
    from testbed.scenario.model import FilterSpec


def description(
    name: str,
    replayed: ReplayMetrics,
    specs: Mapping[str, FilterSpec],
    settle: float,
    duration: float,
    lines: Sequence[float],
) -> dict[str, Any]:
    """Return the description of a replay in SI; its part `fusion` is that of a scenario.

    Parameters
    ----------
    name : str
        Of the replay.
    replayed : ReplayMetrics
        The recording.
    specs : mapping of str to FilterSpec
        The filters.
    settle, duration : float
        From when to when it is judged [s].
    lines : sequence of float
        Frequencies that the reference is known to hold [Hz].
    """
    channels = {
        channel: {
            "column": found.column,
            "file": found.file,
            **({"unit": found.unit} if found.unit else {}),
            "rate": f"{found.rate_hz!r} Hz",
            "start": f"{found.start_s!r} s",
        }
        for channel, found in replayed.channels.items()
    }
    return {
        "name": name,
        "replay": {
            "log": replayed.log,
            "reference": replayed.reference,
            "channels": channels,
            **({"lines": [f"{line!r} Hz" for line in lines]} if lines else {}),
        },
        "duration": f"{duration!r} s",
        "settle": f"{settle!r} s",
        "fusion": resolved_fusion(specs),
    }
