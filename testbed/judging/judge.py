"""The metrics of a run: every sensor and filter against the truth, beside what no filter can get below."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.judging.case import CaseFacts
from testbed.judging.profiles import ProfileKeeper
from testbed.judging.sights import pointing_judges, pointing_value
from testbed.metrics.consistency import Consistency
from testbed.metrics.errors import ErrorMetrics
from testbed.runs.metrics import RunMetrics

if TYPE_CHECKING:
    from collections.abc import Mapping

    from testbed.runs.block import RunBlock, Ticked
    from testbed.scenario.model import Scenario
    from testbed.scenario.step_choice import StepChoice
    from testbed.signals import FloatArray


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
    case : CaseFacts, optional
        What it shares with the judges of other seeds over the same truth; whoever hands it in also writes it, first.
    """

    def __init__(
        self, scenario: Scenario, rates: Mapping[str, float], step: StepChoice, case: CaseFacts | None = None
    ) -> None:
        self._scenario, self._shares = scenario, case is not None
        self._case = case or CaseFacts(scenario, rates, step)
        # A sensor may lose readings; an estimate that is not a number is a failure and stays undefined.
        span = (scenario.frame.settle, scenario.frame.duration)
        waves = self._case.waves
        self._errors = {
            name: ErrorMetrics(waves[rates[name]], gaps=name in scenario.sensors, span=span)
            for name in self._case.sources
            if name not in self._case.ticking
        }
        # Their times are their own.
        self._errors |= {
            name: ErrorMetrics(scenario.lines, gaps=True, span=span)
            for name in scenario.sensors
            if name not in self._errors
        }
        self._consistency = {name: Consistency() for name in scenario.fusion}
        self._gated: dict[str, dict[str, int]] = {}
        self._sights = pointing_judges(scenario, rates["base"])
        self._profiles = ProfileKeeper(scenario)

    def write(self, block: RunBlock) -> None:
        """Add a block."""
        if not self._shares:
            self._case.write(block)
        for name, readings in block.sensors.items():
            if name in block.ticked:
                self._add_ticked(name, readings, block.ticked[name])
            else:
                self._add(name, readings, None)
        for name, estimate in block.fusion.items():
            error, settled = self._add(name, estimate.rate, estimate.std)
            self._gated.setdefault(name, {}).update(_gated(estimate.diagnostics))
            self._consistency[name].add(error, estimate.std[settled:], estimate.diagnostics, settled)
        for name, sight in block.pointing.items():
            self._sights[name].process(sight, block.truth.rate)
        self._profiles.write(block)

    def _add(self, name: str, rate: FloatArray, std: FloatArray | None) -> tuple[FloatArray, int]:
        """Add a block of readings or estimates; return the error after `settle`, and at which sample of the block that
        begins.
        """
        settled, t, truth = self._case.clock(name)
        self._errors[name].add(t, rate[settled:], truth, None if std is None else std[settled:])
        return rate[settled:] - truth, settled

    def _add_ticked(self, name: str, rate: FloatArray, ticked: Ticked) -> None:
        """Add a block of readings of a sensor with a clock of its own."""
        first = int(np.searchsorted(ticked.times, self._scenario.frame.settle))
        self._errors[name].add(ticked.times[first:], rate[first:], ticked.truth[first:])

    def metrics(self, versions: Mapping[str, str] | None = None) -> RunMetrics:
        """Return the metrics of what was written.

        Parameters
        ----------
        versions : mapping of str to str, optional
            Of what the result depends on, to be noted with it.
        """
        frame, lines = self._scenario.frame, self._lines()
        settled, why = self._case.settled(lines)
        sensors = {name: self._errors[name].result() for name in self._scenario.sensors}
        fusion = {
            name: {
                **spec.facts(),
                "gated": self._gated.get(name),
                **self._errors[name].result(),
                **self._errors[name].consistency(),
                **self._case.floors,
                "optimum_rmse_deg_s": self._case.of_run(lines, name)[0],
                "optimum_settled_deg_s": settled,
                "consistency": self._consistency[name].result(),
            }
            for name, spec in self._scenario.fusion.items()
        }
        for name, row in fusion.items():
            of_lines = self._case.of_run(lines, name)[1]
            for line in row["lines"]:
                line["optimum_deg_s"] = of_lines.get(line["frequency_hz"])
        sights = {name: sight.result() for name, sight in self._sights.items()}
        profiles = self._profiles.result()
        found = {
            "scenario": self._scenario.name,
            "seed": frame.seed,
            "duration_s": frame.duration,
            "settle_s": frame.settle,
            "rate_unit": self._scenario.rate_unit,
            "bandwidth_hz": frame.bandwidth,
            "turntable": self._case.table,
            "sensors": sensors,
            "fusion": fusion,
            "bounds_reason": self._case.reason(why),
            **self._case.pages,
            **({"pointing": sights} if sights else {}),
            **({"profiles": profiles} if profiles else {}),
            "expectations": self._expectations({**sensors, **fusion}, sights),
            "versions": dict(versions or {}),
        }
        return RunMetrics.model_validate(found)

    def _lines(self) -> tuple[tuple[float, float], ...]:
        """Return frequency [Hz] and amplitude [rad/s] of the lines in the truth; none of a table that does not move,
        whose truth has only arithmetic noise.
        """
        found = [line for name in [*self._scenario.fusion][:1] for line in self._errors[name].truth_lines()]
        return tuple((freq, amplitude) for freq, amplitude in found if amplitude > np.deg2rad(1e-9))

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


def _gated(diagnostics: Mapping[str, Any]) -> dict[str, int]:
    """Return how many readings of each sensor the front part of a filter has struck out so far."""
    stem = "gated_"
    counts = {key[len(stem) :]: n[-1] for key, n in diagnostics.items() if key.startswith(stem) and n.size}
    # A filter of a plug-in that is not switched on yet has counted nothing.
    return {sensor: int(n) for sensor, n in counts.items() if np.isfinite(n)}
