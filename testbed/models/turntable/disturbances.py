"""What disturbs the plant from outside: floor vibration at the mounts, error motion in the bearing."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.errors import ScenarioError
from testbed.signals import sample_times

if TYPE_CHECKING:
    from collections.abc import Iterator

    from testbed.models.turntable.floor import FloorMotion
    from testbed.models.turntable.parameters import TurntableParameters, Wobble
    from testbed.signals import FloatArray


class Disturbances:
    """The inputs of mounts and bearing, held over each step of the base clock at their values in its middle.

    Parameters
    ----------
    model : mujoco.MjModel
        Of mode `servo` or `digital`.
    parameters : TurntableParameters
        Of the plant.
    floor : FloorMotion or None
        The realisation of `parameters.floor`; None for a still floor.
    sample_rate_hz : float
        Base clock [Hz].

    Raises
    ------
    ValueError
        If the floor moves and its realisation is not given.
    """

    def __init__(
        self, model: Any, parameters: TurntableParameters, floor: FloorMotion | None, sample_rate_hz: float
    ) -> None:
        if floor is None and parameters.floor.top_frequency():
            msg = "floor: expected its realisation, parameters.floor.start(duration, stream), got None"
            raise ValueError(msg)
        self._floor, self._wobble, self._sample_rate_hz = floor, parameters.wobble, sample_rate_hz
        names = [model.actuator(i).name for i in range(model.nactuator)]
        self._column = {name: int(model.actuator_ctrladr[i]) for i, name in enumerate(names)}

    @property
    def columns(self) -> list[int]:
        """Columns of the controls that it moves."""
        none = np.zeros(1)
        return sorted({column + i for column, *_ in self._inputs(none, none, none) for i in range(2)})

    def apply(self, control: FloatArray, start: int, angle: FloatArray, rate: FloatArray) -> None:
        """Fill in the columns of mounts and bearing.

        Parameters
        ----------
        control : ndarray, shape (n_time, nu)
            Inputs of the steps from `start` on, changed in place.
        start : int
            Index of the first step.
        angle, rate : ndarray, shapes (n_time,), (n_time,)
            Commanded spindle angle [rad] and rate [rad/s] in mid-step. The error motion is that of the commanded
            angle: the true one is off by the tracking error, some 1e-6 rad.
        """
        t = sample_times(2 * start + 1, 2 * len(control), 2.0 * self._sample_rate_hz)[::2]
        for column, place, speed in self._inputs(t, angle, rate):
            control[:, column] += place
            control[:, column + 1] += speed

    def at_start(self, control: FloatArray, angle: float) -> None:
        """Fill in the inputs, shape (nu,), at t = 0 at a spindle angle [rad], as they are at rest."""
        for column, place, _ in self._inputs(np.zeros(1), np.array([angle]), np.zeros(1)):
            control[column] += place[0]

    def _inputs(
        self, t: FloatArray, angle: FloatArray, rate: FloatArray
    ) -> Iterator[tuple[int, FloatArray, FloatArray]]:
        for axis, inputs in (self._floor.inputs(t) if self._floor else {}).items():
            yield self._column[f"platform_{axis}"], *inputs
        for one in self._wobble:
            yield self._column[f"rotor_{one.axis}"], *error_motion(one, angle, rate)


def error_motion(harmonic: Wobble, angle: FloatArray, rate: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the tilt A sin(n angle + phase) and its rate of change at spindle angles and rates.

    Parameters
    ----------
    harmonic : Wobble
        Amplitude A, periods n, phase.
    angle, rate : ndarray, shapes (n_time,), (n_time,)
        Of the spindle [rad], [rad/s].

    Returns
    -------
    tilt, tilt_rate : ndarray, shapes (n_time,), (n_time,)
        [rad], [rad/s].
    """
    phase = harmonic.periods * angle + harmonic.phase
    return harmonic.angle * np.sin(phase), harmonic.angle * harmonic.periods * rate * np.cos(phase)


def check_floor(parameters: TurntableParameters, sample_rate_hz: float) -> None:
    """Refuse a floor that vibrates faster than the base clock can hold.

    Parameters
    ----------
    parameters : TurntableParameters
        Of the plant.
    sample_rate_hz : float
        Base clock [Hz].

    Raises
    ------
    ScenarioError
        If a line or band reaches half the clock.
    """
    top = parameters.floor.top_frequency()
    if top >= sample_rate_hz / 2:
        msg = (
            f"turntable: floor: expected frequencies below {sample_rate_hz / 2:g} Hz, "
            f"half the base clock, got {top:g} Hz"
        )
        raise ScenarioError(msg)
