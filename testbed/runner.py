"""Running a scenario: the chain on one side, what people look at on the other."""

from __future__ import annotations

import platform
from contextlib import ExitStack
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import testbed
from testbed.errors import RunError
from testbed.metrics import ErrorMetrics, floor_density, floor_rmse
from testbed.pipeline import Chain, simulate
from testbed.results import MemoryStore, Run, assemble, first_due
from testbed.store import NetcdfStore, RunFolder, failing_as_run_error, open_run, write_metrics, write_scenario

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from testbed.pipeline import RunBlock
    from testbed.scenario import Scenario

    Progress = Callable[[float], None]

_LIBRARIES = ("mujoco", "numpy", "scipy", "numba", "rerun-sdk")


def run(
    scenario: Scenario,
    *,
    out: str | Path | None = None,
    seed: int | None = None,
    block: float = 1.0,
    progress: Progress | None = None,
) -> Run:
    """Run a scenario.

    Parameters
    ----------
    scenario : Scenario
        From `load_scenario`.
    out : str or Path, optional
        Run folder to write; then the signals are read from it when they are asked for. Without it they are kept in memory.
    seed : int, optional
        Instead of the scenario's.
    block : float, optional
        Length of a block [s]; the signals do not depend on it.
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
        If `out` cannot be written or holds something else.
    """
    if not block > 0.0:
        msg = f"block: expected more than 0 s, got {block!r}"
        raise ValueError(msg)
    scenario = scenario if seed is None else scenario.with_seed(seed)
    if out is None:
        return _run_in_memory(scenario, block, progress)
    return _run_to_folder(scenario, Path(out), block, progress)


def _run_in_memory(scenario: Scenario, block: float, progress: Progress | None) -> Run:
    chain, blocks = simulate(scenario, block)
    memory, judge = MemoryStore(chain.rates), Judge(scenario, chain)
    for part in blocks:
        memory.write(part)
        judge.write(part)
        if progress is not None:
            progress((part.start + part.n_time) / chain.rates["base"])
    return assemble(memory.groups(), judge.metrics())


def _run_to_folder(scenario: Scenario, out: Path, block: float, progress: Progress | None) -> Run:
    # The recording's libraries are heavy and of no use to a run in memory.
    from testbed.recording import RecordingWriter
    from testbed.report import write_report

    with ExitStack() as stack:
        folder = stack.enter_context(RunFolder(out))
        stack.enter_context(failing_as_run_error(str(out)))
        chain, blocks = simulate(scenario, block)
        judge = Judge(scenario, chain)
        attributes = {
            "scenario": scenario.name,
            "seed": scenario.frame.seed,
            **{f"{k}_version": v for k, v in versions().items()},
        }
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
            for sink in (netcdf, judge, recording):
                sink.write(part)
            if progress is not None:
                progress((part.start + part.n_time) / chain.rates["base"])
        netcdf.close()
        recording.close()
        write_metrics(folder.path, judge.metrics())
        write_scenario(folder.path, scenario.resolved(), versions())
        write_report(folder.path)
        return open_run(folder.finish())


class Judge:
    """Accumulates the metrics of every sensor and filter after `settle`.

    Parameters
    ----------
    scenario : Scenario
        What runs.
    chain : Chain
        Its stages (for the sample rates).
    """

    def __init__(self, scenario: Scenario, chain: Chain) -> None:
        self._scenario = scenario
        self._rates = chain.rates
        self._errors = {name: ErrorMetrics(scenario.lines) for name in (*scenario.sensors, *scenario.fusion)}

    def write(self, block: RunBlock) -> None:
        """Add a block."""
        for name, readings in block.sensors.items():
            self._add(name, block, readings, None)
        for name, estimate in block.fusion.items():
            self._add(name, block, estimate.rate, estimate.std)

    def _add(self, name: str, block: RunBlock, rate: Any, std: Any) -> None:
        ratio = round(self._rates["base"] / self._rates[name])
        first = first_due(block.start, self._rates["base"], self._rates[name])
        truth = block.truth.rate[first * ratio - block.start :: ratio]
        settled = max(-(-round(self._scenario.frame.settle * self._rates["base"]) // ratio) - first, 0)
        t = np.arange(first, first + rate.size)[settled:] / self._rates[name]
        self._errors[name].add(t, rate[settled:], truth[settled:], None if std is None else std[settled:])

    def metrics(self) -> dict[str, Any]:
        """Return the content of metrics.json."""
        frame = self._scenario.frame
        psds = {name: sensor.input_noise_psd for name, sensor in self._scenario.sensors.items() if sensor.noise}
        floor = floor_rmse(list(psds.values()), frame.bandwidth) if len(psds) == len(self._scenario.sensors) else None
        floor_deg = None if floor is None else float(np.rad2deg(floor))
        sensors = {name: self._errors[name].result() for name in self._scenario.sensors}
        fusion = {
            name: {
                **self._errors[name].result(),
                **self._errors[name].consistency(),
                "floor_rmse_deg_s": floor_deg,
                "optimum_rmse_deg_s": None,
            }
            for name in self._scenario.fusion
        }
        return {
            "scenario": self._scenario.name,
            "seed": frame.seed,
            "duration_s": frame.duration,
            "settle_s": frame.settle,
            "bandwidth_hz": frame.bandwidth,
            "versions": versions(),
            "sensors": sensors,
            "fusion": fusion,
            "floor_density": None if floor is None else _floor_curve(psds, frame.bandwidth),
            "expectations": self._expectations({**sensors, **fusion}),
        }

    def _expectations(self, results: Mapping[str, dict[str, Any]]) -> list[dict[str, Any]]:
        rows = []
        for bound in self._scenario.expect:
            value = results[bound.subject].get(bound.metric)
            rows.append(
                {
                    "subject": bound.subject,
                    "metric": bound.metric,
                    "bound": f"{bound.relation} {bound.limit:g}",
                    "value": value,
                    "met": bound.met(value),
                }
            )
        return rows


def _floor_curve(psds: Mapping[str, Any], bandwidth: float) -> dict[str, list[float]]:
    """Return the floor as a root density in deg/s/sqrt(Hz), for the report."""
    freq = np.logspace(-3, np.log10(bandwidth), 121)
    return {
        "frequency_hz": freq.tolist(),
        "density": np.rad2deg(np.sqrt(floor_density(list(psds.values()), freq))).tolist(),
    }


def versions() -> dict[str, str]:
    """Return the versions that a result depends on."""
    return {
        "testbed": testbed.__version__,
        "python": platform.python_version(),
        **{name: metadata.version(name) for name in _LIBRARIES},
    }


__all__ = ["Judge", "RunError", "run", "versions"]
