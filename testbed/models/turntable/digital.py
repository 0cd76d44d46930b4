"""The digital servo: a quantised encoder, a controller with a clock of its own, a motor whose torque ripples."""

from __future__ import annotations

from math import floor, isfinite, sin
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np

from testbed.errors import RunError, ScenarioError
from testbed.models.turntable import plant
from testbed.models.turntable.engine import quiet, refuse_bad_control, refuse_bad_rows
from testbed.models.turntable.servo import gains, hold_matrices

if TYPE_CHECKING:
    from testbed.models.turntable.parameters import TurntableParameters
    from testbed.signals import FloatArray


class Controller:
    r"""Position and rate loop on the counts of an encoder, at each of its ticks n, one every T.

    .. math::
        e_n = \theta_\mathrm{ref} - \Delta \lfloor \theta / \Delta + 1/2 \rfloor, \quad
        v_n = v_{n-1} + \alpha \left( \frac{e_n - e_{n-1}}{T} - v_{n-1} \right), \quad
        \tau_n = \tau_\mathrm{ff} + k_p e_n + k_v v_n

    with :math:`\Delta = 2\pi / 2^{bits}` and :math:`\alpha = 1 - e^{-2\pi f T}`, f the corner of the rate filter. The
    difference is that of the error: reference and encoder go through the same filter, which so does not fight the
    feed-forward.

    Parameters
    ----------
    parameters : TurntableParameters
        Gains, limit and `digital`.
    """

    def __init__(self, parameters: TurntableParameters) -> None:
        digital = parameters.digital
        self._period = 1.0 / digital.controller_rate
        self._lsb = digital.resolution
        self._alpha = digital.filter_gain
        self._kp, self._kv = gains(parameters)
        self._error: float | None = None
        self._rate = 0.0

    def torque(self, angle: float, reference: float, feed_forward: float) -> float:
        """Return the torque [N m] that the motor is told to give until the next tick.

        Parameters
        ----------
        angle, reference : float
            True and commanded spindle angle now [rad].
        feed_forward : float
            Torque of the feed-forward [N m].
        """
        error = reference - self._lsb * floor(angle / self._lsb + 0.5)
        previous = error if self._error is None else self._error
        self._rate += self._alpha * ((error - previous) / self._period - self._rate)
        self._error = error
        return feed_forward + self._kp * error + self._kv * self._rate


