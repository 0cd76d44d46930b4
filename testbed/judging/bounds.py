"""What no filter gets below in a run: the noise floor, and the optimum settled and from the run's own start."""

from __future__ import annotations

import functools
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from testbed.fusion.analysis.optimum import Optimum, optima, variance_from_start
from testbed.metrics.errors import floor_rmse
from testbed.scenario.beliefs import believed

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from testbed.fusion.belief import SensorBelief
    from testbed.fusion.start import StartKind
    from testbed.sensors.base import Sensor

BLIND = "no sensor sees a constant rate: the error of any filter grows without bound"
SILENT = "a sensor without noise has no bound"
NO_MODEL = "a sensor has no rational model"
# A response this small against its largest, at a frequency this low [Hz], sees no constant.
_LEAST_RESPONSE, _CONSTANT_HZ = 1e-3, 1e-9
# Instants between settle and the end at which the optimum from the start is taken.
_INSTANTS = 9


@dataclass(frozen=True)
class Bounds:
    """Bounds of a run [rad/s], None where there is none, and why.

    Parameters
    ----------
    floor, prior_floor : float or None
        Noise of the best combination of the sensors, over the whole bandwidth and from `no_rate_below` on.
    best : tuple of Optimum
        Of the whole signal, then of each of its lines, settled; empty without lines.
    reason : str or None
        Why there are no bounds.
    belief, sample_rate_hz : mapping
        What the optimum knows: the simulated sensors exactly.
    """

    floor: float | None = None
    prior_floor: float | None = None
    best: tuple[Optimum, ...] = ()
    reason: str | None = None
    belief: Mapping[str, SensorBelief] = field(default_factory=dict)
    sample_rate_hz: Mapping[str, float] = field(default_factory=dict)

    def from_start(self, start: StartKind, settle: float, duration: float) -> float | None:
        """Return what the optimum leaves between two times after a start [rad/s], root mean square.

        The noise part by the Riccati recursion of the best settled filter from P0, the lag as settled.

        Parameters
        ----------
        start : {"unknown", "rest"}
            What is known before the first reading.
        settle, duration : float
            When to begin and to end [s].
        """
        if not self.best:
            return None
        best = self.best[0]
        variance = variance_from_start(
            self.belief,
            self.sample_rate_hz,
            order=best.order,
            q=best.q,
            start=start,
            times=np.linspace(settle, duration, _INSTANTS).tolist(),
        )
        mean = float(np.trapezoid(variance) / (_INSTANTS - 1))
        return float(np.sqrt(max(mean - best.claimed**2 + best.rmse**2, 0.0)))


def bounds_of(
    sensors: Mapping[str, Sensor],
    sample_rate_hz: Mapping[str, float],
    signals: Sequence[Sequence[tuple[float, float]]],
    *,
    bandwidth: float,
    no_rate_below: float | None = None,
) -> Bounds:
    """Return the bounds of a run.

    Parameters
    ----------
    sensors : mapping of str to Sensor
        The instruments.
    sample_rate_hz : mapping of str to float
        Rate of each [Hz].
    signals : sequence of sequence of (float, float)
        Frequency [Hz] and amplitude [rad/s] of the lines of the whole signal, then of others, such as each line alone.
    bandwidth : float
        W of the floor [Hz].
    no_rate_below : float, optional
        Where the rate is known to have nothing below [Hz].
    """
    if not sensors or not all(sensor.noise for sensor in sensors.values()):
        return Bounds(reason=SILENT if sensors else None)
    psds = [sensor.input_noise_psd for sensor in sensors.values()]
    prior = None if no_rate_below is None else floor_rmse(psds, bandwidth, no_rate_below)
    if not any(sees_constant(sensor) for sensor in sensors.values()):
        return Bounds(prior_floor=prior, reason=BLIND)
    floor = floor_rmse(psds, bandwidth)
    belief = {name: one for name, sensor in sensors.items() if (one := believed(sensor)) is not None}
    if len(belief) < len(sensors):
        return Bounds(floor, prior, reason=NO_MODEL)
    best: tuple[Optimum, ...] = ()
    if signals:
        lines = tuple(tuple(tuple(line) for line in signal) for signal in signals)
        best = _remembered(tuple(belief.items()), tuple(sample_rate_hz.items()), lines)
    return Bounds(floor, prior, best, None, belief, dict(sample_rate_hz))


def sees_constant(sensor: Sensor) -> bool:
    """Return whether a constant rate shows in the readings of a sensor."""
    response = np.abs(sensor.response(np.array([_CONSTANT_HZ, 1.0, 10.0, 100.0])))
    return bool(response[0] > _LEAST_RESPONSE * response.max())


@functools.lru_cache(maxsize=32)
def _remembered(
    belief: tuple[tuple[str, SensorBelief], ...],
    sample_rate_hz: tuple[tuple[str, float], ...],
    signals: tuple[tuple[tuple[float, float], ...], ...],
) -> tuple[Optimum, ...]:
    # The search takes a second, and sweeps over seeds ask for the same.
    return tuple(optima(dict(belief), dict(sample_rate_hz), signals, coloured=True))
