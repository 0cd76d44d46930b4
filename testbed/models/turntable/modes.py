"""Modes and equilibrium of the turntable's model, by finite differences: MuJoCo's own linearisation refuses RK4."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np

from testbed.errors import ScenarioError
from testbed.models.turntable import plant

if TYPE_CHECKING:
    from testbed.models.turntable.parameters import TurntableParameters
    from testbed.signals import FloatArray

# |eigenvalue| * step: RK4 is stable up to 2.78; at 1 the fastest mode is still right to 1/120 in frequency.
_FASTEST = 1.0


def coupled_modes(parameters: TurntableParameters) -> tuple[FloatArray, FloatArray]:
    """Return frequency and damping of every mode of the whole table with its servo, as found at rest under gravity.

    Parameters
    ----------
    parameters : TurntableParameters
        Of the plant, whatever its mode.

    Returns
    -------
    freq_hz, damping : ndarray, shapes (n_mode,)
        |s| / 2 pi [Hz], rising, and -Re(s) / |s| [-] of each pair of poles s; a real pole is a mode of its own, with
        damping 1 (-1 if it grows).
    """
    model = plant.build(parameters.model_copy(update={"mode": "servo"}), {}, 5e-5)
    poles = np.linalg.eigvals(linearised(model))
    poles = poles[poles.imag >= 0.0]
    poles = poles[np.argsort(np.abs(poles))]
    magnitude = np.abs(poles)
    return magnitude / (2 * np.pi), -poles.real / magnitude


def check_modes(parameters: TurntableParameters, dt: float) -> None:
    """Refuse a plant that falls over or that is too stiff for the step.

    Parameters
    ----------
    parameters : TurntableParameters
        Of the plant.
    dt : float
        Integration step [s].

    Raises
    ------
    ScenarioError
        If a mode grows, or the fastest is above 1 / (2 pi dt).
    """
    freq_hz, damping = coupled_modes(parameters)
    limit = _FASTEST / (2 * np.pi * dt)
    if damping.min() <= 0.0:
        growing = freq_hz[np.argmin(damping)]
        msg = f"turntable: expected a stable table, got a growing mode of {growing:.3g} Hz: its mounts are too soft"
        raise ScenarioError(msg)
    if freq_hz.max() > limit:
        msg = f"turntable: expected every mode below {limit:.4g} Hz at a step of {dt:g} s, got {freq_hz.max():.4g} Hz"
        raise ScenarioError(msg)


def linearised(model: Any) -> FloatArray:
    """Return d(q, v)'/d(q, v), shape (2 nv, 2 nv), at rest under gravity, by central differences of `mj_forward`."""
    data = mujoco.MjData(model)
    settle(model, data)
    q, nv = data.qpos.copy(), model.nv
    A = np.zeros((2 * nv, 2 * nv))
    A[:nv, nv:] = np.eye(nv)
    A[nv:, :nv] = _slope(model, data, q)
    for j, dv in enumerate(1e-6 * np.eye(nv)):
        A[nv:, nv + j] = (_acceleration(model, data, q, dv) - _acceleration(model, data, q, -dv)) / 2e-6
    return A


def settle(model: Any, data: Any) -> None:
    """Move `data` to its static equilibrium under gravity and its present controls: Newton on qacc(q) = 0.

    Parameters
    ----------
    model, data : mujoco.MjModel, mujoco.MjData
        `data.qpos` is the first guess.

    Raises
    ------
    ScenarioError
        If there is none near the guess.
    """
    q = data.qpos.copy()
    for _ in range(6):
        try:
            q -= np.linalg.solve(_slope(model, data, q), _acceleration(model, data, q))
        except np.linalg.LinAlgError:
            break
    # Rounding of the stiffest spring's acceleration is 1e-13; anything worse did not converge.
    if not np.abs(_acceleration(model, data, q)).max() < 1e-9:
        msg = "turntable: expected mounts that carry the table, got no static equilibrium"
        raise ScenarioError(msg)


def _slope(model: Any, data: Any, q: FloatArray) -> FloatArray:
    """Return d(qacc)/dq at rest, shape (nv, nv)."""
    steps = 1e-6 * np.eye(model.nv)
    columns = [_acceleration(model, data, q + dq) - _acceleration(model, data, q - dq) for dq in steps]
    slope: FloatArray = np.transpose(columns) / 2e-6
    return slope


def _acceleration(model: Any, data: Any, q: FloatArray, v: FloatArray | float = 0.0) -> FloatArray:
    data.qpos[:], data.qvel[:] = q, v
    mujoco.mj_forward(model, data)
    acceleration: FloatArray = data.qacc.copy()
    return acceleration
