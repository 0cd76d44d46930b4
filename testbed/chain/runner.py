"""Running a scenario: the chain on one side, what people look at on the other."""

from __future__ import annotations

import math
import platform
from contextlib import ExitStack
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any

from testbed._version import __version__
from testbed.chain.interrupt import held_interrupts
from testbed.chain.pipeline import simulate
from testbed.judging.judge import Judge
from testbed.notebook import Run, open_run
from testbed.runs.attributes import provenance
from testbed.runs.folder import RunFolder, failing_as_run_error, write_metrics, write_scenario
from testbed.runs.netcdf import NetcdfStore
from testbed.runs.results import MemoryStore
from testbed.runs.size import disk_bytes, require_space
from testbed.scenario.loader import as_scenario

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from testbed.scenario.model import Scenario

    Progress = Callable[[float], None]

_LIBRARIES = ("mujoco", "numpy", "scipy", "numba", "rerun-sdk")


def run(
    scenario: Scenario | str | Path | Mapping[str, Any],
    seed: int | None = None,
    out: str | Path | None = None,
    *,
    block: float | None = None,
    progress: Progress | None = None,
) -> Run:
    """Run a scenario.

    Parameters
    ----------
    scenario : Scenario, str, Path or mapping
        A scenario, its file, or its keys as `Scenario.from_dict` takes them.
    seed : int, optional
        Instead of the scenario's.
    out : str or Path, optional
        Run folder to write; then the signals are read from it when they are asked for. Without it they are kept in
        memory.
    block : float, optional
        Length of a block [s], 20 000 samples of the base clock if not given; the signals do not depend on it.
    progress : callable, optional
        Called after every block with the simulated time [s].

    Returns
    -------
    Run
        Signals in SI, and metrics.

    Raises
    ------
    RunError
        If the plant diverges, the motor saturates or the disk is full; says how far it got.
    ScenarioError
        If the scenario is bad, or `out` cannot be written or holds something else.

    Examples
    --------
    >>> still = {"name": "still", "duration": "0.1 s", "motion": [{"static": {}}], "turntable": {"mode": "fixed"}}
    >>> run(still, seed=3)
    <Run still, 0.1 s, seed 3>
    """
    if block is not None and not 0.0 < block < math.inf:
        msg = f"block: expected more than 0 s, and finite, got {block!r}"
        raise ValueError(msg)
    loaded = as_scenario(scenario)
    loaded = loaded if seed is None else loaded.with_seed(seed)
    if out is None:
        return _run_in_memory(loaded, block, progress)
    return _run_to_folder(loaded, Path(out), block, progress)


def _run_in_memory(scenario: Scenario, block: float | None, progress: Progress | None) -> Run:
    chain, blocks = simulate(scenario, block)
    memory, judge = MemoryStore(chain.rates), Judge(scenario, chain.rates, chain.step)
    for part in blocks:
        memory.write(part)
        judge.write(part)
        if progress is not None:
            progress((part.start + part.n_time) / chain.rates["base"])
    return Run.of(memory.groups(), judge.metrics(versions()))


def _run_to_folder(scenario: Scenario, out: Path, block: float | None, progress: Progress | None) -> Run:
    # The recording's libraries are heavy and of no use to a run in memory.
    from testbed.recording import RecordingWriter
    from testbed.report import write_report

    with ExitStack() as stack:
        folder = stack.enter_context(RunFolder(out))
        reach = stack.enter_context(failing_as_run_error(str(out)))
        check_interrupt = stack.enter_context(held_interrupts())
        scenario = scenario.kept_in(folder.path)
        chain, blocks = simulate(scenario, block)
        judge = Judge(scenario, chain.rates, chain.step)
        attributes = provenance(scenario.name, scenario.frame.seed, versions())
        netcdf = NetcdfStore(folder.path / "run.nc", chain.rates, scenario.frame.duration, attributes)
        stack.callback(netcdf.close)
        recording = stack.enter_context(
            RecordingWriter(
                folder.path / "recording.rrd",
                scenario_name=scenario.name,
                sample_rate_hz=chain.rates["base"],
                n_time=scenario.n_time,
                sensor_rates={name: chain.rates[name] for name in scenario.sensors},
                fusion_names=list(scenario.fusion),
                model=chain.turntable.model,
                settle=scenario.frame.settle,
                detail=scenario.detail,
            )
        )
        for part in blocks:
            if not part.start:
                require_space(folder.path, disk_bytes(part, chain.rates, scenario.n_time, scenario.detail))
            reach(part.start / chain.rates["base"])
            for sink in (netcdf, judge, recording):
                sink.write(part)
            if progress is not None:
                progress((part.start + part.n_time) / chain.rates["base"])
            check_interrupt()
        netcdf.close()
        recording.close()
        metrics = judge.metrics(versions())
        write_metrics(folder.path, metrics.to_dict())
        write_scenario(folder.path, scenario.resolved(folder.path), versions())
        write_report(folder.path)
        check_interrupt()
        return open_run(folder.finish({"versions": versions(), "plugins": metrics.plugins}))


def versions() -> dict[str, str]:
    """Return the versions that a result depends on."""
    return {
        "testbed": __version__,
        "python": platform.python_version(),
        **{name: metadata.version(name) for name in _LIBRARIES},
    }