class DigitalLoop:
    """The plant under its controller, step by step; keeps its state between calls, like
    `testbed.models.turntable.engine.Engine`.

    Parameters
    ----------
    model : mujoco.MjModel
        Of mode `digital`; its step is that of the base clock divided by `substeps`.
    qpos, qvel : ndarray, shapes (nq,), (nv,)
        Initial state [rad, m; rad/s, m/s].
    substeps : int
        Steps of the model per step of the base clock.
    parameters : TurntableParameters
        Of the controller and the ripple.
    """

    def __init__(
        self, model: Any, qpos: FloatArray, qvel: FloatArray, substeps: int, parameters: TurntableParameters
    ) -> None:
        self._model, self._data, self._substeps = model, mujoco.MjData(model), substeps
        self._data.qpos[:], self._data.qvel[:] = qpos, qvel
        self._dt = model.opt.timestep * substeps
        self._stride = round(1.0 / (parameters.digital.controller_rate * self._dt))
        self._controller = Controller(parameters)
        self._limit = parameters.torque_limit
        self._ripple = [(one.relative, one.periods, one.phase) for one in parameters.digital.ripple]
        self._spindle = int(model.joint(plant.SPINDLE).qposadr[0])
        self._motor = int(model.actuator_ctrladr[model.actuator(plant.MOTOR).id])
        self._torque = 0.0

    def advance(self, start: int, control: FloatArray, reference: FloatArray) -> FloatArray:
        """Run over the next steps.

        Parameters
        ----------
        start : int
            Index k of the first step.
        control : ndarray, shape (n_time, nu)
            Inputs of each step of the base clock; the motor's column holds the feed-forward [N m].
        reference : ndarray, shape (n_time,)
            Commanded angle at the beginning of each step [rad].

        Returns
        -------
        ndarray, shape (n_time, nsensordata)
            Sensor rows at t_start ... t_(start + n_time - 1).

        Raises
        ------
        RunError
            If an input is not finite, the motor saturates or the plant diverges; with the time.
        """
        refuse_bad_control(control, start, self._dt)
        rows = np.empty((len(control), self._model.nsensordata))
        with quiet():
            self._loop(start, control, reference.tolist(), rows)
        # A Python loop goes on after a warning, so the time is that of the end of the block.
        warnings = [warning.number for warning in self._data.warning]
        refuse_bad_rows(rows, start, warnings, start + len(rows), self._dt)
        return rows

    def _loop(self, start: int, control: FloatArray, reference: list[float], rows: FloatArray) -> None:
        # Names of the loop are local: attribute look-ups would cost as much as the controller.
        model, data, step, motor, stride = self._model, self._data, mujoco.mj_step, self._motor, self._stride
        ctrl, sensed, spindle, torque = data.ctrl, data.sensordata, data.qpos, self._torque
        feed_forward, update, again = control[:, motor].tolist(), self._controller.torque, range(self._substeps - 1)
        # Copying the inputs costs as much as the controller, so those of a quiet table, all zero, are copied once.
        ctrl[:], disturbed = 0.0, bool(np.delete(control, motor, axis=1).any())
        for i, row in enumerate(control):
            angle = spindle.item(self._spindle)
            if not isfinite(angle):
                rows[i:] = np.nan
                break
            if (start + i) % stride == 0:
                torque = update(angle, reference[i], feed_forward[i])
                if not abs(torque) < self._limit:
                    self._saturated(start + i)
            strength = 1.0
            for size, periods, phase in self._ripple:
                strength += size * sin(periods * angle + phase)
            if disturbed:
                ctrl[:] = row
            ctrl[motor] = torque * strength
            step(model, data)
            rows[i] = sensed
            for _ in again:
                step(model, data)
        self._torque = torque

    def _saturated(self, k: int) -> None:
        msg = (
            "turntable: "
            f"the motor saturated at its {self._limit:g} N*m at t = {k * self._dt:.6g} s; the run got this far"
        )
        raise RunError(msg)


def check_loop(parameters: TurntableParameters, sample_rate_hz: float) -> None:
    """Refuse a controller that the base clock cannot run or that is unstable on a rigid spindle.

    Parameters
    ----------
    parameters : TurntableParameters
        Of the plant and its controller.
    sample_rate_hz : float
        Base clock [Hz].

    Raises
    ------
    ScenarioError
        If the clock is no integer multiple of the controller's, or a closed-loop pole lies on or outside the unit
        circle.
    """
    rate = parameters.digital.controller_rate
    stride = sample_rate_hz / rate
    if round(stride) < 1 or abs(stride - round(stride)) > 1e-9 * stride:
        msg = (
            "turntable: digital.controller_rate: "
            f"expected {sample_rate_hz:g} Hz divided by a whole number, got {rate:g} Hz"
        )
        raise ScenarioError(msg)
    largest = np.abs(np.linalg.eigvals(closed_loop(parameters))).max()
    if largest >= 1.0:
        msg = (
            f"turntable: expected a stable digital servo, got a pole of magnitude {largest:.4g}: lower rate_bandwidth "
            "or raise digital.controller_rate or digital.velocity_filter"
        )
        raise ScenarioError(msg)


def closed_loop(parameters: TurntableParameters) -> FloatArray:
    """Return the matrix, shape (4, 4), that takes (angle, rate, last error, filtered rate error) over one period."""
    kp, kv = gains(parameters)
    alpha, rate = parameters.digital.filter_gain, parameters.digital.controller_rate
    advance, push = hold_matrices(parameters.spindle_inertia, parameters.spindle_drag, 1.0 / rate)
    filtered = np.array([-alpha * rate, 0.0, -alpha * rate, 1.0 - alpha])
    torque = np.array([-kp, 0.0, 0.0, 0.0]) + kv * filtered
    step = np.zeros((4, 4))
    step[:2] = np.outer(push, torque)
    step[:2, :2] += advance
    step[2, 0], step[3] = -1.0, filtered
    return step
