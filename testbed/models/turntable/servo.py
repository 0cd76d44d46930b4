"""Torques of the spindle: what a motion needs, what the feed-forward adds, what makes a hinge follow exactly.

All act on I d(rate)/dt + c rate = torque, with the torque held over each step of the base clock. A torque sampled at
the start of the step would lag by half a step (0.16 rad at 1 kHz at 20 kHz), so each is built from the change over the
step and the rate in its middle.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import expm

if TYPE_CHECKING:
    from testbed.models.motion import CommandBlock
    from testbed.models.turntable.parameters import TurntableParameters
    from testbed.signals import FloatArray


def gains(parameters: TurntableParameters) -> tuple[float, float]:
    """Return (kp [N m/rad], kv [N m s/rad]) of the servo on the spindle angle and rate."""
    kv = parameters.spindle_inertia * 2 * np.pi * parameters.rate_bandwidth
    return kv * 2 * np.pi * parameters.position_bandwidth, kv


def feed_forward(parameters: TurntableParameters, command: CommandBlock, dt: float) -> FloatArray:
    r"""Return the feed-forward torque of each step.

    .. math:: \tau_k = (1 + \epsilon_I) I (\Omega_{k+1} - \Omega_k) / h
        + (1 + \epsilon_c) (c + b |\Omega_{k+1/2}|) \Omega_{k+1/2}

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
    error = 1 + parameters.feedforward_drag_error
    drag = error * parameters.spindle_drag
    torque: FloatArray = inertia / dt * np.diff(command.rate) + drag * command.rate_mid
    return torque + error * windage_torque(parameters, command.rate_mid)


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


def windage_torque(parameters: TurntableParameters, rate: FloatArray) -> FloatArray:
    """Return b rate |rate| [N m], shape (n_time,), at a `rate` of that shape [rad/s]."""
    return parameters.spindle_windage * rate * np.abs(rate)


def exact_torque(parameters: TurntableParameters, rate: FloatArray, dt: float) -> FloatArray:
    r"""Return the held torque that takes a hinge exactly from each rate to the next (zero-order-hold inverse).

    .. math:: \tau_k = c \left( \Omega_k + \frac{\Omega_{k+1} - \Omega_k}{1 - e^{-c h / I}} \right)
        + b\, \overline{\Omega |\Omega|}

    The bar is Simpson's mean over the step, exact for a quadratic drag on a rate that is linear over the step.

    Parameters
    ----------
    parameters : TurntableParameters
        Inertia I, drag c and windage b of the hinge.
    rate : ndarray, shape (n_time + 1,)
        Wanted rate at the ends of the steps [rad/s].
    dt : float
        Step h [s].

    Returns
    -------
    ndarray, shape (n_time,)
        Torque [N m].
    """
    inertia, drag = parameters.spindle_inertia, parameters.spindle_drag
    exponent = drag * dt / inertia
    # x / (1 - exp(-x)) -> 1: without drag the same formula is I d(rate) / h.
    factor = exponent / -np.expm1(-exponent) if exponent > 0.0 else 1.0
    torque: FloatArray = drag * rate[:-1] + inertia / dt * factor * np.diff(rate)
    ends, middle = windage_torque(parameters, rate), windage_torque(parameters, 0.5 * (rate[:-1] + rate[1:]))
    return torque + (ends[:-1] + 4.0 * middle + ends[1:]) / 6.0


def hold_matrices(inertia: float, drag: float, dt: float) -> tuple[FloatArray, FloatArray]:
    """Return what takes (angle, rate) of a hinge over `dt`: from its state and from a torque held over it.

    Parameters
    ----------
    inertia, drag : float
        I [kg m^2] and c [N m s/rad] of the hinge.
    dt : float
        Time over which the torque is held [s].

    Returns
    -------
    advance, push : ndarray, shapes (2, 2), (2,)
        x(t + dt) = advance x(t) + push torque.
    """
    # The matrix exponential of (angle, rate, torque); without drag it needs no case of its own.
    A = np.array([[0.0, 1.0, 0.0], [0.0, -drag / inertia, 1.0 / inertia], [0.0, 0.0, 0.0]])
    step = expm(A * dt)
    return step[:2, :2], step[:2, 2]


def count_torque(parameters: TurntableParameters) -> float:
    r"""Return what one count of the encoder asks of the motor through the loop in mode `digital` [N m], else 0.

    .. math:: (k_p + k_v \alpha / T) \Delta

    Parameters
    ----------
    parameters : TurntableParameters
        Of the servo and its encoder.
    """
    if parameters.mode != "digital":
        return 0.0
    (kp, kv), digital = gains(parameters), parameters.digital
    return (kp + kv * digital.filter_gain * digital.controller_rate) * digital.resolution


def required_torque(parameters: TurntableParameters, command: CommandBlock, sample_rate_hz: float) -> FloatArray:
    r"""Return the motor torque that a motion needs at most in each step.

    .. math:: |I a_k + (c + b |\Omega_{k+1/2}|) \Omega_{k+1/2}| + (k_v |a_k| + k_p |\Omega_{k+1/2}|) h / 2 + \sum_i A_i,
        \quad a_k = (\Omega_{k+1} - \Omega_k) / h

    The second term (mode `servo`) is the servo, which sees its references held at their values in mid-step while the
    table moves on; A_i are the amplitudes of the cogging, whatever their phases. In mode `digital` the second term is
    k_v |a_k| (T - h) / 2 for a feed-forward held over the controller's period T, plus one count of the encoder through
    the loop, (k_p + k_v alpha / T) Delta, and the first is larger by the sum of the ripple. Transients of the servo and
    what floor and wobble ask of it come on top.

    Parameters
    ----------
    parameters : TurntableParameters
        Inertia, drag, cogging, servo.
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
    motion += windage_torque(parameters, command.rate_mid)
    if not parameters.has_plant:
        return np.abs(motion)
    (kp, kv), digital = gains(parameters), parameters.digital
    half = 0.5 / sample_rate_hz
    if parameters.mode == "servo":
        loop = half * (kv * np.abs(acceleration) + kp * np.abs(command.rate_mid))
    else:
        motion *= 1.0 + sum(one.relative for one in digital.ripple)
        loop = kv * (0.5 / digital.controller_rate - half) * np.abs(acceleration)
        loop += count_torque(parameters)
    torque: FloatArray = np.abs(motion) + loop + sum(harmonic.torque for harmonic in parameters.cogging)
    return torque
