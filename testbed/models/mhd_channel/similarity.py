r"""The channel with its secondary flow: swirl and radial flow between the walls in similarity form.

Near a radius r the fluid moves, seen from the walls, with r s(h) around, r g(h) outwards and v(h) along the height (von
Karman 1921). Both walls turn at W(t) and no fluid is gained at any radius:

.. math:: s_t &= \nu s_{hh} - \delta s - \kappa \langle s \rangle - W_t - 2 W g - 2 g s - v s_h \\
    g_t &= \nu g_{hh} - b g - p(t) + 2 W s + s^2 - g^2 - v g_h, \quad \langle g \rangle = 0, \quad v_h = -2 g

p is the pressure that keeps the mean of g at zero, b the braking of radial flow: a for an axial field, which brakes all
that crosses it, 0 for a radial one. Without g this is the linear channel, of which s is the slip u.
"""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numba import njit

from testbed.errors import RunError
from testbed.models.mhd_channel.chebyshev import even_operators, even_transport
from testbed.models.mhd_channel.modes import ChannelStage

if TYPE_CHECKING:
    from testbed.models.mhd_channel.modes import ChannelModes
    from testbed.signals import FloatArray


class Basis(NamedTuple):
    """Modes of one of the two flows on the points 1 ... n/2 of the grid.

    Parameters
    ----------
    decay : ndarray, shape (n_mode,)
        lambda [1/s].
    flow : ndarray, shape (n_row, n_mode)
        What a unit of each mode makes of flow and slope, n/2 rows each, and of v for the radial flow [-].
    project : ndarray, shape (n_mode, n/2)
        Share of each mode in a force at the points [-].
    """

    decay: FloatArray
    flow: FloatArray
    project: FloatArray


def swirl_basis(modes: ChannelModes) -> tuple[Basis, FloatArray]:
    """Return the modes of the linear channel, each of unit size, and how much of each a unit slip everywhere is.

    Parameters
    ----------
    modes : ChannelModes
        Of the channel.
    """
    size = np.linalg.norm(modes.shape, axis=0)
    vectors = modes.shape / size
    slope, _ = even_transport(2 * size.size)
    return Basis(modes.decay, np.vstack([vectors, slope @ vectors]), np.linalg.inv(vectors)), size


@functools.lru_cache(maxsize=32)
def radial_basis(nodes: int, diffusion: float, damping: float) -> Basis:
    r"""Diagonalise :math:`g_t = d\,g_{xx} - b g - p`, g = 0 at x = 0 and 1, p such that :math:`\langle g\rangle = 0`.

    Parameters
    ----------
    nodes : int
        Chebyshev intervals, even [-].
    diffusion, damping : float
        d = nu/l^2 and b [1/s].

    Returns
    -------
    Basis
        nodes/2 - 1 modes; its arrays are read-only.

    Raises
    ------
    ValueError
        If a mode of the grid oscillates or does not decay, which those of this flow never do.
    """
    second, mean = even_operators(nodes)
    half = nodes // 2
    without_mean = np.eye(half) - np.outer(np.ones(half), mean) / mean.sum()
    values, vectors = np.linalg.eig(diffusion * without_mean @ second)
    # One of the operator's modes has a mean, and no flow of the others has any of it.
    kept = np.delete(np.arange(half), np.argmax(np.abs(mean @ vectors)))
    values = values[kept] - damping
    if np.iscomplexobj(values) or np.any(values >= 0.0):
        msg = f"nodes: expected a grid with real, decaying modes of radial flow, got others with {nodes} intervals"
        raise ValueError(msg)
    slope, integral = even_transport(nodes)
    flow = np.vstack([np.eye(half), slope, -2.0 * integral]) @ vectors[:, kept]
    basis = Basis(-values, flow, (np.linalg.inv(vectors) @ without_mean)[kept])
    for array in basis:
        array.flags.writeable = False
    return basis


@njit(cache=True, fastmath={"reassoc", "contract"})
def _times(matrix, x, out):  # type: ignore[no-untyped-def] # pragma: no cover
    """Set out = matrix x."""
    for i in range(out.size):
        total = 0.0
        for j in range(x.size):
            total += matrix[i, j] * x[j]
        out[i] = total


@njit(cache=True, fastmath={"reassoc", "contract"})
def _forces(rate, swirl, radial, of_swirl, of_radial):  # type: ignore[no-untyped-def] # pragma: no cover
    """Set the nonlinear terms of both equations; `swirl` is (s, s_x), `radial` (g, g_x, v/l), one after the other."""
    n = of_swirl.size
    for i in range(n):
        s, g, v = swirl[i], radial[i], radial[2 * n + i]
        of_swirl[i] = -2.0 * g * (rate + s) - v * swirl[n + i]
        of_radial[i] = s * (2.0 * rate + s) - g * g - v * radial[n + i]


