r"""The plant by its modes: as exact as rounding on inputs that are held over a step, and without MuJoCo in the loop.

The linear plant x' = A x + B u + g tau falls apart into complex modes, of which one of each conjugate pair is kept,

.. math:: z_i^+ = e^{\lambda_i h} z_i + \varphi_i (b_i u + g_i \tau) + \psi_i g_i \Delta\tau, \quad
    \varphi_i = (e^{\lambda_i h} - 1) / \lambda_i, \quad y = y_0 + \mathrm{Re} \sum_i c_i z_i.

What bends with the angle (cogging) or the rate (windage) of the spindle is its torque less its linear part: over the
step it is taken as straight, through tau at the angle and rate that are expected in its middle, with the rise Delta tau
since the middle of the step before. The linear part is that of the first angle, so a wide swing makes tau large: held
flat, it would cost h^2 dtau/dt / 12 J of rate.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numba import njit

from testbed.errors import ScenarioError
from testbed.models.turntable import plant
from testbed.models.turntable.engine import refuse_bad_control, refuse_bad_rows
from testbed.models.turntable.linear import linear_plant

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from numpy.typing import NDArray

    from testbed.models.turntable.linear import LinearPlant
    from testbed.models.turntable.parameters import TurntableParameters
    from testbed.signals import ComplexArray, FloatArray

# Modes that lie closer than this have no well-defined shapes; the shipped tables have 2e3.
_WORST_CONDITION = 1e8
# The kernel's loops fill whole vector registers: 16 modes cost two thirds of 13.
_VECTOR = 8
# Of a series in |a| < 1 with factorials below: the next one is 1e-18.
_TERMS = 18
# Modes of the table that are linear but for the spindle's torque.
MODAL = ("servo", "ideal")


@dataclass(frozen=True)
class Modes:
    """A linear plant over steps of h, one of each conjugate pair of modes, padded to whole vectors with zeros.

    Parameters
    ----------
    step : ndarray of complex, shape (n_mode,)
        Factor of a mode over a step [-].
    push : ndarray of complex, shape (n_input, n_mode)
        What held inputs add over a step.
    twist, tilt : ndarray of complex, shape (n_mode,)
        What a held torque on the spindle adds over a step, and one that rises by as much about 0 [1/(N m)].
    shape : ndarray of complex, shape (n_output, n_mode)
        Outputs from modes; the real part counts.
    positions : ndarray of complex, shape (nv, n_mode)
        Positions of the joints from modes, less those at rest [rad, m].
    start : ndarray of complex, shape (n_mode,)
        The modes of the first state.
    """

    step: ComplexArray
    push: ComplexArray
    twist: ComplexArray
    tilt: ComplexArray
    shape: ComplexArray
    positions: ComplexArray
    start: ComplexArray


def modes_of(linear: LinearPlant, x0: FloatArray, dt: float) -> Modes:
    """Return the modes of a linear plant.

    Parameters
    ----------
    linear : LinearPlant
        In continuous time.
    x0 : ndarray, shape (2 nv,)
        The first state.
    dt : float
        Step h [s].

    Raises
    ------
    ScenarioError
        If modes coincide, so that they cannot be told apart.
    """
    poles, vectors = (part.astype(complex) for part in np.linalg.eig(linear.A))
    condition = float(np.linalg.cond(vectors))
    if not condition < _WORST_CONDITION:
        msg = f"turntable: engine: expected modes apart from each other, got a condition of {condition:.1e}; use mujoco"
        raise ScenarioError(msg)
    inverse = np.linalg.inv(vectors)
    kept = np.flatnonzero(poles.imag >= 0.0)
    pole, weight = poles[kept], np.where(poles[kept].imag > 0.0, 2.0, 1.0)
    # expm1 of a complex argument keeps the digits of a slow mode; a pole at 0 integrates.
    rising = np.expm1(pole * dt)
    held = np.where(pole == 0.0, dt, rising / np.where(pole == 0.0, 1.0, pole))
    nv = len(linear.A) // 2
    seen = vectors[:, kept] * weight
    return Modes(
        step=_padded(1.0 + rising),
        push=_padded((inverse @ linear.B)[kept].T * held),
        twist=_padded((inverse @ linear.g)[kept] * held),
        tilt=_padded((inverse @ linear.g)[kept] * dt * _rising(pole * dt)),
        shape=_padded(linear.C @ seen),
        positions=_padded(seen[:nv]),
        start=_padded((inverse @ x0)[kept]),
    )


def _rising(a: ComplexArray) -> ComplexArray:
    r"""Return psi / h = int_0^1 e^{a (1 - u)} (u - 1/2) du of a = lambda h, by its series where |a| is small."""
    small = np.abs(a) < 1.0
    total, near, far = np.zeros_like(a), np.where(small, a, 0.0), np.where(small, 1.0, a)
    term = np.full_like(a, 0.5)
    for k in range(1, _TERMS):
        term = term * near / (k + 2)
        total -= 0.5 * k * term
    return np.where(small, total, (np.expm1(far) - far) / far**2 - 0.5 * np.expm1(far) / far)


def _padded(modes: NDArray[Any]) -> ComplexArray:
    """Return an array with modes along its last axis, made longer by modes that are at rest and seen by nobody."""
    short = -modes.shape[-1] % _VECTOR
    return np.pad(modes, [(0, 0)] * (modes.ndim - 1) + [(0, short)])


def check_modal(parameters: TurntableParameters, exposed: Collection[str] = ()) -> None:
    """Refuse a table that is not played by its modes.

    Parameters
    ----------
    parameters : TurntableParameters
        Of the plant.
    exposed : collection of str, optional
        Sensors whose cross rates and specific forces are wanted too.

    Raises
    ------
    ScenarioError
        If the mode is neither servo nor ideal, or what is wanted turns with the table.
    """
    why = ""
    if parameters.mode not in MODAL:
        why = f"mode {' or '.join(MODAL)}, got {parameters.mode!r}"
    elif parameters.earth_rate is not None:
        why = "no earth_rate, whose part along a tilted axis turns with the table"
    elif exposed:
        why = (
            f"no sensor that feels cross rates or specific forces, which turn with the table, got {', '.join(exposed)}"
        )
    if why:
        msg = f"turntable: engine: modal: expected {why}; use mujoco or auto"
        raise ScenarioError(msg)


class ModalEngine:
    """Plays a plant by its modes and keeps its state between calls; any division into calls gives the same bits.

    Parameters
    ----------
    model, data : mujoco.MjModel, mujoco.MjData
        The plant and its equilibrium at the beginning.
    qvel : ndarray, shape (nv,)
        Initial rates [rad/s, m/s].
    inputs, outputs : sequence of int
        Columns of the controls that move, and of the sensor data that are wanted: angle and rate of the spindle first.
    parameters : TurntableParameters
        With the cogging and the windage.
    dt : float
        Step of the base clock [s].
    stride : int
        Steps between two samples of the joints' positions.

    Raises
    ------
    ScenarioError
        If the modes cannot be told apart.
    """

    def __init__(
        self,
        model: Any,
        data: Any,
        qvel: FloatArray,
        inputs: Sequence[int],
        outputs: Sequence[int],
        parameters: TurntableParameters,
        dt: float,
        stride: int,
    ) -> None:
        spindle = int(model.joint(plant.SPINDLE).dofadr[0])
        linear = linear_plant(model, data, inputs, outputs, spindle)
        self._modes = modes = modes_of(linear, np.concatenate([np.zeros(model.nv), qvel]), dt)
        self._inputs, self._rest = list(inputs), data.ctrl[list(inputs)].copy()
        self._coefficients = tuple(
            np.ascontiguousarray(part)
            for array in (modes.step, modes.push, modes.twist, modes.tilt, modes.shape)
            for part in (array.real, array.imag)
        )
        self._z = np.stack([modes.start.real, modes.start.imag])
        self._y0 = linear.y0
        angle = float(data.qpos[model.joint(plant.SPINDLE).qposadr[0]])
        self._cogging = _cogging(parameters, angle)
        self._q0, self._stride, self._dt = data.qpos.copy(), stride, dt
        # Rate and bent torque of the step before.
        windage, rate = parameters.spindle_windage, float(qvel[spindle])
        self._bend = np.array([windage, rate, dt, -windage * rate * abs(rate)])

    def advance(self, start: int, control: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Play the next steps.

        Parameters
        ----------
        start : int
            Index k of the first step.
        control : ndarray, shape (n_time, nu)
            Inputs, each held over one step of the base clock.

        Returns
        -------
        rows : ndarray, shape (n_time, n_output)
            Outputs at the beginning of each step.
        positions : ndarray, shape (n_pose, nq)
            Joint positions at the steps k with k % stride == 0 [rad, m].

        Raises
        ------
        RunError
            If an input is not finite, or the plant diverges; with the time.
        """
        u = np.empty((len(control), len(self._inputs)))
        for i, column in enumerate(self._inputs):
            u[:, i] = control[:, column] - self._rest[i]
        if not np.isfinite(u.sum()):
            refuse_bad_control(u, start, self._dt)
        rows, first = np.empty((len(control), self._y0.size)), -start % self._stride
        kept = np.empty((len(range(first, len(control), self._stride)), *self._z.shape))
        shot = first, self._stride, kept
        _play(*self._coefficients, self._y0, self._z, self._cogging, self._bend, u, rows, *shot)
        # A block whose ends are finite is fine: what grows without bound in a linear plant does not come back.
        if not np.isfinite(rows[-1:]).all():
            refuse_bad_rows(rows, start, (), start, self._dt)
        shape = self._modes.positions
        moved = (shape.real * kept[:, None, 0] - shape.imag * kept[:, None, 1]).sum(axis=2)
        return rows, self._q0 + moved


