r"""Integration steps longer than the hold of the references, without losing the hold.

The references are held over base steps h, the plant is integrated over m of them, H = m h. The mean of the held inputs
c keeps their impulse but not when in the step it acts: at the ends of the steps the rates are wrong by parts in 1e5.
Moments of first order tell by how much. With b the plant's acceleration per input and

.. math:: \epsilon = (m^2 - 1) h^2 / 12,

the difference of the variances of both holds, the plant under the input :math:`\bar c - \epsilon \ddot c` has the true
angles at the ends of its steps, and the true rates less :math:`\epsilon\, b\, \dot c`, which is added. In between, a
polynomial of fifth order through six ends gives the samples of the base clock, as smooth a sequence as the references
are.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np

if TYPE_CHECKING:
    from testbed.models.turntable.engine import Engine
    from testbed.signals import FloatArray

_POINTS = 6
_BEFORE = 2
# So small that no actuator saturates; what follows is linear in it.
_NUDGE = 1e-6


def lookahead(holds: int) -> int:
    """Return how many base steps beyond a block must be known, for integration steps of `holds` base steps."""
    return _POINTS * holds if holds > 1 else 0


def responses(model: Any, data: Any) -> tuple[FloatArray, FloatArray]:
    """Return what each input does to accelerations, and that as rates in the sensors.

    Parameters
    ----------
    model, data : mujoco.MjModel, mujoco.MjData
        The plant at rest in its equilibrium.

    Returns
    -------
    acceleration, sensed : ndarray, shapes (nu, nv), (nu, nsensordata)
        d(qacc)/d(input), and the change of the sensors by a velocity of that size.
    """
    acceleration, sensed = np.empty((model.nu, model.nv)), np.empty((model.nu, model.nsensordata))
    control = data.ctrl.copy()
    for i in range(model.nu):
        pair = []
        for sign in (1.0, -1.0):
            data.ctrl[:] = control
            data.ctrl[i] += sign * _NUDGE
            data.qvel[:] = 0.0
            mujoco.mj_forward(model, data)
            pair.append(data.qacc.copy())
        acceleration[i] = (pair[0] - pair[1]) / (2.0 * _NUDGE)
    data.ctrl[:] = control
    rest = _sensors(model, data, np.zeros(model.nv))
    for i in range(model.nu):
        scale = max(float(np.abs(acceleration[i]).max()), 1.0)
        sensed[i] = (_sensors(model, data, acceleration[i] / scale) - rest) * scale
    data.qvel[:] = 0.0
    return acceleration, sensed


def _sensors(model: Any, data: Any, qvel: FloatArray) -> FloatArray:
    data.qvel[:] = qvel
    mujoco.mj_forward(model, data)
    values: FloatArray = data.sensordata.copy()
    return values


class LongSteps:
    """Runs an engine over steps of `holds` base steps and gives its sensors on the base clock.

    State is kept between calls; any division into calls gives the same bits.

    Parameters
    ----------
    engine : Engine
        Of a model whose step is `holds` base steps.
    sensed : ndarray, shape (nu, nsensordata)
        From `responses`.
    holds : int
        Base steps per integration step, m >= 2.
    dt : float
        Base step h [s].
    """

    def __init__(self, engine: Engine, sensed: FloatArray, holds: int, dt: float) -> None:
        self._engine, self._sensed, self._m, self._dt = engine, sensed, holds, dt
        self._lag = lag(holds, dt)
        self._weights = _weights(holds)
        self._done = 0
        self._rows, self._first_row = np.empty((0, sensed.shape[1])), 0
        # Inputs that steps to come need: from the hold before the next step on.
        self._control: FloatArray | None = None

    def advance(self, start: int, n_time: int, control: FloatArray) -> FloatArray:
        """Run over the next base steps.

        Parameters
        ----------
        start : int
            Index k of the first base step.
        n_time : int
            Number of base steps asked for.
        control : ndarray, shape (n_time + lookahead, nu)
            Inputs, each held over one base step, from `start` on and beyond the steps asked for.

        Returns
        -------
        ndarray, shape (n_time, nsensordata)
            Sensor rows at t_start ... t_(start + n_time - 1).
        """
        if not n_time:
            return np.empty((0, self._sensed.shape[1]))
        self._remember(start, control)
        self._run(max((start + n_time - 1) // self._m - _BEFORE, 0) + _POINTS)
        step, hold = np.divmod(np.arange(start, start + n_time), self._m)
        first = np.maximum(step - _BEFORE, 0)
        weights = self._weights[np.minimum(step, _BEFORE), hold]
        rows = np.zeros((n_time, self._sensed.shape[1]))
        for p in range(_POINTS):
            rows += weights[:, p, None] * self._rows[first + p - self._first_row]
        keep = max((start + n_time) // self._m - _BEFORE, 0)
        self._rows, self._first_row = self._rows[keep - self._first_row :], keep
        return rows

    def _remember(self, start: int, control: FloatArray) -> None:
        if self._control is None:
            # The table starts in the motion: the hold before the first continues its slope.
            self._control = np.concatenate([2.0 * control[:1] - control[1:2], control])
        else:
            end = self._done * self._m - 1 + len(self._control)
            self._control = np.concatenate([self._control, control[end - start :]])

    def _run(self, end: int) -> None:
        """Integrate up to step `end`, and keep the true rows at the beginning of each step."""
        n, m = (end - self._done), self._m
        if n <= 0:
            return
        assert self._control is not None
        held = self._control[: n * m + 2]
        slope = (held[1::m] - held[:-1:m]) / self._dt
        mean = sum((held[1 + i : 1 + n * m : m] for i in range(1, m)), held[1 : 1 + n * m : m]) / m
        rows = self._engine.advance(self._done, mean - self._lag * np.diff(slope, axis=0) / (m * self._dt))
        # Input by input and not as one product, whose rounding would depend on the number of rows.
        for i in np.flatnonzero(slope.any(axis=0)):
            rows = rows + slope[:-1, i, None] * (self._lag * self._sensed[i])
        self._rows = np.concatenate([self._rows, rows])
        self._control = self._control[n * m :]
        self._done = end

    @staticmethod
    def initial(acceleration: FloatArray, control: FloatArray, holds: int, dt: float) -> FloatArray:
        """Return what the first step's velocity is off the true one [rad/s, m/s], shape (nv,).

        Parameters
        ----------
        acceleration : ndarray, shape (nu, nv)
            From `responses`.
        control : ndarray, shape (n_time, nu)
            Inputs from t = 0 on.
        holds : int
            Base steps per integration step.
        dt : float
            Base step [s].
        """
        offset: FloatArray = -lag(holds, dt) * ((control[1] - control[0]) / dt) @ acceleration
        return offset


def lag(holds: int, dt: float) -> float:
    """Return epsilon [s^2], the difference of the variances of a hold over `holds` base steps `dt` [s] and over one."""
    return (holds**2 - 1) * dt**2 / 12.0


def _weights(holds: int) -> FloatArray:
    """Return Lagrange's weights, shape (3, holds, 6): by intervals before the point, hold within the step, point."""
    nodes = np.arange(_POINTS)
    x = np.arange(_BEFORE + 1)[:, None] + np.arange(holds)[None, :] / holds
    weights = np.ones((*x.shape, _POINTS))
    for p in nodes:
        for other in nodes[nodes != p]:
            weights[..., p] *= (x - other) / (p - other)
    return weights
