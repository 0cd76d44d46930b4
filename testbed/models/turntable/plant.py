"""The turntable as a MuJoCo model: world -> platform (6 dof) -> rotor (5 dof of the bearing, the spindle last).

The spindle comes last so that the bearing's tilt stiffness is fixed to the stator and the spin axis follows the tilt.
Mounts, bearing and servo are `pid` actuators, force k (pos - q) + c (vel - qdot): their inputs are the place for
floor vibration and error motion. Contacts and constraints are off: nothing in the plant needs them, and no step then
depends on a warm start.
"""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np

from testbed.errors import ScenarioError
from testbed.models.turntable.servo import gains

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

    from testbed.models.turntable.parameters import Mounting, TurntableParameters
    from testbed.signals import FloatArray

BODIES = ("platform", "rotor")
SPINDLE = "spindle"
MOTOR = "motor"
AXIS = "table_axis"
_AXES = np.eye(3)
_DOFS = tuple(itertools.product((mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE), "xyz"))
# Height of the isolators [m], for drawing.
_MOUNT_HEIGHT = 0.4
_GRANITE, _STEEL, _ALUMINIUM = (0.30, 0.30, 0.33, 1.0), (0.55, 0.58, 0.62, 1.0), (0.82, 0.84, 0.86, 1.0)
_RUBBER = (0.16, 0.17, 0.18, 1.0)
_MHD, _MEMS = (0.85, 0.45, 0.10, 1.0), (0.10, 0.45, 0.80, 1.0)


def build(
    parameters: TurntableParameters, mountings: Mapping[str, Mounting], dt: float, exposed: Collection[str] = ()
) -> Any:
    """Compile the model that the mode asks for.

    Parameters
    ----------
    parameters : TurntableParameters
        Of the plant; modes `servo` and `digital` give 12 degrees of freedom, the others the spindle alone.
    mountings : mapping of str to Mounting
        Sensor name to its place; each becomes a site and a visible geometry of that name.
    dt : float
        Integration step [s].
    exposed : collection of str, optional
        Sensors whose specific force is measured too.

    Returns
    -------
    mujoco.MjModel
        Sensors in this order: every joint position, spindle rate, motor torque, angular velocity (3) at `table_axis`
        and at each mounting; where the Earth's rate is asked for, then the z axis (3) of each of these sites; for each
        exposed one specific force (3), and with the Earth's rate its x and y axes (3, 3).

    Raises
    ------
    ScenarioError
        If MuJoCo refuses the model.
    """
    spec = mujoco.MjSpec()
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_RK4
    spec.option.timestep = dt
    spec.option.gravity = [0.0, 0.0, -parameters.gravity]
    off = mujoco.mjtDisableBit
    spec.option.disableflags = off.mjDSBL_CONTACT | off.mjDSBL_CONSTRAINT | off.mjDSBL_AUTORESET
    free = parameters.has_plant
    platform = _add_platform(spec, parameters, free=free)
    rotor = _add_rotor(spec, platform, parameters, free=free)
    _add_sites(rotor, parameters, mountings)
    _add_motor(spec, parameters)
    if free:
        _add_cogging(spec, parameters)
    _add_sensors(spec, mountings, axes=parameters.earth_rate is not None)
    for name in exposed:
        _add_exposed(spec, name, axes=parameters.earth_rate is not None)
    try:
        return spec.compile()
    except ValueError as error:
        msg = f"turntable: expected parameters that make a plant, got {' '.join(str(error).split())}"
        raise ScenarioError(msg) from error


def _add_platform(spec: Any, parameters: TurntableParameters, *, free: bool) -> Any:
    mass, inertia = parameters.platform_mass, np.array(parameters.platform_inertia)
    com, size = np.array([0.0, 0.0, parameters.platform_com_height]), _box(mass, inertia)
    # The mounts are levelled: their springs sag under gravity to the height that is drawn.
    place = np.array([0.0, 0.0, _MOUNT_HEIGHT + size[2] + (_sag(parameters) if free else 0.0)]) - com
    body = spec.worldbody.add_body(
        name="platform", pos=place, mass=mass, inertia=inertia, ipos=com, explicitinertial=True
    )
    if free:
        loads = (mass, mass, mass, *parameters.platform_inertia)
        _suspend(spec, body, loads, parameters.isolation_frequency, parameters.isolation_damping)
    body.add_geom(name="slab", type=mujoco.mjtGeom.mjGEOM_BOX, size=size, pos=com, rgba=_GRANITE)
    bottom, top = com[2] + size[2], parameters.bearing_height + 0.03
    if top > bottom:
        _add_cylinder(body, "stator", 0.11, (0.0, 0.0), (bottom, top), _STEEL)
    for i, (x, y) in enumerate(itertools.product((-0.8, 0.8), repeat=2)):
        _add_cylinder(spec.worldbody, f"isolator_{i}", 0.06, (x * size[0], y * size[1]), (0.0, _MOUNT_HEIGHT), _RUBBER)
    return body


