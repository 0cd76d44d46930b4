"""What nothing gets below in a run: the noise floor, the optimum of its signal, and why where there is none."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from testbed.fusion.analysis.bounds import never_settles, run_bounds, settled_bounds
from testbed.fusion.schedule import even_rates, long_cycle, nearest_clock, odd_sensor
from testbed.metrics.errors import floor_rmse
from testbed.scenario.beliefs import believed

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from testbed.fusion.analysis.bounds import SignalBound
    from testbed.fusion.belief import SensorBelief
    from testbed.fusion.start import StartKind
    from testbed.sensors.base import Sensor
    from testbed.signals import FloatArray

    Density = Callable[[FloatArray], FloatArray]

# Clocks within this of a whole ratio have its bounds.
_NEARLY_WHOLE = 0.01
# A sensor that is blind at zero falls by ten from the first to the second.
_NEAR_ZERO_HZ = np.array([1e-5, 1e-6])


class Bounds:
    """The bounds of the sensors of a run.

    Parameters
    ----------
    sensors : mapping of str to Sensor
        The instruments.
    sample_rate_hz : mapping of str to float
        Rate of each [Hz].
    """

    def __init__(self, sensors: Mapping[str, Sensor], sample_rate_hz: Mapping[str, float]) -> None:
        self._sensors, self._rates = sensors, {name: sample_rate_hz[name] for name in sensors}
        # Of clocks that have nearly a whole ratio, the bounds are those of the whole one.
        self._even = even_rates(self._rates) if sensors and odd_sensor(self._rates) else self._rates

    @property
    def densities(self) -> dict[str, Density]:
        """Input-referred noise density of each sensor, Hz -> rad^2/s."""
        return {name: sensor.input_noise_psd for name, sensor in self._sensors.items()}

    @property
    def reason(self) -> str | None:
        """Why there is no floor and no optimum, None if there are."""
        silent = [name for name, sensor in self._sensors.items() if not sensor.noise]
        if not self._sensors or silent:
            return f"the noise of {', '.join(silent)} is off" if silent else "there is no sensor"
        if not any(sees_constant(sensor) for sensor in self._sensors.values()):
            return "no sensor sees a constant rate, so that the error of an unknown signal has no bound"
        return None

    def floor(self, bandwidth_hz: float) -> float | None:
        """Return the noise that no filter of an unknown signal gets below [rad/s], None for `reason`.

        Parameters
        ----------
        bandwidth_hz : float
            W [Hz].
        """
        return None if self.reason else floor_rmse(list(self.densities.values()), bandwidth_hz)

    def prior_floor(self, bandwidth_hz: float, no_rate_below_hz: float | None) -> float | None:
        """Return the floor for a signal that is known to have no rate below a frequency [rad/s], None without one.

        Parameters
        ----------
        bandwidth_hz, no_rate_below_hz : float, float or None
            End and beginning of the band [Hz].
        """
        if no_rate_below_hz is None or not all(sensor.noise for sensor in self._sensors.values()):
            return None
        return floor_rmse(list(self.densities.values()), bandwidth_hz, no_rate_below_hz)

    def settled(self, signals: Sequence[Sequence[tuple[float, float]]]) -> tuple[list[SignalBound] | None, str | None]:
        """Return the optimum of each signal after all time constants, or None and why.

        Parameters
        ----------
        signals : sequence of sequence of (float, float)
            Lines of each: frequency [Hz] and amplitude [rad/s].
        """
        belief, why = self._exact()
        if belief is None or (why := never_settles(belief)):
            return None, why
        return settled_bounds(belief, self._even, signals), None

    def of_run(
        self, signals: Sequence[Sequence[tuple[float, float]]], start: StartKind, window: tuple[float, float]
    ) -> tuple[list[SignalBound] | None, str | None]:
        """Return the optimum of each signal over a window of a run from its start, or None and why.

        Parameters
        ----------
        signals : sequence of sequence of (float, float)
            As for `settled`.
        start : {"unknown", "rest"}
            What is known at t = 0.
        window : tuple of float
            Begin and end [s].
        """
        belief, why = self._exact()
        return (
            (None, why)
            if belief is None
            else (run_bounds(belief, self._even, signals, start=start, window=window), None)
        )

    def _exact(self) -> tuple[dict[str, SensorBelief] | None, str | None]:
        if reason := self.reason or long_cycle(nearest_clock(self._rates)[1]):
            return None, reason
        if odd := odd_sensor(self._rates, _NEARLY_WHOLE):
            return None, f"the clock of {odd} has no ratio to the fastest that is nearly whole"
        found = {name: believed(sensor) for name, sensor in self._sensors.items()}
        known = {name: one for name, one in found.items() if one is not None and one.output_noise > 0.0}
        missing = [name for name in found if name not in known]
        return (None, f"no rational model meets {', '.join(missing)}") if missing else (known, None)


def sees_constant(sensor: Sensor) -> bool:
    """Return whether a constant rate shows in the readings of an instrument.

    Parameters
    ----------
    sensor : Sensor
        The instrument.
    """
    near, nearer = np.abs(sensor.response(_NEAR_ZERO_HZ))
    return bool(nearer > 0.5 * near)
