"""The metrics of a run: every sensor and filter against the truth, beside what no filter can get below."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.fusion.belief import declared
from testbed.judging.table_facts import TableMetrics
from testbed.metrics.consistency import Consistency
from testbed.metrics.errors import ErrorMetrics, floor_density, floor_rmse
from testbed.runs.block import first_due
from testbed.runs.metrics import RunMetrics
from testbed.scenario.departures import departures

if TYPE_CHECKING:
    from collections.abc import Mapping

    from testbed.runs.block import RunBlock
    from testbed.scenario.model import Scenario
    from testbed.scenario.step_choice import StepChoice


class Judge:
    """Accumulates the metrics of the turntable and of every sensor and filter after `settle`.

    Parameters
    ----------
    scenario : Scenario
        What runs.
    rates : mapping of str to float
        Sample rate [Hz] of ``base`` and of every sensor and filter by its name.
    step : StepChoice
        How the plant is integrated.
    """

    def __init__(self, scenario: Scenario, rates: Mapping[str, float], step: StepChoice) -> None:
        self._scenario = scenario
        self._rates = rates
        # A sensor may lose readings; an estimate that is not a number is a failure and stays undefined.
        span = (scenario.frame.settle, scenario.frame.duration)
        self._errors = {name: ErrorMetrics(scenario.lines, gaps=True, span=span) for name in scenario.sensors}
        self._errors |= {name: ErrorMetrics(scenario.lines, span=span) for name in scenario.fusion}
        self._consistency = {name: Consistency() for name in scenario.fusion}
        self._table = TableMetrics(scenario, step)

    def write(self, block: RunBlock) -> None:
        """Add a block."""
        self._table.write(block)
        for name, readings in block.sensors.items():
            self._add(name, block, readings, None)
        for name, estimate in block.fusion.items():
            error, settled = self._add(name, block, estimate.rate, estimate.std)
            self._consistency[name].add(error, estimate.std[settled:], estimate.diagnostics, settled)

    def _add(self, name: str, block: RunBlock, rate: Any, std: Any) -> tuple[Any, int]:
        """Add a block of readings or estimates; return the error after `settle`, and at which sample of the block that
        begins.
        """
        ratio = round(self._rates["base"] / self._rates[name])
        first = first_due(block.start, self._rates["base"], self._rates[name])
        truth = block.truth.rate[first * ratio - block.start :: ratio]
        settled = max(-(-round(self._scenario.frame.settle * self._rates["base"]) // ratio) - first, 0)
        t = np.arange(first, first + rate.size)[settled:] / self._rates[name]
        self._errors[name].add(t, rate[settled:], truth[settled:], None if std is None else std[settled:])
        return rate[settled:] - truth[settled:], settled

    def metrics(self, versions: Mapping[str, str] | None = None) -> RunMetrics:
        """Return the metrics of what was written.

        Parameters
        ----------
        versions : mapping of str to str, optional
            Of what the result depends on, to be noted with it.
        """
        frame = self._scenario.frame
        psds = {name: sensor.input_noise_psd for name, sensor in self._scenario.sensors.items() if sensor.noise}
        floor = floor_rmse(list(psds.values()), frame.bandwidth) if len(psds) == len(self._scenario.sensors) else None
        floor_deg = None if floor is None else float(np.rad2deg(floor))
        optimum_deg, of_lines = (None, {}) if floor is None else self._optima()
        sensors = {name: self._errors[name].result() for name in self._scenario.sensors}
        fusion = {
            name: {
                "belief": declared(spec.belief),
                **self._errors[name].result(),
                **self._errors[name].consistency(),
                "floor_rmse_deg_s": floor_deg,
                "optimum_rmse_deg_s": optimum_deg,
                "consistency": self._consistency[name].result(),
            }
            for name, spec in self._scenario.fusion.items()
        }
        for row in fusion.values():
            for line in row["lines"]:
                line["optimum_deg_s"] = of_lines.get(line["frequency_hz"])
        from testbed.judging.budget import budget_summary

        found = {
            "scenario": self._scenario.name,
            "seed": frame.seed,
            "duration_s": frame.duration,
            "settle_s": frame.settle,
            "bandwidth_hz": frame.bandwidth,
            "turntable": self._table.result(),
            "sensors": sensors,
            "fusion": fusion,
            "floor_density": None if floor is None else _floor_curve(psds, frame.bandwidth),
            "budget": None if floor is None else budget_summary(psds, frame.bandwidth),
            "expectations": self._expectations({**sensors, **fusion}),
            "versions": dict(versions or {}),
            "setup": departures(self._scenario),
            "plugins": [asdict(plugin) for plugin in self._scenario.plugins],
        }
        return RunMetrics.model_validate(found)

    def _optima(self) -> tuple[float | None, dict[float, float]]:
        """Return what the best fixed filter of this very signal leaves [deg/s], and of each line alone, by frequency
        [Hz].

        One value for all filters; None and nothing without lines.
        """
        lines = [line for name in [*self._scenario.fusion][:1] for line in self._errors[name].truth_lines()]
        # A table that does not move has no lines in its truth, only arithmetic noise.
        moving = [(freq, amplitude) for freq, amplitude in lines if amplitude > np.deg2rad(1e-9)]
        if not moving:
            return None, {}
        from testbed.judging.budget import signal_optima

        rates = {name: self._rates[name] for name in self._scenario.sensors}
        best = signal_optima(self._scenario.sensors, rates, [lines, *([line] for line in moving)])
        if best is None:
            return None, {}
        whole, *alone = (float(np.rad2deg(one.rmse)) for one in best)
        return whole, {freq: value for (freq, _), value in zip(moving, alone, strict=True)}

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
