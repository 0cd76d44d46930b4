"""Torques of the spindle: what a motion needs, what the feed-forward adds, what makes a hinge follow exactly.

All act on I d(rate)/dt + c rate = torque, with the torque held over each step of the base clock. A torque sampled at
the start of the step would lag by half a step (0.16 rad at 1 kHz at 20 kHz), so each is built from the change over the
step and the rate in its middle.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from testbed.models.motion import CommandBlock
    from testbed.models.turntable_parameters import TurntableParameters
    from testbed.signals import FloatArray


def gains(parameters: TurntableParameters) -> tuple[float, float]:
    """Return (kp [N m/rad], kv [N m s/rad]) of the servo on the spindle angle and rate."""
    kv = parameters.spindle_inertia * 2 * np.pi * parameters.rate_bandwidth
    return kv * 2 * np.pi * parameters.position_bandwidth, kv


def feed_forward(parameters: TurntableParameters, command: CommandBlock, dt: float) -> FloatArray:
    r"""Return the feed-forward torque of each step.

    .. math:: \tau_k = (1 + \epsilon_I) I (\Omega_{k+1} - \Omega_k) / h + (1 + \epsilon_c) c\, \Omega_{k+1/2}

    Parameters
    ----------
    parameters : TurntableParameters
        Inertia, drag and the errors of both.
    command : CommandBlock
        Commanded motion [rad/s].
    dt : float
        Step h of the base clock [s].

    Returns
    -------
    ndarray, shape (n_time,)
        Torque [N m].
    """
    inertia = (1 + parameters.feedforward_inertia_error) * parameters.spindle_inertia
    drag = (1 + parameters.feedforward_drag_error) * parameters.spindle_drag
    torque: FloatArray = inertia / dt * np.diff(command.rate) + drag * command.rate_mid
    return torque


def motor_torque(
    parameters: TurntableParameters, reference: FloatArray, angle: FloatArray, rate: FloatArray
) -> FloatArray:
    """Return the torque of the motor in mode `servo`, before its limit.

    Parameters
    ----------
    parameters : TurntableParameters
        Gains.
    reference : ndarray, shape (n_time, 3)
        Angle [rad], rate [rad/s] and feed-forward torque [N m] that are held.
    angle, rate : ndarray, shape (n_time,)
        Of the spindle [rad], [rad/s].

    Returns
    -------
    ndarray, shape (n_time,)
        Torque [N m].
    """
    kp, kv = gains(parameters)
    torque: FloatArray = kp * (reference[:, 0] - angle) + kv * (reference[:, 1] - rate) + reference[:, 2]
    return torque


def exact_torque(inertia: float, drag: float, rate: FloatArray, dt: float) -> FloatArray:
    r"""Return the held torque that takes a hinge exactly from each rate to the next (zero-order-hold inverse).

    .. math:: \tau_k = c \left( \Omega_k + \frac{\Omega_{k+1} - \Omega_k}{1 - e^{-c h / I}} \right)

    Parameters
    ----------
    inertia, drag : float
        I [kg m^2] and c [N m s/rad] of the hinge.
    rate : ndarray, shape (n_time + 1,)
        Wanted rate at the ends of the steps [rad/s].
    dt : float
        Step h [s].

    Returns
    -------
    ndarray, shape (n_time,)
        Torque [N m].
    """
    exponent = drag * dt / inertia
    # x / (1 - exp(-x)) -> 1: without drag the same formula is I d(rate) / h.
    factor = exponent / -np.expm1(-exponent) if exponent > 0.0 else 1.0
    torque: FloatArray = drag * rate[:-1] + inertia / dt * factor * np.diff(rate)
    return torque


def required_torque(parameters: TurntableParameters, command: CommandBlock, sample_rate_hz: float) -> FloatArray:
    r"""Return the motor torque that a motion needs at most in each step.

    .. math:: |I a_k + c\, \Omega_{k+1/2}| + k_v |a_k| h / 2 + \sum_i A_i, \quad a_k = (\Omega_{k+1} - \Omega_k) / h

    The second term (mode `servo`) is the rate loop, which sees the reference held at its value in mid-step while the
    table moves on; A_i are the amplitudes of the cogging, whatever their phases. Transients of the servo come on top.

    Parameters
    ----------
    parameters : TurntableParameters
        Inertia, drag, cogging.
    command : CommandBlock
        Commanded motion [rad/s].
    sample_rate_hz : float
        Base clock 1/h [Hz].

    Returns
    -------
    ndarray, shape (n_time,)
        Magnitude of the torque [N m]; the motor gives `parameters.torque_limit`.
    """
    acceleration = sample_rate_hz * np.diff(command.rate)
    motion = parameters.spindle_inertia * acceleration + parameters.spindle_drag * command.rate_mid
    if parameters.mode != "servo":
        return np.abs(motion)
    staircase = gains(parameters)[1] / (2 * sample_rate_hz) * np.abs(acceleration)
    torque: FloatArray = np.abs(motion) + staircase + sum(harmonic.torque for harmonic in parameters.cogging)
    return torque
