"""What of a replay goes to disk block by block: run.nc and the recording, as far as they are wanted."""

from __future__ import annotations

from typing import TYPE_CHECKING

from testbed.chain.versions import versions
from testbed.runs.attributes import provenance
from testbed.runs.folder import SIGNALS
from testbed.runs.netcdf import NetcdfStore

if TYPE_CHECKING:
    from collections.abc import Sequence
    from contextlib import ExitStack
    from pathlib import Path

    from testbed.chain.sinks import Sink
    from testbed.playback.lineup import Lineup

# Of the recording, what holds every sample [s], and how many at the least.
_DETAIL, _FEWEST = 2.0, 1000


def replay_sinks(
    stack: ExitStack,
    folder: Path,
    name: str,
    lineup: Lineup,
    filters: Sequence[str],
    settle: float,
    outputs: Sequence[str],
) -> list[Sink]:
    """Return the files of a replay that its blocks go to; they are closed with the stack, if not before.

    Parameters
    ----------
    stack : ExitStack
        Of the replay.
    folder : Path
        Where.
    name : str
        Of the recording.
    lineup : Lineup
        Its sensors on one time base.
    filters : sequence of str
        Their names.
    settle : float
        From when on it is judged [s].
    outputs : sequence of str
        What is wanted, of `testbed.runs.outputs.OUTPUTS`.
    """
    sinks: list[Sink] = []
    rates = {**lineup.rates, **dict.fromkeys(filters, lineup.rates["base"])}
    times = None if lineup.stamps_ns is None else lineup.times()
    if "netcdf" in outputs:
        netcdf = NetcdfStore(
            folder / SIGNALS, rates, lineup.n_time / rates["base"], provenance(name, None, versions()), times
        )
        stack.callback(netcdf.close)
        sinks.append(netcdf)
    if "recording" in outputs:
        # Its libraries are heavy and of no use to other replays.
        from testbed.recording import RecordingWriter

        recording = RecordingWriter(
            folder / "recording.rrd",
            scenario_name=name,
            sample_rate_hz=rates["base"],
            n_time=lineup.n_time,
            sensor_rates={sensor: rates[sensor] for sensor in lineup.sensors},
            fusion_names=list(filters),
            model=None,
            settle=settle,
            detail=(settle, min(settle + max(_DETAIL, _FEWEST / rates["base"]), lineup.duration)),
            times_ns=lineup.stamps_ns,
            unit=lineup.rate_unit,
        )
        sinks.append(stack.enter_context(recording))
    return sinks
