"""The metrics of a replay: errors against a reference if there is one, else what can be said without."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.metrics.consistency import Consistency
from testbed.metrics.errors import ErrorMetrics
from testbed.metrics.line_fit import Waves
from testbed.metrics.spread import RateSpread

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from testbed.runs.block import PlayedBlock
    from testbed.scenario.model import FilterSpec
    from testbed.signals import FloatArray

_GATED = "gated_"
_UNKNOWN_INSTRUMENTS = "what the instruments of a recording really are is not known"


class ReplayJudge:
    """Accumulates the metrics of every sensor and filter of a replay after `settle`.

    Parameters
    ----------
    times : mapping of str to ndarray, shape (n_time,)
        Stamps [s] of ``base`` and of every sensor.
    settle, duration : float
        From when to when it is judged [s].
    specs : mapping of str to FilterSpec
        The filters.
    lines : sequence of float
        Frequencies that the reference is known to hold [Hz].
    reference : bool
        Whether there is one.
    """

    def __init__(
        self,
        times: Mapping[str, FloatArray],
        settle: float,
        duration: float,
        specs: Mapping[str, FilterSpec],
        lines: Sequence[float],
        *,
        reference: bool,
    ) -> None:
        self._times, self._settle, self._specs, self._reference = times, settle, specs, reference
        sensors = [name for name in times if name != "base"]
        waves = {name: Waves(lines) for name in times}
        span = (settle, duration)
        self._errors = {
            name: ErrorMetrics(waves.get(name, waves["base"]), gaps=name in sensors, span=span)
            for name in (*sensors, *specs)
        }
        self._spreads = {name: RateSpread() for name in (*sensors, *specs)}
        self._variance: dict[str, list[float]] = {name: [0.0, 0.0] for name in specs}
        self._consistency = {name: Consistency(known=reference) for name in specs}
        self._gated: dict[str, dict[str, int]] = {}
        self._sensors = sensors

    def write(self, block: PlayedBlock, reference: Mapping[str, FloatArray]) -> None:
        """Add a block, and the reference [rad/s] at the instants of ``base`` and of every sensor in it."""
        for name, readings in block.sensors.items():
            self._add(name, name, block.first[name], readings, reference)
        for name, estimate in block.fusion.items():
            self._gated.setdefault(name, {}).update(
                {
                    key.removeprefix(_GATED): int(n[-1])
                    for key, n in estimate.diagnostics.items()
                    if key.startswith(_GATED)
                }
            )
            settled, known = self._add(name, "base", block.start, estimate.rate, reference, estimate.std)
            std = estimate.std[settled:]
            self._variance[name][0] += float(std @ std)
            self._variance[name][1] += std.size
            error = estimate.rate[settled:] - reference["base"][settled:] if self._reference else std
            self._consistency[name].add(error[known], std[known], estimate.diagnostics, settled)

    def _add(
        self,
        name: str,
        clock: str,
        first: int,
        rate: FloatArray,
        reference: Mapping[str, FloatArray],
        std: FloatArray | None = None,
    ) -> tuple[int, Any]:
        """Add samples; return at which of them the metrics begin, and at which from there on the reference is known."""
        times = self._times[clock][first : first + rate.size]
        settled = int(np.searchsorted(times, self._settle * (1.0 - 1e-12)))
        self._spreads[name].add(rate[settled:])
        if not self._reference:
            return settled, slice(0, 0)
        truth = reference[clock][settled:]
        known = np.isfinite(truth)
        claimed = None if std is None else std[settled:][known]
        self._errors[name].add(times[settled:][known], rate[settled:][known], truth[known], claimed)
        return settled, known

    def result(self) -> dict[str, Any]:
        """Return the entries ``sensors``, ``fusion`` and ``bounds_reason`` of metrics.json; None where undefined."""
        sensors = {name: {**self._of(name), "missing": self._spreads[name].missing} for name in self._sensors}
        fusion = {
            name: {
                **spec.facts(),
                "gated": self._gated.get(name),
                **self._of(name),
                **self._claimed(name),
                "consistency": self._consistency[name].result(),
            }
            for name, spec in self._specs.items()
        }
        return {"sensors": sensors, "fusion": fusion, "bounds_reason": _UNKNOWN_INSTRUMENTS}

    def _of(self, name: str) -> dict[str, Any]:
        return self._errors[name].result() if self._reference else self._spreads[name].result()

    def _claimed(self, name: str) -> dict[str, Any]:
        if self._reference:
            return self._errors[name].consistency()
        square, n = self._variance[name]
        return {"mean_std_deg_s": float(np.rad2deg(np.sqrt(square / n))) if n and np.isfinite(square) else None}
