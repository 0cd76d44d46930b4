"""The MHD channel in time: the spectral grid diagonalised once, each mode an exact exponential recursion."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numba import njit

from testbed.errors import quoted
from testbed.models.mhd_channel.chebyshev import even_operators

if TYPE_CHECKING:
    from testbed.signals import ComplexArray, FloatArray


@dataclass(frozen=True)
class ChannelModes:
    r"""Modes of the channel: :math:`\dot z_i = \dot v - \lambda_i z_i`, :math:`-\langle u\rangle = \sum_i g_i z_i`.

    Parameters
    ----------
    decay : ndarray, shape (n_mode,)
        lambda, ascending [1/s].
    gain : ndarray, shape (n_mode,)
        g [-]. They add up to 1 - 1/(nodes^2 - 1): the mean of a slip that is one at all points but the walls.
    shape : ndarray, shape (n_mode, n_mode)
        Minus the slip at the points from the first off the wall to the centre, one column per unit z_i [-].
    """

    decay: FloatArray
    gain: FloatArray
    shape: FloatArray

    def response(self, s: ComplexArray) -> ComplexArray:
        r"""Return :math:`\sum_i g_i s/(s + \lambda_i)` at s [rad/s]; complex, shape of `s` [-]."""
        total = np.zeros_like(s)
        for gain, decay in zip(self.gain, self.decay, strict=True):
            total += gain * (s / (s + decay))
        return total


@functools.lru_cache(maxsize=32)
def channel_modes(nodes: int, diffusion: float, damping: float, coupling: float) -> ChannelModes:
    r"""Diagonalise :math:`u_t = d\,u_{xx} - \delta u - \kappa \langle u\rangle - \dot v`, u = 0 at x = 0 and 1.

    Parameters
    ----------
    nodes : int
        Chebyshev intervals, even [-].
    diffusion : float
        d = nu/l^2 [1/s].
    damping, coupling : float
        delta and kappa: Lorentz braking by the local and by the mean slip [1/s].

    Returns
    -------
    ChannelModes
        nodes/2 modes, sorted by decay; the arrays are read-only.

    Raises
    ------
    ValueError
        If a mode of the grid oscillates or does not decay, which the channel's modes never do.
    """
    second, mean = even_operators(nodes)
    ones = np.ones(nodes // 2)
    values, vectors = np.linalg.eig(diffusion * second - damping * np.eye(nodes // 2) - coupling * np.outer(ones, mean))
    if np.iscomplexobj(values) or np.any(values >= 0.0):
        worst = values[np.argmax(np.where(values.imag != 0.0, np.inf, values.real))]
        msg = f"nodes: expected a grid with real, decaying modes, got a mode of {worst:.6g} 1/s with {nodes} intervals"
        raise ValueError(msg)
    order = np.argsort(-values)
    vectors = vectors[:, order]
    shape = vectors * np.linalg.solve(vectors, ones)
    arrays = (-values[order], mean @ shape, shape)
    for array in arrays:
        array.flags.writeable = False
    return ChannelModes(*arrays)


# The compiler may choose the order of summation (SIMD), once and for all: the bits do not depend on the blocks.
@njit(cache=True, fastmath={"reassoc", "contract"})
def _advance(z, keep, push, gain, previous, wall_rate, out):  # type: ignore[no-untyped-def] # pragma: no cover
    """z+ = keep z + push (v+ - v); out = gain z+."""
    for k in range(wall_rate.size):
        increment = wall_rate[k] - previous
        total = 0.0
        for i in range(z.size):
            value = keep[i] * z[i] + push[i] * increment
            z[i] = value
            total += gain[i] * value
        out[k] = total
        previous = wall_rate[k]
    return previous


class ChannelStage:
    r"""The channel in time, exact for a wall velocity that is linear between samples.

    .. math:: z_i^+ = E_i z_i + \frac{1 - E_i}{\lambda_i T} (v_{k+1} - v_k), \quad E_i = e^{-\lambda_i T}

    Starts with wall and fluid at rest, so a first sample other than zero is a jump: the slip is minus that sample
    everywhere off the walls, and the output that sample times 1 - 1/(nodes^2 - 1), the mean on the grid.
    State is kept between calls, and any division into blocks gives the same bits.

    Parameters
    ----------
    modes : ChannelModes
        Of the channel.
    sample_rate_hz : float
        Rate 1/T of the samples [Hz].

    Raises
    ------
    ValueError
        If the sample rate is not positive and finite.
    """

    def __init__(self, modes: ChannelModes, sample_rate_hz: float) -> None:
        if not (np.isfinite(sample_rate_hz) and sample_rate_hz > 0.0):
            msg = f"sample_rate_hz: expected a positive, finite rate in Hz, got {quoted(sample_rate_hz)}"
            raise ValueError(msg)
        self._modes = modes
        exponent = -modes.decay / sample_rate_hz
        self._keep, self._push = np.exp(exponent), np.expm1(exponent) / exponent
        # Writable copies: the kernel is compiled for one kind of array only.
        self._gain = modes.gain.copy()
        self._z = np.zeros(modes.gain.size)
        self._turning, self._previous, self._n_done = 0.0, 0.0, 0

    def begin(self, turning: float) -> None:
        """Let wall and fluid have turned together before the first sample, at the rate `turning`, unit of the samples.

        Raises
        ------
        RuntimeError
            If samples have been processed.
        """
        if self._n_done:
            msg = f"turning: expected before the first sample, got it after {self._n_done}"
            raise RuntimeError(msg)
        self._turning = turning

    def process(self, wall_rate: FloatArray) -> FloatArray:
        """Move the fluid through the next samples.

        Parameters
        ----------
        wall_rate : ndarray, shape (n_time,)
            Wall velocity or rate, any unit.

        Returns
        -------
        ndarray, shape (n_time,)
            Minus the mean slip at the same instants, unit of `wall_rate`.

        Raises
        ------
        ValueError
            If a sample is NaN or infinite (named by its index since the start) or the shape is wrong; the state is then
            unchanged.
        """
        wall = np.array(wall_rate, dtype=np.float64)
        self._check(wall)
        wall -= self._turning
        out = np.empty_like(wall)
        self._move(wall, out)
        self._n_done += wall.size
        return out

    def profile(self) -> FloatArray:
        """Return the slip u(h) as of the last sample.

        Returns
        -------
        ndarray, shape (nodes + 1,)
            Fluid minus wall velocity at the channel's `heights`, zero at the walls, unit of the samples.
        """
        half = self._slip()
        return np.concatenate([[0.0], half, half[-2::-1], [0.0]])

    def _move(self, wall: FloatArray, out: FloatArray) -> None:
        """Take the wall's velocity since `begin` and write minus the mean slip."""
        first = 1 if self._n_done == 0 else 0
        if first:
            # A jump takes no time: nothing decays, every mode gets all of it.
            whole = np.ones_like(self._keep)
            self._previous = _advance(self._z, whole, whole, self._gain, self._previous, wall[:1], out[:1])
        self._previous = _advance(
            self._z, self._keep, self._push, self._gain, self._previous, wall[first:], out[first:]
        )

    def _slip(self) -> FloatArray:
        """Return the slip from the first point off the wall to the centre."""
        return -(self._modes.shape @ self._z)

    def _check(self, wall: FloatArray) -> None:
        if wall.ndim != 1:
            msg = f"wall_rate: expected shape (n_time,), got {wall.shape}"
            raise ValueError(msg)
        finite = np.isfinite(wall)
        if not finite.all():
            bad = int(np.argmin(finite))
            msg = f"wall_rate: expected finite samples, got {wall[bad]} at sample {self._n_done + bad}"
            raise ValueError(msg)
