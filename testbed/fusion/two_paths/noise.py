"""What the noise of two sensors leaves behind a filter of two fixed paths: the covariance of sensors and filter
together.
"""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING

import numpy as np

from testbed.fusion.two_paths.design import input_psd

if TYPE_CHECKING:
    from testbed.fusion.belief import SensorBelief
    from testbed.fusion.model import FusionModel
    from testbed.fusion.two_paths.paths import Paths
    from testbed.signals import FloatArray

_DOUBLINGS = 40
# Where slow noise is looked for [Hz].
_LOWEST_HZ, _HIGHEST_HZ = 1e-6, 1e2


def noise_variance(paths: Paths, model: FusionModel, slow: int, fast: int) -> FloatArray:
    """Return the variance that the sensors' noise leaves at each step of the cycle [rad^2/s^2], shape (n_step,).

    Covariance of [states of the sensors, x, fast reading, held value] with the true rate at zero, step by step over the
    cycle of slow readings, settled by doubling.

    Parameters
    ----------
    paths : Paths
        The filter.
    model : FusionModel
        The sensors: F, Q, H, R of order 1.
    slow, fast : int
        Which sensor is which.

    Raises
    ------
    ValueError
        If the error does not settle: the loop around the slow sensor is unstable.
    """
    M, W, read = _joint_steps(paths, model, slow, fast)
    around = functools.reduce(lambda done, step: step @ done, M)
    if np.max(np.abs(np.linalg.eigvals(around))) >= 1.0:
        msg = "crossover: expected one well inside the band of the slow sensor, got an unstable loop; give a lower one"
        raise ValueError(msg)
    total = np.zeros_like(around)
    for step, noise in zip(M, W, strict=True):
        total = step @ total @ step.T + noise
    for _ in range(_DOUBLINGS):
        total, around = total + around @ total @ around.T, around @ around
    variance = []
    for step, noise in zip(M, W, strict=True):
        total = step @ total @ step.T + noise
        variance.append(read @ total @ read)
    return np.array(variance)


def _joint_steps(
    paths: Paths, model: FusionModel, slow: int, fast: int
) -> tuple[list[FloatArray], list[FloatArray], FloatArray]:
    """Return transition and noise of each step of the cycle, and the row that reads the error."""
    F, Q, H = model.F[1:, 1:], model.Q[1:, 1:], model.H[:, 1:]
    Phi, Gamma, ramp, E = paths.discrete(1.0 / model.sample_rate_hz)
    n, m = len(F), len(Phi)
    z, held = n + m, n + m + 1
    move = np.eye(held + 1)
    move[:n, :n] = F
    move[z, :] = 0.0
    move[z, :n] = H[fast] @ F
    move[n:z, n:z], move[n:z, z], move[n:z, held] = Phi, Gamma - ramp, E
    move[n:z, :n] = np.outer(ramp, H[fast] @ F)
    # Process noise and the noise of the fast reading enter the sensors, the reading and, through its slope, the filter.
    enter = np.zeros((held + 1, n + 1))
    enter[:n, :n], enter[z] = np.eye(n), [*H[fast], 1.0]
    enter[n:z] = np.outer(ramp, enter[z])
    noise = enter @ np.block([[Q, np.zeros((n, 1))], [np.zeros((1, n)), model.R[fast]]]) @ enter.T
    take = np.eye(held + 1)
    take[held, :n], take[held, held] = H[slow], 0.0
    if paths.innovate:
        take[held, n:z], take[held, z] = -paths.H, -paths.J
    due = take @ noise @ take.T
    due[held, held] += model.R[slow]
    pause = model.strides[slow] - 1
    read = np.zeros(held + 1)
    read[n:z], read[z] = paths.C, paths.D
    return [take @ move, *[move] * pause], [due, *[noise] * pause], read


def slow_variance(slow: SensorBelief, fast: SensorBelief, low: tuple[FloatArray, FloatArray]) -> float:
    r"""Return the variance that the slow noise of both sensors leaves behind the loop [rad^2/s^2].

    .. math:: 2 \int |L|^2 S_{slow} + |1 - L|^2 S_{fast} / |G_{fast}|^2 \, df

    Parameters
    ----------
    slow, fast : SensorBelief
        The sensor that is better at low frequency, and the other.
    low : tuple of ndarray, shapes (n_num,), (n_den,)
        Numerator and denominator of L in s.
    """
    freq = np.geomspace(_LOWEST_HZ, _HIGHEST_HZ, 800)
    s = 2j * np.pi * freq
    L = np.polyval(low[0], s) / np.polyval(low[1], s)
    of_slow, of_fast = (one.slow_density(freq) / np.abs(one.realisation().response(freq)) ** 2 for one in (slow, fast))
    density = np.abs(L) ** 2 * of_slow + np.abs(1.0 - L) ** 2 * of_fast
    return float(2.0 * np.trapezoid(density * freq, np.log(freq)))


def alone_variance(slow: SensorBelief, band: tuple[FloatArray, FloatArray], sample_rate_hz: float) -> float:
    r"""Return the variance of the slow path by itself, :math:`2 \int |B|^2 S_{slow} \, df` [rad^2/s^2].

    Parameters
    ----------
    slow : SensorBelief
        The sensor that is better at low frequency.
    band : tuple of ndarray, shapes (n_num,), (n_den,)
        Numerator and denominator of B in s.
    sample_rate_hz : float
        Of the filter [Hz].
    """
    freq = np.geomspace(_LOWEST_HZ, 0.5 * sample_rate_hz, 800)
    s = 2j * np.pi * freq
    B = np.polyval(band[0], s) / np.polyval(band[1], s)
    return float(2.0 * np.trapezoid(np.abs(B) ** 2 * input_psd(slow)(freq) * freq, np.log(freq)))
