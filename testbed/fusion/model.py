r"""The augmented linear model of the fusion filters, equations (7), (18)-(20) of paper 1 for any signal order and any
sensors.

State x = [x_1, its m - 1 derivatives, states of sensor 1, states of sensor 2, ..., slow noise]. x_1 [rad/s] is the true
rate, driven through m integrators by white noise of density q; it drives every sensor, whose white input noise enters
beside it. The states of slow noise (`testbed.fusion.coloured`) stand last: each moves by itself.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import block_diag

from testbed.fusion.belief import check_belief
from testbed.fusion.coloured import slow_noise
from testbed.fusion.schedule import MOST_STEPS, common_clock, long_cycle, nearest_clock
from testbed.fusion.start import (
    REST_STD,
    StartKind,
    alternating_response,
    constant_response,
    own_covariance,
    unknown_spread,
)
from testbed.signals import van_loan

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from testbed.fusion.belief import SensorBelief
    from testbed.signals import FloatArray

# Derivatives of the rate are kept per 10 ms, so that they are of the rate's own size in the band of interest.
TIME_UNIT = 1e-2
# The derivatives of the rate at the start: of 1 deg/s at 100 Hz.
_START_STD = math.radians(1.0)
_START_FREQ_HZ = 100.0


@dataclass(frozen=True)
class FusionModel:
    """Discrete model at the fastest rate: x+ = F x + w, z = H x + v, cov w = Q, var v = R.

    Parameters
    ----------
    sensors : tuple of str
        Names of the rows of H.
    sample_rate_hz : float
        The fastest rate [Hz].
    strides : tuple of int
        Sensor i has a reading at every strides[i]-th step; the nearest whole number where its clock has another ratio.
    A, Qc : ndarray, shape (n_state, n_state)
        Dynamics [1/s] and density of the white noise [rad^2/s^3] in continuous time.
    F, Q, P0 : ndarray, shape (n_state, n_state)
        Transition [-], covariance of a step and of the start [rad^2/s^2].
    H : ndarray, shape (n_sensor, n_state)
        Readings from states [-].
    R : ndarray, shape (n_sensor,)
        Variance of a reading [rad^2/s^2].
    still : ndarray, shape (n_state,)
        The states in equilibrium with a unit constant rate [-].
    n_slow : int
        Number of states of slow noise, the last ones.
    owners : ndarray of int, shape (n_state,)
        The sensor that each state belongs to, -1 for the signal's.
    """

    sensors: tuple[str, ...]
    sample_rate_hz: float
    strides: tuple[int, ...]
    A: FloatArray
    Qc: FloatArray
    F: FloatArray
    Q: FloatArray
    H: FloatArray
    R: FloatArray
    P0: FloatArray
    still: FloatArray
    n_slow: int
    owners: NDArray[np.int64]

    @property
    def cycle(self) -> int:
        """Number of steps after which the pattern of the readings repeats."""
        return math.lcm(*self.strides)

    def check_cycle(self) -> None:
        """Raise ValueError if the cycle is too long for a design over it."""
        if reason := long_cycle(self.strides):
            msg = (
                f"sample_rate_hz: expected a cycle of at most {MOST_STEPS} steps, got {list(self.strides)}: {reason}; "
            )
            raise ValueError(msg + "`kalman` takes them")

    @property
    def due(self) -> NDArray[np.bool_]:
        """Which sensor has a reading at each step of that pattern, shape (n_step, n_sensor)."""
        return np.array([[p % stride == 0 for stride in self.strides] for p in range(self.cycle)])


def build_model(
    belief: Mapping[str, SensorBelief],
    sample_rate_hz: Mapping[str, float],
    *,
    order: int,
    q: float,
    use_input_noise: bool = True,
    coloured: bool = False,
    start: StartKind = "unknown",
    any_ratio: bool = False,
) -> FusionModel:
    """Assemble and discretise the model of the sensors that have a sample rate.

    Parameters
    ----------
    belief : mapping of str to SensorBelief
        Dynamics and noise of each sensor.
    sample_rate_hz : mapping of str to float
        Rate of each sensor [Hz].
    order : int
        Number m of integrators between the white noise and the rate.
    q : float
        Two-sided density of that noise [rad^2/s^(2m+1)].
    use_input_noise : bool, optional
        Count the sensors' input noise as process noise; False is the form of the paper.
    coloured : bool, optional
        Give the slow noise of the sensors states of its own.
    start : {"unknown", "rest"}, optional
        What P0 knows (`testbed.fusion.start`).
    any_ratio : bool, optional
        Take rates that do not divide the fastest one, for who steps from stamp to stamp.

    Returns
    -------
    FusionModel
        With R = reading_noise^2 * sample rate [rad^2/s^2].

    Raises
    ------
    ValueError
        If a sensor has no belief, or a rate is not positive or, unless `any_ratio`, does not divide the fastest one.

    References
    ----------
    Paper 1 (doi 10.1109/TIM.2024.3375962), equations (7), (18)-(20).
    """
    sensors = tuple(sample_rate_hz)
    check_belief(belief, sensors)
    fastest, strides = (nearest_clock if any_ratio else common_clock)(sample_rate_hz)
    believed = [belief[name] for name in sensors]
    A, Qc, H = continuous_model(believed, order=order, q=q, use_input_noise=use_input_noise)
    owners = np.concatenate([np.full(order, -1), *(np.full(one.n_state, i) for i, one in enumerate(believed))])
    slow_variance = np.zeros(0)
    if coloured:
        A, Qc, H, owners, slow_variance = _with_slow_noise(believed, A, Qc, H, owners)
    F, Q = van_loan(A, Qc, 1.0 / fastest)
    R = np.array([one.reading_noise**2 * sample_rate_hz[name] for name, one in zip(sensors, believed, strict=True)])
    P0, still = _start(believed, A, Qc, order, slow_variance, start)
    return FusionModel(sensors, fastest, strides, A, Qc, F, Q, H, R, P0, still, slow_variance.size, owners)


def _with_slow_noise(
    believed: list[SensorBelief], A: FloatArray, Qc: FloatArray, H: FloatArray, owners: NDArray[np.int64]
) -> tuple[FloatArray, FloatArray, FloatArray, NDArray[np.int64], FloatArray]:
    """Return the matrices with the states of slow noise behind the others, and the variance of those states at the
    start.
    """
    noises = [slow_noise(one) for one in believed]
    n, slow = len(A), [(i, part) for i, one in enumerate(noises) for part in (one.inner, one.outer)]
    rate, variance, drive = (
        np.concatenate([getattr(part, name) for _, part in slow]) for name in ("rate", "variance", "drive")
    )
    A, Qc = block_diag(A, np.diag(-rate)), block_diag(Qc, np.diag(drive))
    H = np.hstack([H, np.zeros((len(H), rate.size))])
    at = n
    for i, (inner, outer) in enumerate((one.inner, one.outer) for one in noises):
        # Noise before the dynamics enters where the rate does.
        mine = np.flatnonzero(owners == i)
        A[mine, at : at + inner.rate.size] = A[mine, :1]
        H[i, at : at + inner.rate.size] = H[i, 0]
        at += inner.rate.size
        H[i, at : at + outer.rate.size] = 1.0
        at += outer.rate.size
    owners = np.concatenate([owners, *(np.full(part.rate.size, i) for i, part in slow)])
    return A, Qc, H, owners, variance


def _start(
    believed: list[SensorBelief],
    A: FloatArray,
    Qc: FloatArray,
    order: int,
    slow_variance: FloatArray,
    start: StartKind,
) -> tuple[FloatArray, FloatArray]:
    """Return P0 and the states for a unit constant rate; the equations stand in `testbed.fusion.start`."""
    rest = slice(order, None)
    sensors, drive = A[rest, rest], A[rest, 0]
    P0 = np.zeros_like(A)
    P0[rest, rest] = own_covariance(sensors, Qc[rest, rest])
    first = len(sensors) - slow_variance.size
    for j, variance in zip(range(first, len(sensors)), slow_variance, strict=True):
        if not sensors[j].any():
            held = constant_response(sensors, sensors[:, j]) + np.eye(len(sensors))[j]
            P0[rest, rest] += variance * np.outer(held, held)
    still = np.zeros(len(A))
    still[0], still[rest] = 1.0, constant_response(sensors, drive)
    for k in range(1, order):
        P0[k, k] = (_START_STD * (2.0 * np.pi * _START_FREQ_HZ * TIME_UNIT) ** k) ** 2
    if start == "rest":
        P0 += REST_STD**2 * np.outer(still, still)
    else:
        spread = unknown_spread(believed)
        moving = np.zeros(len(A))
        moving[0], moving[rest] = 1.0, np.abs(alternating_response(sensors, drive))
        P0 += spread.constant**2 * np.outer(still, still) + np.diag((spread.alternating * moving) ** 2)
    return P0, still


def continuous_model(
    believed: list[SensorBelief], *, order: int, q: float, use_input_noise: bool
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return (A, Qc, H) in continuous time.

    Parameters
    ----------
    believed : list of SensorBelief
        One per sensor, in the order of the rows of H.
    order, q, use_input_noise : int, float, bool
        As for `build_model`; q [rad^2/s^(2m+1)].

    Returns
    -------
    A, Qc, H : ndarray, shapes (n_state, n_state), (n_state, n_state), (n_sensor, n_state)
        Dynamics [1/s], density of the white noise [rad^2/s^3], output rows [-].

    Raises
    ------
    ValueError
        If a sensor with feed-through has input noise: it would be output noise too, correlated with the process.
    """
    realisations = [one.realisation() for one in believed]
    chain = np.diag(np.full(order - 1, 1.0 / TIME_UNIT), 1)
    A = block_diag(chain, *(one.A for one in realisations))
    Qc = np.zeros_like(A)
    Qc[order - 1, order - 1] = q * TIME_UNIT ** (2 * (order - 1))
    H = np.zeros((len(believed), A.shape[0]))
    at = order
    for i, (sensor, one) in enumerate(zip(believed, realisations, strict=True)):
        part = slice(at, at + one.B.size)
        A[part, 0] = one.B
        H[i, part], H[i, 0] = one.C, one.D
        if use_input_noise and sensor.input_noise > 0.0 and one.B.size:
            if one.D != 0.0:
                msg = (
                    f"input_noise: expected 0 for a sensor with feed-through {one.D:g}; "
                    "give it as output_noise, or add a pole"
                )
                raise ValueError(msg)
            Qc[part, part] = sensor.input_noise**2 * np.outer(one.B, one.B)
        at = part.stop
    return A, Qc, H


def covariance_root(P: FloatArray) -> FloatArray:
    """Return D with D D' = P for a positive semidefinite P [state^2], lower triangular, shape (n_state, n_state)
    [state].

    By the eigenvalues of the correlations, so that a state of small variance keeps its digits beside one of large
    variance.
    """
    std = np.sqrt(np.diag(P))
    scale = np.where(std > 0.0, std, 1.0)
    values, vectors = np.linalg.eigh(P / np.outer(scale, scale))
    # Symmetric before the QR, so that a diagonal P has a diagonal root.
    symmetric = vectors * np.sqrt(np.clip(values, 0.0, None)) @ vectors.T
    triangle = np.asarray(np.linalg.qr(symmetric, mode="r")).T
    root: FloatArray = scale[:, None] * triangle * np.where(np.diag(triangle) < 0.0, -1.0, 1.0)
    return root
