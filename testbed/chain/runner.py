"""Running a scenario: the chain on one side, what people look at on the other."""

from __future__ import annotations

import math
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

from testbed.chain.interrupt import held_interrupts
from testbed.chain.pipeline import simulate
from testbed.chain.sinks import open_sinks
from testbed.chain.versions import versions
from testbed.errors import quoted
from testbed.judging.judge import Judge
from testbed.notebook import Run, open_run
from testbed.runs.folder import RunFolder, failing_as_run_error, write_metrics, write_scenario
from testbed.runs.outputs import chosen, require_place
from testbed.runs.results import MemoryStore
from testbed.runs.size import disk_bytes, require_space
from testbed.scenario.loader import as_scenario
from testbed.signals import BLOCK

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from testbed.scenario.model import Scenario

    Progress = Callable[[float], None]


def run(
    scenario: Scenario | str | Path | Mapping[str, Any],
    seed: int | None = None,
    out: str | Path | None = None,
    *,
    outputs: Iterable[str] | None = None,
    block: float | None = None,
    progress: Progress | None = None,
    live: str | None = None,
) -> Run:
    """Run a scenario.

    Parameters
    ----------
    scenario : Scenario, str, Path or mapping
        A scenario, its file, or its keys as `Scenario.from_dict` takes them.
    seed : int, optional
        Instead of the scenario's.
    out : str or Path, optional
        Run folder to write; then the signals are read from it when they are asked for, and memory does not grow with
        the duration. Without it they are kept in memory, some 14 MB per simulated second of two sensors and three
        filters.
    outputs : iterable of str, optional
        What to write into that folder, of ``metrics``, ``netcdf``, ``recording``, ``report``; all if not given.
        Without ``netcdf`` the run has metrics only.
    block : float, optional
        Length of a block [s], 20 000 samples of the base clock if not given, 4 000 if it is shown `live`; the signals
        do not depend on it.
    progress : callable, optional
        Called after every block with the simulated time [s].
    live : str, optional
        Address of a Rerun viewer, such as ``rerun+http://127.0.0.1:9876/proxy``, that shows the recording while it is
        written.

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
        msg = f"block: expected more than 0 s, and finite, got {quoted(block)}"
        raise ValueError(msg)
    loaded = as_scenario(scenario)
    loaded = loaded if seed is None else loaded.with_seed(seed)
    require_place(outputs, out)
    if out is None:
        return _run_in_memory(loaded, block, progress)
    if live is not None and block is None:
        # Whoever looks on sees one block late.
        block = BLOCK / 5 / loaded.base_rate_hz
    return _run_to_folder(loaded, Path(out), chosen(outputs), block, progress, live)


def _run_in_memory(scenario: Scenario, block: float | None, progress: Progress | None) -> Run:
    chain, blocks = simulate(scenario, block)
    memory, judge = MemoryStore(chain.rates, chain.times), Judge(scenario, chain.rates, chain.step)
    for part in blocks:
        memory.write(part)
        judge.write(part)
        if progress is not None:
            progress((part.start + part.n_time) / chain.rates["base"])
    return Run.of(memory.groups(), judge.metrics(versions()))


def _run_to_folder(
    scenario: Scenario,
    out: Path,
    outputs: tuple[str, ...],
    block: float | None,
    progress: Progress | None,
    live: str | None,
) -> Run:
    with ExitStack() as stack:
        folder = stack.enter_context(RunFolder(out))
        reach = stack.enter_context(failing_as_run_error(str(out)))
        check_interrupt = stack.enter_context(held_interrupts())
        scenario = scenario.kept_in(folder.path)
        chain, blocks = simulate(scenario, block)
        judge = Judge(scenario, chain.rates, chain.step)
        sinks = open_sinks(stack, folder.path, scenario, chain, outputs, live)
        for part in blocks:
            if not part.start:
                needed = disk_bytes(part, chain.rates, scenario.n_time, scenario.detail, outputs)
                require_space(folder.path, needed, out)
            reach(part.start / chain.rates["base"])
            judge.write(part)
            for sink in sinks:
                sink.write(part)
            if progress is not None:
                progress((part.start + part.n_time) / chain.rates["base"])
            check_interrupt()
        for sink in sinks:
            sink.close()
        metrics = judge.metrics(versions())
        write_metrics(folder.path, metrics.to_dict())
        write_scenario(folder.path, scenario.resolved(folder.path), versions())
        about = {"versions": versions(), "plugins": metrics.plugins, "outputs": list(outputs)}
        if "report" in outputs:
            # Drawing is heavy.
            from testbed.report import write_report

            write_report(folder.path)
        check_interrupt()
        return open_run(folder.finish(about))