def _add_rotor(spec: Any, platform: Any, parameters: TurntableParameters, *, free: bool) -> Any:
    mass, inertia, com = parameters.rotor_mass, np.array(parameters.rotor_inertia), parameters.rotor_com
    body = platform.add_body(
        name="rotor",
        pos=[0.0, 0.0, parameters.bearing_height],
        mass=mass,
        inertia=inertia,
        ipos=com,
        explicitinertial=True,
    )
    if free:
        radial, axial, tilt = parameters.radial_frequency, parameters.axial_frequency, parameters.tilt_frequency
        loads, freq_hz = (mass, mass, mass, inertia[0], inertia[1]), (radial, radial, axial, tilt, tilt)
        _suspend(spec, body, loads, freq_hz, parameters.bearing_damping)
    body.add_joint(
        name=SPINDLE,
        type=mujoco.mjtJoint.mjJNT_HINGE,
        axis=_AXES[2],
        damping=[parameters.spindle_drag, parameters.spindle_windage, 0.0],
    )
    top = parameters.mounting_height
    # The shaft ends inside the disc: two faces in one plane would flicker.
    _add_cylinder(body, "shaft", 0.06, (0.0, 0.0), (0.0, top - 0.01), _STEEL)
    _add_cylinder(body, "disc", 0.16, (0.0, 0.0), (top - 0.02, top), _ALUMINIUM)
    # A mark on the rim: without it a turning disc looks still.
    body.add_geom(
        name="mark", type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.02, 0.004, 0.001], pos=[0.135, 0.0, top + 0.001], rgba=_MHD
    )
    return body


def _suspend(spec: Any, body: Any, loads: tuple[float, ...], freq_hz: tuple[float, ...], damping: float) -> None:
    """Give `body` one joint per load (x, y, z, then about x, y, z), each held by a spring and a damper."""
    for (kind, axis), load, freq in zip(_DOFS, loads, freq_hz, strict=False):
        turn = "r" if kind == mujoco.mjtJoint.mjJNT_HINGE else ""
        name = f"{body.name}_{turn}{axis}"
        body.add_joint(name=name, type=kind, axis=_AXES["xyz".index(axis)])
        corner = 2 * np.pi * freq
        spring = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        spring.set_to_pid(kp=load * corner**2, kv=2 * damping * corner * load, ctrlspec=1 | 2)


def _add_motor(spec: Any, parameters: TurntableParameters) -> None:
    motor = spec.add_actuator(name=MOTOR, target=SPINDLE, trntype=mujoco.mjtTrn.mjTRN_JOINT)
    if parameters.mode != "servo":
        motor.set_to_motor()
        return
    kp, kv = gains(parameters)
    motor.set_to_pid(kp=kp, kv=kv, ctrlspec=1 | 2 | 4)
    motor.forcerange = [-parameters.torque_limit, parameters.torque_limit]


