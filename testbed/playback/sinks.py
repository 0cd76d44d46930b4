"""What of a replay goes to disk block by block: run.nc and the recording, as far as they are wanted."""

from __future__ import annotations

from typing import TYPE_CHECKING

from testbed.chain.versions import versions
from testbed.runs.attributes import provenance
from testbed.runs.folder import SIGNALS
from testbed.runs.netcdf import NetcdfStore
from testbed.runs.size import disk_bytes, require_space

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from contextlib import ExitStack
    from pathlib import Path

    from testbed.chain.sinks import Sink
    from testbed.playback.lineup import Lineup
    from testbed.runs.block import PlayedBlock, RunBlock

# Of the recording, what holds every sample [s], and how many at the least.
_DETAIL, _FEWEST = 2.0, 1000


class Room:
    """Refuses a replay that its disk cannot hold, by its first block; arguments as of `replay_sinks`, with the place
    where its folder will appear, and the rates of all that it writes [Hz].
    """

    def __init__(
        self,
        folder: Path,
        out: Path,
        lineup: Lineup,
        rates: Mapping[str, float],
        settle: float,
        outputs: Sequence[str],
    ) -> None:
        self._folder, self._out, self._lineup, self._rates = folder, out, lineup, rates
        self._settle, self._outputs = settle, outputs

    def write(self, block: RunBlock | PlayedBlock) -> None:
        """Look at the disk before the first block; ScenarioError if it is too small."""
        if block.start:
            return
        lineup = self._lineup
        detail = _detail(lineup, self._settle)
        needed = disk_bytes(block, self._rates, lineup.n_time, detail, self._outputs)
        stamps = lineup.stamps_ns or {}
        times = sum(one.nbytes for one in stamps.values()) if "netcdf" in self._outputs else 0
        require_space(self._folder, needed + times, self._out)

    def close(self) -> None:
        """Do nothing."""


def _detail(lineup: Lineup, settle: float) -> tuple[float, float]:
    """Return from when to when the recording holds every sample [s]."""
    return settle, min(settle + max(_DETAIL, _FEWEST / lineup.rates["base"]), lineup.duration)


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
            detail=_detail(lineup, settle),
            times_ns=lineup.stamps_ns,
            unit=lineup.rate_unit,
        )
        sinks.append(stack.enter_context(recording))
    return sinks