@njit(cache=True, fastmath={"reassoc", "contract"})
def _kick(stepper, forces, past, due, first):  # type: ignore[no-untyped-def] # pragma: no cover
    """Set `due`, what the forces add to the modes over the next step if they go on as they did over the last one."""
    _, whole, growing = stepper
    for i in range(due.size):
        due[i] = whole[i] * forces[i] + (0.0 if first else growing[i] * (forces[i] - past[i]))
        past[i] = forces[i]


@njit(cache=True, fastmath={"reassoc", "contract"})
def _advance(swirl, radial, push, jump, gain, turning, previous, wall, out, first):  # type: ignore[no-untyped-def] # pragma: no cover
    """Move both flows through the samples `wall`, the walls' rate less `turning`; where `first`, the first is a jump.

    Of either flow: (modes, forces of the last step, what they add to the next), steppers, flow and project.
    """
    (c, past, due), stepper, flow, project = swirl
    (y, past_radial, due_radial), stepper_radial, flow_radial, project_radial = radial
    n = project.shape[1]
    s, g = np.empty(flow.shape[0]), np.empty(flow_radial.shape[0])
    at_points, at_points_radial = np.empty(n), np.empty(n)
    forces, forces_radial = np.empty(c.size), np.empty(y.size)
    for k in range(wall.size):
        increment, begins = wall[k] - previous, first and k == 0
        previous = wall[k]
        total = 0.0
        for i in range(c.size):
            value = c[i] - jump[i] * increment if begins else stepper[0][i] * c[i] - push[i] * increment + due[i]
            c[i] = value
            total -= gain[i] * value
        out[k] = total
        for i in range(y.size):
            y[i] = stepper_radial[0][i] * y[i] + due_radial[i]
        _times(flow, c, s)
        _times(flow_radial, y, g)
        _forces(turning + wall[k], s, g, at_points, at_points_radial)
        _times(project, at_points, forces)
        _times(project_radial, at_points_radial, forces_radial)
        _kick(stepper, forces, past, due, begins)
        _kick(stepper_radial, forces_radial, past_radial, due_radial, begins)
    return previous


def _stepper(decay: FloatArray, T: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    r"""Return what a step leaves of each mode, and what it makes of a force, constant and per change over a step.

    .. math:: E = e^{-\lambda T}, \quad \frac{1 - E}{\lambda}, \quad \frac{E - 1 + \lambda T}{\lambda^2 T}
    """
    exponent = -decay * T
    lost = np.expm1(exponent)
    return np.exp(exponent), -lost / decay, (lost - exponent) / (decay**2 * T)


class SimilarityStage(ChannelStage):
    r"""The channel with its secondary flow in time: linear parts exact, the others by exponential time differencing.

    Of the nonlinear terms N of a mode the step T takes the straight line through the last two (Adams-Bashforth):

    .. math:: c^+ = E c + \frac{1 - E}{\lambda} N_k + \frac{E - 1 + \lambda T}{\lambda^2 T} (N_k - N_{k - 1})
        - \frac{1 - E}{\lambda T} w\, (W_{k + 1} - W_k)

    The walls' rate is in rad/s here, and counts as such: a case that turns steadily has another secondary flow.

    Parameters
    ----------
    modes : ChannelModes
        Of the channel.
    sample_rate_hz : float
        Rate 1/T of the samples [Hz].
    radial : Basis
        Modes of the radial flow.

    References
    ----------
    Cox and Matthews, J. Comput. Phys. 176 (2002) 430, equation (6) (ETD2); von Karman, Z. angew. Math. Mech. 1 (1921)
    233 (similarity form).
    """

    def __init__(self, modes: ChannelModes, sample_rate_hz: float, radial: Basis) -> None:
        super().__init__(modes, sample_rate_hz)
        basis, self._size = swirl_basis(modes)
        T = 1.0 / sample_rate_hz
        self._swirl, self._radial = (
            (tuple(np.zeros((3, one.decay.size))), _stepper(one.decay, T), one.flow.copy(), one.project.copy())
            for one in (basis, radial)
        )
        self._push, self._gain = self._push * self._size, self._gain / self._size

    def _move(self, wall: FloatArray, out: FloatArray) -> None:
        drive = self._push, self._size, self._gain, self._turning
        first = self._n_done == 0
        self._previous = _advance(self._swirl, self._radial, *drive, self._previous, wall, out, first)
        if not np.isfinite(out).all():
            msg = (
                "flow: expected a secondary flow that the steps of the samples can follow, got one that grew without "
                "bound; take a higher sample rate or a smaller motion"
            )
            raise RunError(msg)

    def _slip(self) -> FloatArray:
        (modes, *_), _, flow, _ = self._swirl
        return flow[: modes.size] @ modes

    def radial_profile(self) -> FloatArray:
        """Return the radial flow g(h) as of the last sample, over the radius [1/s].

        Returns
        -------
        ndarray, shape (nodes + 1,)
            At the channel's `heights`, zero at the walls; its mean is zero.
        """
        (modes, *_), _, flow, _ = self._radial
        half = (flow @ modes)[: modes.size + 1]
        return np.concatenate([[0.0], half, half[-2::-1], [0.0]])