def _cogging(parameters: TurntableParameters, angle: float) -> FloatArray:
    """Return amplitude, periods, phase at the start, and torque and slope there, one row a harmonic of the motor."""
    harmonics = parameters.cogging if parameters.has_plant else ()
    rows = np.zeros((len(harmonics), 5))
    for row, one in zip(rows, harmonics, strict=True):
        phase = one.periods * angle + one.phase
        slope = one.torque * one.periods * np.cos(phase)
        row[:] = one.torque, one.periods, phase, one.torque * np.sin(phase), slope
    return rows


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract"})
def _play(  # type: ignore[no-untyped-def] # pragma: no cover
    lr, li, br, bi, gr, gi, tr, ti, cr, ci, y0, z, cogging, bend, u, rows, first, stride, kept
):
    """Play held inputs; outputs 0 and 1 are angle and rate of the spindle. Inner loops run over the modes."""
    n, h, zr, zi = lr.size, bend[2], z[0], z[1]
    a, b = np.empty(n), np.empty(n)
    for k in range(len(u)):
        if k % stride == first:
            kept[k // stride] = z
        for q in range(y0.size):
            value = y0[q]
            for i in range(n):
                value += cr[q, i] * zr[i] - ci[q, i] * zi[i]
            rows[k, q] = value
        angle, rate = rows[k, 0] - y0[0], rows[k, 1]
        gained = rate - bend[1]
        middle, speed = angle + h * (0.5 * rate + 0.125 * gained), rate + 0.5 * gained
        bend[1] = rate
        torque = -bend[0] * speed * abs(speed)
        for c in range(len(cogging)):
            torque += cogging[c, 0] * np.sin(cogging[c, 1] * middle + cogging[c, 2])
            torque -= cogging[c, 3] + cogging[c, 4] * middle
        rise = torque - bend[3]
        bend[3] = torque
        for i in range(n):
            a[i] = lr[i] * zr[i] - li[i] * zi[i] + gr[i] * torque + tr[i] * rise
            b[i] = lr[i] * zi[i] + li[i] * zr[i] + gi[i] * torque + ti[i] * rise
        for j in range(u.shape[1]):
            for i in range(n):
                a[i] += br[j, i] * u[k, j]
                b[i] += bi[j, i] * u[k, j]
        for i in range(n):
            zr[i], zi[i] = a[i], b[i]
