"""What every seed of a scenario over one truth shares: how the table followed, clocks, floors, optimum, budget."""

from __future__ import annotations

from dataclasses import asdict
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.judging.bounds import Bounds
from testbed.judging.budget import budget_summary
from testbed.judging.responses import response_curves
from testbed.judging.table_facts import TableMetrics
from testbed.metrics.errors import floor_density
from testbed.metrics.line_fit import Waves
from testbed.runs.block import first_due
from testbed.runs.metrics import Budget, FloorDensity, Responses, TurntableMetrics
from testbed.scenario.departures import departures

if TYPE_CHECKING:
    from collections.abc import Mapping

    from testbed.fusion.start import StartKind
    from testbed.runs.block import RunBlock
    from testbed.scenario.model import Scenario
    from testbed.scenario.step_choice import StepChoice
    from testbed.signals import FloatArray

    Lines = tuple[tuple[float, float], ...]


class CaseFacts:
    """What the metrics of a scenario have in common whatever the seed of its noise; worked out once.

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
        self.scenario, self.rates = scenario, rates
        self._table = TableMetrics(scenario, step)
        self._bounds = Bounds(scenario.sensors, rates)
        self.ticking = {name for name, one in scenario.sensors.items() if one.clocked(rates["base"])}
        regular = {rates[name] for name in self.sources if name not in self.ticking}
        self.waves = {rate: Waves(scenario.lines) for rate in regular}
        self._clocks: dict[float, tuple[int, FloatArray, FloatArray]] = {}
        self._optima: dict[tuple[Lines, StartKind], list[float | None] | None] = {}
        self._settled: dict[Lines, tuple[float | None, str | None]] = {}

    @property
    def sources(self) -> list[str]:
        """Names of sensors and filters."""
        return [*self.scenario.sensors, *self.scenario.fusion]

    def write(self, block: RunBlock) -> None:
        """Take the truth of a block, before any judge takes the rest."""
        self._table.write(block)
        self._clocks = {rate: self._clock(block, rate) for rate in self.waves}

    def clock(self, name: str) -> tuple[int, FloatArray, FloatArray]:
        """Return of a source at which of its samples in the present block the metrics begin, and from there on times
        [s] and true rates [rad/s]: the same arrays for all sources of one clock.

        Parameters
        ----------
        name : str
            A sensor or filter.
        """
        return self._clocks[self.rates[name]]

    def _clock(self, block: RunBlock, rate: float) -> tuple[int, FloatArray, FloatArray]:
        base = self.rates["base"]
        ratio = round(base / rate)
        first = first_due(block.start, base, rate)
        truth = block.truth.rate[first * ratio - block.start :: ratio]
        settled = max(-(-round(self.scenario.frame.settle * base) // ratio) - first, 0)
        return settled, np.arange(first, first + truth.size)[settled:] / rate, truth[settled:]

    @cached_property
    def table(self) -> TurntableMetrics:
        """The entry "turntable" of the metrics, once all is written."""
        return TurntableMetrics.model_validate(self._table.result())

    @cached_property
    def floors(self) -> dict[str, float | None]:
        """Noise floors [deg/s] as the metrics name them."""
        frame = self.scenario.frame
        return {
            "floor_rmse_deg_s": in_deg(self._bounds.floor(frame.bandwidth)),
            "prior_floor_rmse_deg_s": in_deg(self._bounds.prior_floor(frame.bandwidth, frame.no_rate_below)),
        }

    @cached_property
    def pages(self) -> dict[str, Any]:
        """Floor density, budget, responses, departures and plug-ins as the metrics have them."""
        bandwidth = self.scenario.frame.bandwidth
        # A band that no sensor sees (the nulls of a mean over an interval) has no floor either.
        psds = self._bounds.densities if self.floors["floor_rmse_deg_s"] is not None else {}
        return {
            "floor_density": FloorDensity.model_validate(_floor_curve(psds, bandwidth)) if psds else None,
            "budget": Budget.model_validate(budget_summary(psds, bandwidth)) if psds else None,
            "responses": Responses.model_validate(response_curves(self.scenario)) if self.scenario.sensors else None,
            "setup": departures(self.scenario),
            "plugins": [asdict(plugin) for plugin in self.scenario.plugins],
        }

    def foresee(self) -> None:
        """Work out ahead what needs no signal: floors, and the optima of lines at the commanded frequencies."""
        lines = tuple((freq, 1.0) for freq in self.scenario.lines if freq > 0.0)
        self.pages  # noqa: B018 - it is kept
        self.settled(lines)
        for name in self.scenario.fusion:
            self.of_run(lines, name)

    def reason(self, why: str | None) -> str | None:
        """Return why there is no floor or no optimum, `why` being what `settled` says."""
        return self._bounds.reason or why

    def settled(self, lines: Lines) -> tuple[float | None, str | None]:
        """Return what the best filter of this very signal leaves once settled [deg/s], or None and why.

        Parameters
        ----------
        lines : tuple of tuple of float
            Frequency [Hz] and amplitude [rad/s] of the lines in the truth.
        """
        if not lines:
            return None, "the signal has no lines" if self.scenario.fusion else None
        if lines not in self._settled:
            best, why = self._bounds.settled([lines])
            self._settled[lines] = (None, why) if best is None else (in_deg(best[0].rmse), None)
        return self._settled[lines]

    def of_run(self, lines: Lines, name: str) -> tuple[float | None, dict[float, float | None]]:
        """Return what the best filter of this very signal leaves in this run, from the start that a filter knows of,
        and of each line alone by frequency [Hz] [deg/s].

        Parameters
        ----------
        lines : tuple of tuple of float
            As for `settled`.
        name : str
            Of the filter.
        """
        if not lines:
            return None, {}
        start: StartKind = getattr(self.scenario.fusion[name].parameters, "start", "rest")
        if (lines, start) not in self._optima:
            frame = self.scenario.frame
            window = (frame.settle - frame.fusion_from, frame.duration - frame.fusion_from)
            best, _ = self._bounds.of_run([lines, *([line] for line in lines)], start, window)
            self._optima[lines, start] = None if best is None else [in_deg(one.rmse) for one in best]
        found = self._optima[lines, start]
        if found is None:
            return None, {}
        return found[0], {freq: value for (freq, _), value in zip(lines, found[1:], strict=True)}


def in_deg(rate: float | None) -> float | None:
    """Return a rate [rad/s] in deg/s, None where there is none."""
    return None if rate is None or not np.isfinite(rate) else float(np.rad2deg(rate))


def _floor_curve(psds: Mapping[str, Any], bandwidth: float) -> dict[str, list[float]]:
    """Return the floor as a root density in deg/s/sqrt(Hz), for the report."""
    freq = np.logspace(-3, np.log10(bandwidth), 121)
    return {
        "frequency_hz": freq.tolist(),
        "density": np.rad2deg(np.sqrt(floor_density(list(psds.values()), freq))).tolist(),
    }
