"""The plant linearised about its equilibrium, by central differences of `mj_forward`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from testbed.signals import FloatArray

# Of angles [rad], places [m], rates, inputs: cogging of 24 periods bends by 1e-8 of itself over it, rounding is 1e-11.
_NUDGE = 1e-5


@dataclass(frozen=True)
class LinearPlant:
    """x' = A x + B u + g tau, y = y0 + C x, with x = (q - q0, v) and u the change of the inputs from rest.

    Parameters
    ----------
    A : ndarray, shape (2 nv, 2 nv)
        Dynamics [1/s].
    B : ndarray, shape (2 nv, n_input)
        Of the inputs.
    g : ndarray, shape (2 nv,)
        Of a torque on the spindle [1/(kg m^2)] and its reaction on the platform.
    C : ndarray, shape (n_output, 2 nv)
        Chosen sensors of the model.
    y0 : ndarray, shape (n_output,)
        What they show at rest.
    """

    A: FloatArray
    B: FloatArray
    g: FloatArray
    C: FloatArray
    y0: FloatArray


def linear_plant(model: Any, data: Any, inputs: Sequence[int], outputs: Sequence[int], spindle: int) -> LinearPlant:
    """Return the linear plant about the equilibrium that `data` is in.

    Parameters
    ----------
    model, data : mujoco.MjModel, mujoco.MjData
        All joints slide or turn about one axis; `data` is at rest.
    inputs, outputs : sequence of int
        Columns of the controls and of the sensor data that are wanted; these follow from the state alone.
    spindle : int
        Degree of freedom of the spindle.
    """
    at_rest = _Probe(model, data, outputs)
    nv, y0 = model.nv, at_rest.read()[1]
    A, C = np.zeros((2 * nv, 2 * nv)), np.zeros((len(outputs), 2 * nv))
    A[:nv, nv:] = np.eye(nv)
    for j in range(nv):
        A[nv:, j], C[:, j] = at_rest.slope(data.qpos, j)
        A[nv:, nv + j], C[:, nv + j] = at_rest.slope(data.qvel, j)
    B = np.zeros((2 * nv, len(inputs)))
    for i, column in enumerate(inputs):
        B[nv:, i], _ = at_rest.slope(data.ctrl, column)
    g = np.zeros(2 * nv)
    g[nv:], _ = at_rest.slope(data.qfrc_applied, spindle)
    return LinearPlant(A, B, g, C, y0)


class _Probe:
    """Reads accelerations and sensors of a state near an equilibrium, and goes back to it."""

    def __init__(self, model: Any, data: Any, outputs: Sequence[int]) -> None:
        self._model, self._data, self._outputs = model, data, list(outputs)

    def read(self) -> tuple[FloatArray, FloatArray]:
        mujoco.mj_forward(self._model, self._data)
        return self._data.qacc.copy(), self._data.sensordata[self._outputs].copy()

    def slope(self, array: Any, i: int) -> tuple[FloatArray, FloatArray]:
        """Return the derivatives of accelerations and outputs by an entry of one of the arrays of the data."""
        rest = float(array[i])
        array[i] = rest + _NUDGE
        high = self.read()
        array[i] = rest - _NUDGE
        low = self.read()
        array[i] = rest
        return (high[0] - low[0]) / (2.0 * _NUDGE), (high[1] - low[1]) / (2.0 * _NUDGE)
