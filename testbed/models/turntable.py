"""The air-bearing turntable: commanded motion in, true inertial rates out."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np

from testbed.errors import RunError
from testbed.models import plant, servo, stepping, table_modes
from testbed.models.engine import Engine
from testbed.models.servo import required_torque
from testbed.models.turntable_parameters import Cogging, Mounting, TurntableParameters

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

    from testbed.models.motion import CommandBlock
    from testbed.signals import FloatArray

    Poses = dict[str, tuple[FloatArray, FloatArray]]

__all__ = ["Cogging", "Mounting", "TruthBlock", "Turntable", "TurntableParameters", "required_torque"]


@dataclass(frozen=True)
class TruthBlock:
    """What the table really did over `n_time` steps, at t_k = k / sample_rate for k = start ... start + n_time - 1.

    Parameters
    ----------
    start : int
        Index k of the first sample.
    rate : ndarray, shape (n_time,)
        Inertial rate about the rotor's axis [rad/s], the same at every point of the rotor.
    angle : ndarray, shape (n_time,)
        Inertial angle about the vertical, spindle plus platform yaw, not wrapped [rad].
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


class Turntable:
    """The turntable in time.

    State is kept between blocks; any division into blocks gives the same bits. Memory goes with the block, not with the
    run. The table starts at the commanded angle and rate, its mounts and bearing in static equilibrium under gravity.

    Parameters
    ----------
    parameters : TurntableParameters
        Of the plant; `mode` chooses what moves.
    mountings : mapping of str to Mounting
        Sensor name to its place on the table.
    sample_rate_hz : float, optional
        Base clock [Hz]: commands are held over its steps.
    substeps : int, optional
        Integration steps per step of the base clock, with the same held commands.
    holds : int, optional
        Steps of the base clock per integration step; then `process` needs a look ahead over `lookahead` steps.
    pose_stride : int, optional
        Steps between two poses.
    exposed : collection of str, optional
        Sensors whose cross rates and specific forces are wanted too.

    Raises
    ------
    ScenarioError
        If the plant cannot be built, falls over, or is too stiff for the step.
    """

    def __init__(
        self,
        parameters: TurntableParameters,
        mountings: Mapping[str, Mounting],
        sample_rate_hz: float = 20000.0,
        *,
        substeps: int = 1,
        holds: int = 1,
        pose_stride: int = 400,
        exposed: Collection[str] = (),
    ) -> None:
        self.parameters = parameters
        self._dt = 1.0 / sample_rate_hz
        if parameters.mode == "servo":
            table_modes.check_modes(parameters, self._dt * holds / substeps)
        self.model = plant.build(parameters, mountings, self._dt * holds / substeps, exposed)
        self._data = mujoco.MjData(self.model)
        self._motor = int(self.model.actuator_ctrladr[self.model.actuator(plant.MOTOR).id])
        self._mountings, self._names, self._exposed = dict(mountings), tuple(mountings), tuple(exposed)
        self._substeps, self._holds, self._stride = substeps, holds, pose_stride
        self.lookahead = stepping.lookahead(holds) if parameters.mode != "fixed" else 0
        self._next: int | None = None
        self._engine: Engine | None = None
        self._long: stepping.LongSteps | None = None

    def process(self, command: CommandBlock, ahead: CommandBlock | None = None) -> TruthBlock:
        """Follow the command over its steps.

        Parameters
        ----------
        command : CommandBlock
            The steps after those of the call before [rad/s, rad].
        ahead : CommandBlock, optional
            The `lookahead` steps behind them, for integration steps of several holds.

        Returns
        -------
        TruthBlock
            At the beginning of each of these steps.

        Raises
        ------
        RunError
            If the command is not finite, the motor saturates or the plant diverges: what and at which time.
        ValueError
            If the block does not follow the one before.
        """
        if self._next not in {None, command.start}:
            msg = f"start: expected {self._next}, the sample after the last block, got {command.start}"
            raise ValueError(msg)
        self._check_finite(command)
        self._next = command.start + command.n_time
        if self.parameters.mode == "fixed":
            return self._fixed(command)
        return self._truth(command, self._simulate(command) if self._holds == 1 else self._leap(command, ahead))

    def _simulate(self, command: CommandBlock) -> FloatArray:
        if self._engine is None:
            self._engine = self._start(command)
        return self._engine.advance(command.start, self._control(command))

    def _leap(self, command: CommandBlock, ahead: CommandBlock | None) -> FloatArray:
        """Return the sensor rows of integration steps that span several holds."""
        if ahead is None or ahead.n_time != self.lookahead:
            msg = f"ahead: expected {self.lookahead} steps behind the block, got {ahead and ahead.n_time}"
            raise ValueError(msg)
        held = self._control(command)
        control = np.concatenate([held, self._control(ahead)])
        if self._long is None:
            self._long = self._start_long(command, control)
        rows = self._long.advance(command.start, command.n_time, control)
        # The torque follows the held references also within a step.
        entry = self.model.sensor("torque").adr[0]
        rows[:, entry] = held[:, self._motor]
        if self.parameters.mode != "ideal":
            q, v = self._column(f"q_{plant.SPINDLE}", rows), self._column("encoder_rate", rows)
            reference = held[:, self._motor : self._motor + 3]
            rows[:, entry] = servo.motor_torque(self.parameters, reference, q, v)
        return rows

    def _truth(self, command: CommandBlock, rows: FloatArray) -> TruthBlock:
        self._check_motor(command.start, self._column("torque", rows))
        angles = rows[:, : self.model.nq]
        yaw = self._column("q_platform_rz", rows) if self.parameters.mode == "servo" else 0.0
        return TruthBlock(
            start=command.start,
            rate=self._column(f"rate_{plant.AXIS}", rows),
            angle=self._column(f"q_{plant.SPINDLE}", rows) + yaw,
            sensor_rate={name: self._column(f"rate_{name}", rows) for name in self._names},
            encoder_rate=self._column("encoder_rate", rows),
            torque=self._column("torque", rows),
            poses=self._poses(command.start, angles),
            cross_rate={name: self._columns(f"rate_{name}", rows)[:, :2] for name in self._exposed},
            specific_force={name: self._columns(f"force_{name}", rows) for name in self._exposed},
        )

    def _fixed(self, command: CommandBlock) -> TruthBlock:
        rate, angle = command.rate[:-1].copy(), command.angle[:-1].copy()
        # A rate about the vertical, seen along a tilted axis: the last element of the site's rotation.
        projection = {name: float(plant.rotation(self.model.site(name).quat)[2, 2]) for name in self._names}
        sensor_rate = {name: factor * rate for name, factor in projection.items()}
        surroundings = {name: self._fixed_surroundings(name, command) for name in self._exposed}
        return TruthBlock(
            start=command.start,
            rate=rate,
            angle=angle,
            sensor_rate=sensor_rate,
            encoder_rate=rate.copy(),
            torque=np.zeros(command.n_time),
            poses=self._poses(command.start, angle[:, None]),
            cross_rate={name: cross for name, (cross, _) in surroundings.items()},
            specific_force={name: force for name, (_, force) in surroundings.items()},
        )

    def _fixed_surroundings(self, name: str, command: CommandBlock) -> tuple[FloatArray, FloatArray]:
        """Return cross rates and specific force of a mounting that turns about the vertical and does nothing else."""
        x, y, _ = self._mountings[name].position
        rate, acceleration = command.rate[:-1], np.diff(command.rate) / self._dt
        force = [
            -acceleration * y - rate**2 * x,
            acceleration * x - rate**2 * y,
            np.full(rate.size, self.parameters.gravity),
        ]
        to_table = plant.rotation(self.model.site(name).quat)
        turned: FloatArray = (to_table.T[:, :, None] * np.array(force)).sum(axis=1).T
        return rate[:, None] * to_table[2, :2], turned

    def _start_long(self, command: CommandBlock, control: FloatArray) -> stepping.LongSteps:
        data, qvel = self._at_start(command)
        acceleration, sensed = stepping.responses(self.model, data)
        qvel += stepping.LongSteps.initial(acceleration, control, self._holds, self._dt)
        engine = Engine(self.model, data.qpos, qvel, self._substeps)
        return stepping.LongSteps(engine, sensed, self._holds, self._dt)

    def _start(self, command: CommandBlock) -> Engine:
        data, qvel = self._at_start(command)
        return Engine(self.model, data.qpos, qvel, self._substeps)

    def _at_start(self, command: CommandBlock) -> tuple[Any, FloatArray]:
        """Return the table in its equilibrium at the commanded angle, and its first velocities."""
        data, parameters = mujoco.MjData(self.model), self.parameters
        spindle = self.model.joint(plant.SPINDLE).qposadr[0]
        data.qpos[spindle] = command.angle[0]
        if parameters.mode == "servo":
            data.ctrl[self._motor] = command.angle[0]
            table_modes.settle(self.model, data)
        qvel = np.zeros(self.model.nv)
        qvel[spindle] = command.rate[0]
        return data, qvel

    def _control(self, command: CommandBlock) -> FloatArray:
        control = np.zeros((command.n_time, self.model.nu))
        parameters = self.parameters
        if parameters.mode == "ideal":
            drag = parameters.spindle_drag
            control[:, self._motor] = servo.exact_torque(parameters.spindle_inertia, drag, command.rate, self._dt)
        else:
            control[:, self._motor] = command.angle_mid
            control[:, self._motor + 1] = command.rate_mid
            control[:, self._motor + 2] = servo.feed_forward(parameters, command, self._dt)
        return control

    def _column(self, sensor: str, rows: FloatArray) -> FloatArray:
        """Return the last component of a sensor: the value of a scalar, the z of an angular velocity."""
        entry = self.model.sensor(sensor)
        return rows[:, entry.adr[0] + entry.dim[0] - 1].copy()

    def _columns(self, sensor: str, rows: FloatArray) -> FloatArray:
        """Return all components of a sensor, shape (n_time, n_component)."""
        entry = self.model.sensor(sensor)
        return rows[:, entry.adr[0] : entry.adr[0] + entry.dim[0]].copy()

    def _poses(self, start: int, qpos: FloatArray) -> Poses:
        """Return where the bodies are at the pose samples, from joint positions, shape (n_time, nq)."""
        picked = qpos[-start % self._stride :: self._stride]
        ids = [self.model.body(name).id for name in plant.BODIES]
        places, turns = np.empty((len(picked), len(ids), 3)), np.empty((len(picked), len(ids), 4))
        for i, q in enumerate(picked):
            self._data.qpos[:] = q
            mujoco.mj_kinematics(self.model, self._data)
            places[i], turns[i] = self._data.xpos[ids], self._data.xquat[ids]
        return {name: (places[:, i].copy(), turns[:, i].copy()) for i, name in enumerate(plant.BODIES)}

    def _check_finite(self, command: CommandBlock) -> None:
        for name in ("rate", "angle", "rate_mid", "angle_mid"):
            bad = ~np.isfinite(getattr(command, name))
            if bad.any():
                t = (command.start + int(np.argmax(bad))) * self._dt
                value = getattr(command, name)[bad][0]
                msg = f"turntable: expected a finite command, got {name} = {value} at t = {t:.6g} s"
                raise RunError(msg)

    def _check_motor(self, start: int, torque: FloatArray) -> None:
        limit = self.parameters.torque_limit
        saturated = np.abs(torque) >= limit
        if self.parameters.mode == "servo" and saturated.any():
            t = (start + int(np.argmax(saturated))) * self._dt
            msg = f"turntable: the motor saturated at its {limit:g} N*m at t = {t:.6g} s; the run got this far"
            raise RunError(msg)
