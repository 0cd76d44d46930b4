"""What of a run goes to disk block by block: run.nc and the recording, as far as they are wanted."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from testbed.chain.versions import versions
from testbed.runs.attributes import provenance
from testbed.runs.folder import SIGNALS

if TYPE_CHECKING:
    from collections.abc import Sequence
    from contextlib import ExitStack
    from pathlib import Path

    from testbed.chain.pipeline import Chain
    from testbed.runs.block import PlayedBlock, RunBlock
    from testbed.scenario.model import Scenario


class Sink(Protocol):
    """A file in the making."""

    def write(self, block: RunBlock | PlayedBlock) -> None:
        """Add a block."""

    def close(self) -> None:
        """Finish the file; a second time nothing happens."""


def open_sinks(
    stack: ExitStack,
    folder: Path,
    scenario: Scenario,
    chain: Chain,
    outputs: Sequence[str],
    live: str | None = None,
) -> list[Sink]:
    """Return the files of a run that its blocks go to; they are closed with the stack, if not before.

    Parameters
    ----------
    stack : ExitStack
        Of the run.
    folder : Path
        Where.
    scenario : Scenario
        What runs.
    chain : Chain
        Which runs it.
    outputs : sequence of str
        What is wanted, of `testbed.runs.outputs.OUTPUTS`.
    live : str, optional
        Address of a viewer that shows the recording while it is written.
    """
    sinks: list[Sink] = []
    if "netcdf" in outputs:
        from testbed.runs.netcdf import NetcdfStore

        attributes = provenance(scenario.name, scenario.frame.seed, versions())
        netcdf = NetcdfStore(folder / SIGNALS, chain.rates, scenario.frame.duration, attributes, chain.times)
        stack.callback(netcdf.close)
        sinks.append(netcdf)
    if "recording" in outputs:
        # Its libraries are heavy and of no use to other runs.
        from testbed.recording import RecordingWriter

        recording = RecordingWriter(
            folder / "recording.rrd",
            scenario_name=scenario.name,
            sample_rate_hz=chain.rates["base"],
            n_time=scenario.n_time,
            sensor_rates={name: chain.rates[name] for name in scenario.sensors},
            fusion_names=list(scenario.fusion),
            model=chain.turntable.model,
            settle=scenario.frame.settle,
            detail=scenario.detail,
            times_ns=chain.time_ns,
            unit=scenario.rate_unit,
            live=live,
        )
        sinks.append(stack.enter_context(recording))
    return sinks
