"""The metrics of a run: every sensor and filter against the truth, beside what no filter can get below."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.fusion.belief import declared
from testbed.judging.bounds import Bounds
from testbed.judging.sights import pointing_judges, pointing_value
from testbed.judging.table_facts import TableMetrics
from testbed.metrics.consistency import Consistency
from testbed.metrics.errors import ErrorMetrics, floor_density
from testbed.runs.block import first_due
from testbed.runs.metrics import RunMetrics
from testbed.scenario.departures import departures

if TYPE_CHECKING:
    from collections.abc import Mapping

    from testbed.fusion.start import StartKind
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
        self._gated: dict[str, dict[str, int]] = {}
        self._table = TableMetrics(scenario, step)
        self._sights = pointing_judges(scenario, rates["base"])

    def write(self, block: RunBlock) -> None:
        """Add a block."""
        self._table.write(block)
        for name, readings in block.sensors.items():
            self._add(name, block, readings, None)
        for name, estimate in block.fusion.items():
            error, settled = self._add(name, block, estimate.rate, estimate.std)
            self._gated.setdefault(name, {}).update(_gated(estimate.diagnostics))
            self._consistency[name].add(error, estimate.std[settled:], estimate.diagnostics, settled)
        for name, sight in block.pointing.items():
            self._sights[name].process(sight, block.truth.rate)

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
        bounds = Bounds(self._scenario.sensors, self._rates)
        floors = {
            "floor_rmse_deg_s": in_deg(bounds.floor(frame.bandwidth)),
            "prior_floor_rmse_deg_s": in_deg(bounds.prior_floor(frame.bandwidth, frame.no_rate_below)),
        }
        settled, why = self._settled(bounds)
        # A band that no sensor sees (the nulls of a mean over an interval) has no floor either.
        psds = bounds.densities if floors["floor_rmse_deg_s"] is not None else {}
        sensors = {name: self._errors[name].result() for name in self._scenario.sensors}
        fusion = {
            name: {
                "belief": declared(spec.belief),
                "start": getattr(spec.parameters, "start", None),
                "gated": self._gated.get(name),
                "caution": getattr(spec.factory, "caution", None) or None,
                **self._errors[name].result(),
                **self._errors[name].consistency(),
                **floors,
                "optimum_rmse_deg_s": self._of_run(bounds, name)[0],
                "optimum_settled_deg_s": settled,
                "consistency": self._consistency[name].result(),
            }
            for name, spec in self._scenario.fusion.items()
        }
        for name, row in fusion.items():
            of_lines = self._of_run(bounds, name)[1]
            for line in row["lines"]:
                line["optimum_deg_s"] = of_lines.get(line["frequency_hz"])
        sights = {name: sight.result() for name, sight in self._sights.items()}
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
            "bounds_reason": bounds.reason or why,
            "floor_density": _floor_curve(psds, frame.bandwidth) if psds else None,
            "budget": budget_summary(psds, frame.bandwidth) if psds else None,
            **({"pointing": sights} if sights else {}),
            "expectations": self._expectations({**sensors, **fusion}, sights),
            "versions": dict(versions or {}),
            "setup": departures(self._scenario),
            "plugins": [asdict(plugin) for plugin in self._scenario.plugins],
        }
        return RunMetrics.model_validate(found)

    def _lines(self) -> list[tuple[float, float]]:
        """Return frequency [Hz] and amplitude [rad/s] of the lines in the truth; none of a table that does not move,
        whose truth has only arithmetic noise.
        """
        found = [line for name in [*self._scenario.fusion][:1] for line in self._errors[name].truth_lines()]
        return [(freq, amplitude) for freq, amplitude in found if amplitude > np.deg2rad(1e-9)]

    def _settled(self, bounds: Bounds) -> tuple[float | None, str | None]:
        """Return what the best filter of this very signal leaves once settled [deg/s], or None and why."""
        lines = self._lines()
        if not lines:
            return None, "the signal has no lines" if self._scenario.fusion else None
        best, why = bounds.settled([lines])
        return (None, why) if best is None else (in_deg(best[0].rmse), None)

    def _of_run(self, bounds: Bounds, name: str) -> tuple[float | None, dict[float, float | None]]:
        """Return what the best filter of this very signal leaves in this run, from the start that a filter knows of,
        and of each line alone by frequency [Hz] [deg/s].
        """
        frame, lines = self._scenario.frame, self._lines()
        if not lines:
            return None, {}
        start: StartKind = getattr(self._scenario.fusion[name].parameters, "start", "rest")
        best, _ = bounds.of_run([lines, *([line] for line in lines)], start, (frame.settle, frame.duration))
        if best is None:
            return None, {}
        whole, *alone = (in_deg(one.rmse) for one in best)
        return whole, {freq: value for (freq, _), value in zip(lines, alone, strict=True)}

    def _expectations(
        self, results: Mapping[str, dict[str, Any]], sights: Mapping[str, dict[str, Any]]
    ) -> list[dict[str, Any]]:
        rows = []
        for bound in self._scenario.expect:
            value = results[bound.subject].get(bound.metric)
            if value is None and bound.subject in sights:
                value = pointing_value(sights[bound.subject], bound.metric)
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


def in_deg(rate: float | None) -> float | None:
    """Return a rate [rad/s] in deg/s, None where there is none."""
    return None if rate is None or not np.isfinite(rate) else float(np.rad2deg(rate))


def _gated(diagnostics: Mapping[str, Any]) -> dict[str, int]:
    """Return how many readings of each sensor the front part of a filter has struck out so far."""
    stem = "gated_"
    return {key[len(stem) :]: int(n[-1]) for key, n in diagnostics.items() if key.startswith(stem) and n.size}


def _floor_curve(psds: Mapping[str, Any], bandwidth: float) -> dict[str, list[float]]:
    """Return the floor as a root density in deg/s/sqrt(Hz), for the report."""
    freq = np.logspace(-3, np.log10(bandwidth), 121)
    return {
        "frequency_hz": freq.tolist(),
        "density": np.rad2deg(np.sqrt(floor_density(list(psds.values()), freq))).tolist(),
    }
