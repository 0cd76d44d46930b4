"""What the turntable really did, block by block."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from testbed.signals import FloatArray

    Poses = dict[str, tuple[FloatArray, FloatArray]]


@dataclass(frozen=True)
class TruthBlock:
    """What the table really did over `n_time` steps, at t_k = k / sample_rate for k = start ... start + n_time - 1.

    Parameters
    ----------
    start : int
        Index k of the first sample.
    rate : ndarray, shape (n_time,)
        Inertial rate about the rotor's axis [rad/s], the same at every point of the rotor; with the Earth's if asked
        for.
    angle : ndarray, shape (n_time,)
        Angle about the vertical, spindle plus platform yaw, not wrapped [rad]; without the Earth's.
    sensor_rate : dict of str to ndarray, shape (n_time,)
        What each sensor's own axis feels [rad/s].
    encoder_rate : ndarray, shape (n_time,)
        Rate of the rotor relative to the platform [rad/s]: differs from `rate` by the recoil of the platform.
    torque : ndarray, shape (n_time,)
        Motor torque [N m].
    poses : dict of str to tuple of ndarray, shapes (n_pose, 3), (n_pose, 4)
        Body name to positions [m] and unit quaternions (w, x, y, z) at the samples with k % pose_stride == 0.
    cross_rate : dict of str to ndarray, shape (n_time, 2)
        Inertial rates about the housing's x and y axes [rad/s], of the exposed sensors.
    specific_force : dict of str to ndarray, shape (n_time, 3)
        Acceleration minus gravity at the mounting along the housing's axes [m/s^2], of the exposed sensors.
    """

    start: int
    rate: FloatArray
    angle: FloatArray
    sensor_rate: dict[str, FloatArray]
    encoder_rate: FloatArray
    torque: FloatArray
    poses: Poses
    cross_rate: dict[str, FloatArray] = field(default_factory=dict)
    specific_force: dict[str, FloatArray] = field(default_factory=dict)
