"""The air-bearing turntable: commanded motion in, true inertial rates out."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np

from testbed.errors import RunError
from testbed.models.turntable import modes as table_modes
from testbed.models.turntable import plant, servo, stepping
from testbed.models.turntable.digital import DigitalLoop, check_loop
from testbed.models.turntable.disturbances import Disturbances, check_floor
from testbed.models.turntable.engine import Engine
from testbed.models.turntable.fixed import FixedBase
from testbed.models.turntable.modal import ModalEngine, check_modal
from testbed.models.turntable.truth import TruthBlock
from testbed.signals import BASE_RATE_HZ

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

    from testbed.models.motion import CommandBlock
    from testbed.models.turntable.floor import FloorMotion
    from testbed.models.turntable.parameters import Mounting, TurntableParameters
    from testbed.models.turntable.truth import Poses
    from testbed.signals import FloatArray


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
    floor : FloorMotion, optional
        The realisation of `parameters.floor`; needed if that floor moves.
    modal : bool, optional
        Play the plant by the modes of its linearisation instead of MuJoCo's steps (`testbed.models.turntable.modal`).

    Raises
    ------
    ScenarioError
        If the plant cannot be built, falls over, is too stiff for the step, if its digital servo is unstable, or if
        modes are asked for where they do not hold.
    ValueError
        If the floor moves and `floor` is not given.

    Examples
    --------
    A tenth of a second of a 10 Hz swing, and what a sensor on the table feels of it.

    >>> from testbed.models.motion import MotionProfile
    >>> from testbed.models.turntable import Mounting, TurntableParameters
    >>> motion = MotionProfile([lambda t: 0.01 * np.sin(20.0 * np.pi * t)], 0.0, BASE_RATE_HZ)
    >>> table = Turntable(TurntableParameters(), {"gyro": Mounting()})
    >>> truth = table.process(motion.process(2000))
    >>> round(float(truth.sensor_rate["gyro"].max()), 3)
    0.01
    """

    def __init__(
        self,
        parameters: TurntableParameters,
        mountings: Mapping[str, Mounting],
        sample_rate_hz: float = BASE_RATE_HZ,
        *,
        substeps: int = 1,
        holds: int = 1,
        pose_stride: int = 400,
        exposed: Collection[str] = (),
        floor: FloorMotion | None = None,
        modal: bool = False,
    ) -> None:
        self.parameters = parameters
        if modal:
            check_modal(parameters, exposed)
        self._dt = 1.0 / sample_rate_hz
        check_plant(parameters, sample_rate_hz, substeps, holds)
        self.model = plant.build(parameters, mountings, self._dt * holds / substeps, exposed)
        self._data = mujoco.MjData(self.model)
        self._motor = int(self.model.actuator_ctrladr[self.model.actuator(plant.MOTOR).id])
        self._mountings, self._names, self._exposed = dict(mountings), tuple(mountings), tuple(exposed)
        self._substeps, self._holds, self._stride = substeps, holds, pose_stride
        self.lookahead = stepping.lookahead(holds) if parameters.mode != "fixed" else 0
        self._next: int | None = None
        self._modal = modal
        self._engine: Engine | DigitalLoop | None = None
        self._modes: ModalEngine | None = None
        self._long: stepping.LongSteps | None = None
        self._disturbances = (
            Disturbances(self.model, parameters, floor, sample_rate_hz) if parameters.has_plant else None
        )
        self._address = self._modal_outputs() if modal else self._all_sensors()
        self._base = FixedBase(self.model, parameters, mountings, self._dt)

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
        if self._modal:
            return self._by_modes(command)
        rows = self._simulate(command) if self._holds == 1 else self._leap(command, ahead)
        positions = rows[-command.start % self._stride :: self._stride, : self.model.nq]
        return self._truth(command, rows, self._column("torque", rows), positions)

    def _by_modes(self, command: CommandBlock) -> TruthBlock:
        if self._modes is None:
            self._modes = self._start_modes(*self._at_start(command))
        control = self._control(command)
        rows, positions = self._modes.advance(command.start, control)
        return self._truth(command, rows, self._motor_torque(control, rows), positions)

    def _simulate(self, command: CommandBlock) -> FloatArray:
        if self._engine is None:
            self._engine = self._start(command)
        control = self._control(command)
        if isinstance(self._engine, DigitalLoop):
            return self._engine.advance(command.start, control, command.angle[:-1])
        return self._engine.advance(command.start, control)

    def _all_sensors(self) -> dict[str, int]:
        """Return where each sensor begins in a row of the engine."""
        sensors = (self.model.sensor(i) for i in range(self.model.nsensor))
        return {sensor.name: int(sensor.adr[0]) for sensor in sensors}

    def _modal_outputs(self) -> dict[str, int]:
        """Return the same for the few sensors that the truth is made of: of a rate its last component.

        The rotor is rigid: what stands on it with the same tilt feels the same rate.
        """
        platform = ["q_platform_rz"] if self.parameters.has_plant else []
        names = [f"q_{plant.SPINDLE}", "encoder_rate", *platform]
        tilts = {plant.AXIS: (0.0, 0.0), **{name: one.misalignment for name, one in self._mountings.items()}}
        places = {tilt: len(names) + i for i, tilt in enumerate(dict.fromkeys(tilts.values()))}
        return {name: i for i, name in enumerate(names)} | {f"rate_{name}": places[tilts[name]] for name in tilts}

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
        rows[:, self._address["torque"]] = self._motor_torque(held, rows)
        return rows

    def _motor_torque(self, held: FloatArray, rows: FloatArray) -> FloatArray:
        """Return what the motor gives under held references, at the beginning of each step."""
        if self.parameters.mode == "ideal":
            return held[:, self._motor]
        q, v = self._column(f"q_{plant.SPINDLE}", rows), self._column("encoder_rate", rows)
        return servo.motor_torque(self.parameters, held[:, self._motor : self._motor + 3], q, v)

    def _truth(self, command: CommandBlock, rows: FloatArray, torque: FloatArray, positions: FloatArray) -> TruthBlock:
        self._check_motor(command.start, torque)
        yaw = self._column("q_platform_rz", rows) if self.parameters.has_plant else 0.0
        return TruthBlock(
            start=command.start,
            rate=self._rate(plant.AXIS, rows),
            angle=self._column(f"q_{plant.SPINDLE}", rows) + yaw,
            sensor_rate={name: self._rate(name, rows) for name in self._names},
            encoder_rate=self._column("encoder_rate", rows),
            torque=torque,
            poses=self._poses(positions),
            cross_rate={name: self._cross_rate(name, rows) for name in self._exposed},
            specific_force={name: self._columns(f"force_{name}", rows) for name in self._exposed},
        )

    def _fixed(self, command: CommandBlock) -> TruthBlock:
        base = self._base
        felt = {name: base.rate(name, command) for name in (plant.AXIS, *self._names)}
        around = {name: base.surroundings(name, command) for name in self._exposed}
        angle = command.angle[:-1].copy()
        return TruthBlock(
            start=command.start,
            rate=felt.pop(plant.AXIS),
            angle=angle,
            sensor_rate=felt,
            encoder_rate=command.rate[:-1].copy(),
            torque=np.zeros(command.n_time),
            poses=self._poses(angle[-command.start % self._stride :: self._stride, None]),
            cross_rate={name: cross for name, (cross, _) in around.items()},
            specific_force={name: force for name, (_, force) in around.items()},
        )

    def _start_long(self, command: CommandBlock, control: FloatArray) -> stepping.LongSteps:
        data, qvel = self._at_start(command)
        acceleration, sensed = stepping.responses(self.model, data)
        qvel += stepping.LongSteps.initial(acceleration, control, self._holds, self._dt)
        engine = Engine(self.model, data.qpos, qvel, self._substeps)
        return stepping.LongSteps(engine, sensed, self._holds, self._dt)

    def _start(self, command: CommandBlock) -> Engine | DigitalLoop:
        data, qvel = self._at_start(command)
        if self.parameters.mode == "digital":
            return DigitalLoop(self.model, data.qpos, qvel, self._substeps, self.parameters)
        return Engine(self.model, data.qpos, qvel, self._substeps)

    def _start_modes(self, data: Any, qvel: FloatArray) -> ModalEngine:
        entries = {i: self.model.sensor(name) for name, i in self._address.items()}
        outputs = [int(entries[i].adr[0] + entries[i].dim[0]) - 1 for i in sorted(entries)]
        inputs = [self._motor + i for i in range(3 if self.parameters.mode == "servo" else 1)]
        inputs += [] if self._disturbances is None else self._disturbances.columns
        return ModalEngine(self.model, data, qvel, inputs, outputs, self.parameters, self._dt, self._stride)

    def _at_start(self, command: CommandBlock) -> tuple[Any, FloatArray]:
        """Return the table in its equilibrium at the commanded angle, and its first velocities."""
        parameters, angle = self.parameters, command.angle[0]
        # The analogue servo holds the table at rest, so that its equilibrium is one of springs alone.
        analogue = parameters.model_copy(update={"mode": "servo"})
        rest = plant.build(analogue, {}, self._dt) if parameters.mode == "digital" else self.model
        data = mujoco.MjData(rest)
        spindle = rest.joint(plant.SPINDLE).qposadr[0]
        data.qpos[spindle] = angle
        if self._disturbances is not None:
            data.ctrl[rest.actuator_ctrladr[rest.actuator(plant.MOTOR).id]] = angle
            self._disturbances.at_start(data.ctrl, angle)
            table_modes.settle(rest, data)
        qvel = np.zeros(self.model.nv)
        qvel[spindle] = command.rate[0]
        return data, qvel

    def _control(self, command: CommandBlock) -> FloatArray:
        # Column by column in memory: what no input moves is never touched.
        control = np.zeros((self.model.nu, command.n_time)).T
        parameters = self.parameters
        if parameters.mode == "ideal":
            control[:, self._motor] = servo.exact_torque(parameters, command.rate, self._dt)
        elif parameters.mode == "digital":
            control[:, self._motor] = servo.feed_forward(parameters, command, self._dt)
        else:
            control[:, self._motor] = command.angle_mid
            control[:, self._motor + 1] = command.rate_mid
            control[:, self._motor + 2] = servo.feed_forward(parameters, command, self._dt)
        if self._disturbances is not None:
            self._disturbances.apply(control, command.start, command.angle_mid, command.rate_mid)
        return control

    def _rate(self, site: str, rows: FloatArray) -> FloatArray:
        """Return the inertial rate about the z axis of a site, the Earth's included where it is asked for."""
        rate = self._column(f"rate_{site}", rows)
        if self.parameters.earth_rate is not None:
            first = self._address[f"axis_{site}"]
            rate += self.parameters.earth_rate.along(rows[:, first : first + 3].T)
        return rate

    def _cross_rate(self, site: str, rows: FloatArray) -> FloatArray:
        """Return the inertial rates about the x and y axes of a site, shape (n_time, 2), the Earth's included."""
        cross = self._columns(f"rate_{site}", rows)[:, :2]
        if self.parameters.earth_rate is not None:
            for i, axis in enumerate(("axis_x", "axis_y")):
                cross[:, i] += self.parameters.earth_rate.along(self._columns(f"{axis}_{site}", rows).T)
        return cross

    def _column(self, sensor: str, rows: FloatArray) -> FloatArray:
        """Return the last component of a sensor: the value of a scalar, the z of an angular velocity."""
        last = 0 if self._modal else int(self.model.sensor(sensor).dim[0]) - 1
        return rows[:, self._address[sensor] + last].copy()

    def _columns(self, sensor: str, rows: FloatArray) -> FloatArray:
        """Return all components of a sensor, shape (n_time, n_component)."""
        first = self._address[sensor]
        return rows[:, first : first + int(self.model.sensor(sensor).dim[0])].copy()

    def _poses(self, positions: FloatArray) -> Poses:
        """Return where the bodies are, from joint positions at the pose samples, shape (n_pose, nq)."""
        ids = [self.model.body(name).id for name in plant.BODIES]
        places, turns = np.empty((len(positions), len(ids), 3)), np.empty((len(positions), len(ids), 4))
        for i, q in enumerate(positions):
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


def check_plant(parameters: TurntableParameters, sample_rate_hz: float, substeps: int = 1, holds: int = 1) -> None:
    """Refuse a table that cannot be run: unstable, too stiff for the step, or faster than the clock.

    Parameters
    ----------
    parameters : TurntableParameters
        Of the plant; modes without one are always accepted.
    sample_rate_hz : float
        Base clock [Hz].
    substeps, holds : int, optional
        Integration steps per step of the base clock, and steps of the base clock per integration step.

    Raises
    ------
    ScenarioError
        Saying what was expected.
    """
    if not parameters.has_plant:
        return
    table_modes.check_modes(parameters, holds / sample_rate_hz / substeps)
    check_floor(parameters, sample_rate_hz)
    if parameters.mode == "digital":
        check_loop(parameters, sample_rate_hz)