def _add_cogging(spec: Any, parameters: TurntableParameters) -> None:
    for i, harmonic in enumerate(parameters.cogging):
        cogging = spec.add_actuator(name=f"cogging_{i}", target=SPINDLE, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        shape = [harmonic.torque, float(harmonic.periods), harmonic.phase]
        cogging.set_to_dcmotor(motorconst=[0.0, 0.0], resistance=1.0, cogging=shape, ctrlspec=16)


def _add_sites(rotor: Any, parameters: TurntableParameters, mountings: Mapping[str, Mounting]) -> None:
    top = np.array([0.0, 0.0, parameters.mounting_height])
    rotor.add_site(name=AXIS, pos=top)
    for name, mounting in mountings.items():
        place, quat = top + mounting.position, tilt(mounting)
        rotor.add_site(name=name, pos=place, quat=quat, size=[0.004, 0.0, 0.0])
        # The mounting point is the foot of the housing.
        if name.startswith("mhd"):
            shape, size, rgba = mujoco.mjtGeom.mjGEOM_CYLINDER, [0.035, 0.025, 0.0], _MHD
        else:
            shape, size, rgba = mujoco.mjtGeom.mjGEOM_BOX, [0.02, 0.02, 0.006], _MEMS
        height = size[2] or size[1]
        rotor.add_geom(name=name, type=shape, size=size, pos=place + height * _AXES[2], quat=quat, rgba=rgba)


def _add_sensors(spec: Any, mountings: Mapping[str, Mounting], *, axes: bool) -> None:
    sensor, thing = mujoco.mjtSensor, mujoco.mjtObj
    for joint in spec.joints:
        spec.add_sensor(
            name=f"q_{joint.name}", type=sensor.mjSENS_JOINTPOS, objtype=thing.mjOBJ_JOINT, objname=joint.name
        )
    spec.add_sensor(name="encoder_rate", type=sensor.mjSENS_JOINTVEL, objtype=thing.mjOBJ_JOINT, objname=SPINDLE)
    spec.add_sensor(name="torque", type=sensor.mjSENS_ACTUATORFRC, objtype=thing.mjOBJ_ACTUATOR, objname=MOTOR)
    for site in (AXIS, *mountings):
        spec.add_sensor(name=f"rate_{site}", type=sensor.mjSENS_GYRO, objtype=thing.mjOBJ_SITE, objname=site)
    for site in (AXIS, *mountings) if axes else ():
        spec.add_sensor(name=f"axis_{site}", type=sensor.mjSENS_FRAMEZAXIS, objtype=thing.mjOBJ_SITE, objname=site)


def _add_exposed(spec: Any, site: str, *, axes: bool) -> None:
    sensor, thing = mujoco.mjtSensor, mujoco.mjtObj.mjOBJ_SITE
    spec.add_sensor(name=f"force_{site}", type=sensor.mjSENS_ACCELEROMETER, objtype=thing, objname=site)
    if axes:
        spec.add_sensor(name=f"axis_x_{site}", type=sensor.mjSENS_FRAMEXAXIS, objtype=thing, objname=site)
        spec.add_sensor(name=f"axis_y_{site}", type=sensor.mjSENS_FRAMEYAXIS, objtype=thing, objname=site)


def tilt(mounting: Mounting) -> FloatArray:
    """Return the unit quaternion (w, x, y, z) of Rx(a) Ry(b), shape (4,)."""
    a, b = 0.5 * np.array(mounting.misalignment)
    quat: FloatArray = np.outer([np.cos(b), np.sin(b)], [np.cos(a), np.sin(a)]).ravel()
    return quat


def rotation(quat: FloatArray) -> FloatArray:
    """Return the rotation matrix, shape (3, 3), of a unit quaternion (w, x, y, z), shape (4,)."""
    matrix = np.empty(9)
    mujoco.mju_quat2Mat(matrix, np.asarray(quat, float))
    return matrix.reshape(3, 3)


def _box(mass: float, inertia: FloatArray) -> FloatArray:
    """Return half the edges [m] of the homogeneous box of that mass and inertia, as the platform is drawn."""
    half: FloatArray = np.sqrt(1.5 * np.maximum(inertia.sum() - 2 * inertia, 0.0) / mass)
    return np.maximum(half, 1e-3)


def _sag(parameters: TurntableParameters) -> float:
    load = parameters.platform_mass + parameters.rotor_mass
    stiffness = parameters.platform_mass * (2 * np.pi * parameters.isolation_frequency[2]) ** 2
    return float(load * parameters.gravity / stiffness)


def _add_cylinder(
    body: Any,
    name: str,
    radius: float,
    axis: tuple[float, float],
    span: tuple[float, float],
    rgba: tuple[float, ...],
) -> None:
    """Draw an upright cylinder around `axis` (x, y) from span[0] to span[1] in z [m]."""
    place, size = [*axis, 0.5 * sum(span)], [radius, 0.5 * (span[1] - span[0]), 0.0]
    body.add_geom(name=name, type=mujoco.mjtGeom.mjGEOM_CYLINDER, size=size, pos=place, rgba=rgba)
