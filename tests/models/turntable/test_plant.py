"""The plant: what is refused, what is compiled, and its modes against closed forms."""

from __future__ import annotations

import subprocess
import sys
from importlib import resources
from typing import TYPE_CHECKING

import mujoco
import numpy as np
import pytest
from pydantic import ValidationError

from testbed.errors import RunError, ScenarioError
from testbed.models.turntable import plant, servo
from testbed.models.turntable.earth import EarthRate
from testbed.models.turntable.engine import Engine
from testbed.models.turntable.floor import Floor, FloorBand, FloorLine
from testbed.models.turntable.modes import check_modes, coupled_modes, settle
from testbed.models.turntable.parameters import Cogging, Digital, Mounting, Ripple, TurntableParameters, Wobble
from testbed.parts import preset, preset_names

if TYPE_CHECKING:
    from pathlib import Path

DT = 5e-5


def chain(load: tuple[float, float], freq: tuple[float, float], damping: tuple[float, float]) -> np.ndarray:
    """Poles of platform and rotor in one direction, the rotor's coordinate relative to the platform."""
    corner = 2 * np.pi * np.array(freq)
    own = np.array(load)
    M = np.array([[own.sum(), own[1]], [own[1], own[1]]])
    K, C = np.diag(own * corner**2), np.diag(2 * np.array(damping) * corner * own)
    A = np.block([[np.zeros((2, 2)), np.eye(2)], [-np.linalg.solve(M, K), -np.linalg.solve(M, C)]])
    return np.linalg.eigvals(A)


def test_parameters_equal_the_preset() -> None:
    read = TurntableParameters.model_validate(preset("testbed.models", "air_bearing"), context={"border": True})
    assert read == TurntableParameters()
    # Where a table stands is the scenario's, not the device's.
    assert set(preset("testbed.models", "air_bearing")) == set(TurntableParameters.model_fields) - {"earth_rate"}


def test_parameters_survive_being_written_with_units() -> None:
    parameters = TurntableParameters(
        rotor_com=(1e-4, 0.0, 0.05),
        torque_limit=0.1 + 0.2,
        spindle_windage=1e-4,
        digital=Digital(encoder_bits=20, controller_rate=5e3, ripple=(Ripple(relative=0.01, periods=6, phase=0.1),)),
        floor=Floor(
            lines=(FloorLine(axis="rz", frequency=1.8, angle=1e-6), FloorLine(axis="z", frequency=50, acceleration=1)),
            bands=(FloorBand(axis="x", low=1, high=80, acceleration_psd=1e-8),),
            ramp_in=0.0,
        ),
        wobble=(Wobble(axis="rx", angle=1e-6, periods=2, phase=-0.5),),
        earth_rate=EarthRate(latitude=np.deg2rad(48), azimuth=0.1),
    )
    written = parameters.model_dump(mode="json", context={"border": True}, exclude_none=True)
    assert written["rotor_mass"] == "20.0 kg"
    assert TurntableParameters.model_validate(written, context={"border": True}) == parameters


def test_flat_bodies_can_be_drawn() -> None:
    # At the limit of the triangle inequality the body is a plate: one edge of its box is nothing.
    model = plant.build(TurntableParameters(platform_inertia=(22.5, 22.5, 45.0)), {}, DT)
    assert np.isfinite(model.geom_size).all()


@pytest.mark.parametrize("name", preset_names("testbed.models"))
def test_preset_marks_every_value_with_its_source(name: str) -> None:
    text = (resources.files("testbed.models") / "presets" / f"{name}.yaml").read_text(encoding="utf-8")
    lines = text.splitlines()
    for i, line in enumerate(lines):
        if (
            line
            and not line.startswith("#")
            and not line.lstrip().startswith(("mode:", "cogging:", "digital:", "ripple:"))
        ):
            assert any(word in line + lines[i - 1] for word in ("assumed", "derived", "standard gravity")), line


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"rotor_mass": float("nan")}, "expected a quantity in kg, such as '20 kg', got nan"),
        ({"platform_mass": 0.0}, "expected more than 0.0 kg"),
        ({"spindle_drag": -1e-4}, "expected at least 0.0 N\\*m\\*s/rad"),
        ({"torque_limit": float("inf")}, "expected a quantity in N\\*m"),
        ({"torque_limit": 0.0}, "expected more than 0.0 N\\*m"),
        ({"rotor_com": (0.0, float("nan"), 0.0)}, "expected a quantity in m"),
        ({"rotor_inertia": (0.02, 0.02, 0.05)}, "none above the sum of the others"),
        ({"isolation_frequency": (1.5, 1.5, 2.5, 2.0, 2.0, 0.0)}, "expected more than 0.0 Hz"),
        ({"isolation_damping": float("nan")}, "finite"),
        ({"bearing_damping": 1.5}, "less than 1"),
        ({"gravity": float("nan")}, "expected a quantity in m/s\\^2"),
        ({"feedforward_inertia_error": -1.0}, "greater than -1"),
        ({"cogging": ({"torque": float("nan"), "periods": 24},)}, "expected a quantity in N\\*m"),
        ({"cogging": ({"torque": 1e-3, "periods": 0},)}, "greater than or equal to 1"),
        ({"spindle_windage": -1e-4}, "expected at least 0.0 N\\*m\\*s\\^2/rad\\^2"),
        ({"digital": {"encoder_bits": 7}}, "greater than or equal to 8"),
        ({"digital": {"encoder_bits": 24.5}}, "valid integer"),
        ({"digital": {"controller_rate": 0.0}}, "expected more than 0.0 Hz"),
        ({"digital": {"velocity_filter": float("nan")}}, "expected a quantity in Hz"),
        ({"digital": {"ripple": ({"relative": float("nan"), "periods": 6},)}}, "less than 1|finite|greater"),
        ({"digital": {"ripple": ({"relative": 0.6, "periods": 6},) * 2}}, "less than 1 in sum, got 1.2"),
        ({"wobble": ({"axis": "rz", "angle": 1e-6, "periods": 1},)}, "'rx' or 'ry'"),
        ({"wobble": ({"axis": "rx", "angle": float("inf"), "periods": 1},)}, "expected a quantity in rad"),
        ({"wobble": ({"axis": "rx", "angle": 1e-6, "periods": 0},)}, "greater than or equal to 1"),
        (
            {"mode": "ideal", "wobble": ({"axis": "rx", "angle": 1e-6, "periods": 1},)},
            "wobble: expected mode 'servo' or",
        ),
        (
            {"mode": "fixed", "floor": {"lines": ({"axis": "x", "frequency": 1, "displacement": 1},)}},
            "floor: expected mode",
        ),
        ({"earth_rate": {"latitude": 2.0}}, "expected at most"),
        ({"earth_rate": {"azimuth": 2.0}}, "Field required"),
        ({"rotor_weight": 20.0}, "Extra inputs are not permitted"),
        ({"mode": "digitl"}, "'servo', 'digital', 'ideal' or 'fixed'"),
    ],
)
def test_parameters_refuse_bad_value(change: dict[str, object], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        TurntableParameters(**change)


def test_mounting_refuses_nan() -> None:
    with pytest.raises(ValidationError, match="expected a quantity in rad"):
        Mounting(misalignment=(float("nan"), 0.0))


def test_spindle_inertia_is_that_of_the_compiled_model() -> None:
    parameters = TurntableParameters(mode="ideal", rotor_com=(2e-3, -3e-3, 0.05))
    model = plant.build(parameters, {}, DT)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    mass_matrix = np.zeros((1, 1))
    mujoco.mj_fullM(model, data, mass_matrix)
    assert mass_matrix[0, 0] == pytest.approx(parameters.spindle_inertia, rel=1e-14)  # a few roundings


@pytest.mark.oracle
def test_modes_match_two_body_chains_where_directions_are_decoupled() -> None:
    # No lever arms and no gravity: each direction is a chain of two bodies of its own.
    levers = {"platform_com_height": 0.0, "bearing_height": 1e-9, "rotor_com": (0.0, 0.0, 0.0), "gravity": 0.0}
    p = TurntableParameters(**levers, cogging=())
    zeta = (p.isolation_damping, p.bearing_damping)
    bearing = (p.radial_frequency, p.radial_frequency, p.axial_frequency, p.tilt_frequency, p.tilt_frequency)
    loads = [(p.platform_mass, p.rotor_mass)] * 3 + list(zip(p.platform_inertia, p.rotor_inertia, strict=True))
    poles = [chain(loads[i], (p.isolation_frequency[i], bearing[i]), zeta) for i in range(5)]
    poles.append(np.linalg.eigvals(yaw_matrix(p)))
    expected = np.sort(np.array([abs(s) for s in np.concatenate(poles) if s.imag >= 0.0])) / (2 * np.pi)
    freq_hz, _ = coupled_modes(p)
    # Differences over 2e-6 of accelerations that round at 1e-16 * 1e7: 1e-3 1/s^2 of (2 pi 1.4)^2 at worst.
    np.testing.assert_allclose(freq_hz, expected, rtol=1e-5)


def yaw_matrix(p: TurntableParameters) -> np.ndarray:
    """State matrix of (platform yaw, spindle angle, their rates) with the servo closed, without its inputs."""
    kp, kv = servo.gains(p)
    inertia, corner = p.platform_inertia[2], 2 * np.pi * p.isolation_frequency[5]
    M = np.array([[inertia + p.spindle_inertia, p.spindle_inertia], [p.spindle_inertia, p.spindle_inertia]])
    K = np.diag([inertia * corner**2, kp])
    C = np.diag([2 * p.isolation_damping * corner * inertia, kv + p.spindle_drag])
    return np.block([[np.zeros((2, 2)), np.eye(2)], [-np.linalg.solve(M, K), -np.linalg.solve(M, C)]])


@pytest.mark.oracle
def test_gravity_lowers_the_rocking_mode_like_an_inverted_pendulum() -> None:
    # A platform far heavier than the rotor, its mass a height d above its mounts and stiff sideways: I + m d^2 rocks
    # on k - m g d.
    inertia, mass, d = 240.0, 4000.0, 0.1
    p = TurntableParameters(
        platform_mass=mass,
        platform_inertia=(inertia, inertia, inertia),
        platform_com_height=d,
        isolation_frequency=(80.0, 80.0, 80.0, 4.0, 4.0, 80.0),
        rotor_mass=1e-3,
        rotor_inertia=(1e-6, 1e-6, 1e-6),
        rotor_com=(0.0, 0.0, 0.0),
        cogging=(),
    )
    stiffness = inertia * (2 * np.pi * 4.0) ** 2 - mass * p.gravity * d
    expected = np.sqrt(stiffness / (inertia + mass * d**2)) / (2 * np.pi)
    # The sideways spring yields by (4/80)^2 * m d^2 / I at most.
    assert coupled_modes(p)[0][0] == pytest.approx(expected, rel=1e-3)


def test_check_modes_refuses_table_that_falls_over() -> None:
    with pytest.raises(ScenarioError, match="expected a stable table, got a growing mode"):
        check_modes(TurntableParameters(platform_com_height=2.0), DT)


def test_check_modes_refuses_bearing_too_stiff_for_the_step() -> None:
    stiff = TurntableParameters(radial_frequency=3000.0)
    with pytest.raises(ScenarioError, match=r"expected every mode below 3183 Hz at a step of 5e-05 s, got \d+ Hz"):
        check_modes(stiff, DT)
    check_modes(stiff, DT / 4)


def test_settle_reports_mounts_that_cannot_carry_the_table() -> None:
    soft = TurntableParameters(isolation_frequency=(1e-7,) * 6)
    with pytest.raises(ScenarioError, match="expected mounts that carry the table, got no static equilibrium"):
        check_modes(soft, DT)


def test_settle_finds_the_sag_of_the_mounts() -> None:
    p = TurntableParameters()
    model = plant.build(p, {}, DT)
    data = mujoco.MjData(model)
    settle(model, data)
    stiffness = p.platform_mass * (2 * np.pi * p.isolation_frequency[2]) ** 2
    sag = (p.platform_mass + p.rotor_mass) * p.gravity / stiffness
    # Newton to the rounding of the balance of forces.
    assert data.qpos[model.joint("platform_z").qposadr[0]] == pytest.approx(-sag, rel=1e-12)


def test_cogging_is_the_stated_sine_of_the_spindle_angle() -> None:
    harmonics = (Cogging(torque=0.02, periods=24, phase=0.3), Cogging(torque=0.01, periods=7, phase=-1.0))
    model = plant.build(TurntableParameters(cogging=harmonics), {}, DT)
    data = mujoco.MjData(model)
    spindle = model.joint(plant.SPINDLE)
    for angle in np.linspace(-4.0, 4.0, 9):
        data.qpos[spindle.qposadr[0]] = angle
        data.ctrl[model.actuator_ctrladr[model.actuator(plant.MOTOR).id]] = angle
        mujoco.mj_forward(model, data)
        expected = sum(one.torque * np.sin(one.periods * angle + one.phase) for one in harmonics)
        assert data.qfrc_actuator[spindle.dofadr[0]] == pytest.approx(expected, abs=1e-14)  # n * angle rounds at 1e-14


@pytest.mark.oracle
def test_sensing_axis_is_tilted_as_documented() -> None:
    a, b = 0.02, -0.03
    model = plant.build(TurntableParameters(mode="ideal"), {"tilted": Mounting(misalignment=(a, b))}, DT)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    axis = data.site("tilted").xmat.reshape(3, 3)[:, 2]
    np.testing.assert_allclose(axis, [np.sin(b), -np.sin(a) * np.cos(b), np.cos(a) * np.cos(b)], rtol=0.0, atol=1e-15)


def test_spin_axis_follows_the_tilt_of_the_bearing_whatever_the_spindle_angle() -> None:
    model = plant.build(TurntableParameters(), {}, DT)
    data = mujoco.MjData(model)
    data.qpos[model.joint("rotor_rx").qposadr[0]] = 0.1
    data.qpos[model.joint(plant.SPINDLE).qposadr[0]] = 1.0
    mujoco.mj_kinematics(model, data)
    axis = data.site(plant.AXIS).xmat.reshape(3, 3)[:, 2]
    np.testing.assert_allclose(axis, [0.0, -np.sin(0.1), np.cos(0.1)], rtol=0.0, atol=1e-15)


def test_model_shows_table_and_sensors_in_distinct_colours() -> None:
    mountings = {"mhd_ars": Mounting(), "mems_gyro": Mounting(position=(0.0, 0.0, 0.05))}
    for mode in ("servo", "ideal", "fixed"):
        model = plant.build(TurntableParameters(mode=mode), mountings, DT)
        colours = {name: tuple(model.geom(name).rgba) for name in ("slab", "stator", "disc", "mhd_ars", "mems_gyro")}
        assert len(set(colours.values())) == len(colours)
        assert model.body(model.geom("slab").bodyid[0]).name == "platform"
        assert model.body(model.geom("mems_gyro").bodyid[0]).name == "rotor"
        assert model.geom("mhd_ars").type == mujoco.mjtGeom.mjGEOM_CYLINDER
        assert model.geom("mems_gyro").type == mujoco.mjtGeom.mjGEOM_BOX
        lift = model.site("mems_gyro").pos - model.site("mhd_ars").pos
        np.testing.assert_allclose(lift, [0.0, 0.0, 0.05], atol=1e-15)


@pytest.mark.oracle
@pytest.mark.parametrize("drag", [5e-4, 0.5])
def test_hinge_under_constant_torque_follows_the_exponential(drag: float) -> None:
    p = TurntableParameters(mode="ideal", spindle_drag=drag)
    model = plant.build(p, {}, DT)
    torque, n = 0.01, 4000
    rows = Engine(model, np.zeros(1), np.zeros(1), 1).advance(0, np.full((n, 1), torque))
    t = np.arange(n) * DT
    decay = -np.expm1(-drag * t / p.spindle_inertia)
    rate = torque / drag * decay
    angle = torque / drag * (t - p.spindle_inertia / drag * decay)
    encoder = rows[:, model.sensor("encoder_rate").adr[0]]
    # RK4 leaves (c h / I)^4 / 120 per second of 1/(c/I): 5e-16 at c h / I = 5e-4; the rest is rounding over 4000 steps.
    np.testing.assert_allclose(encoder, rate, rtol=0.0, atol=1e-11 * rate.max())
    np.testing.assert_allclose(rows[:, 0], angle, rtol=0.0, atol=1e-9 * angle.max())
    assert encoder[0] == 0.0  # row 0 is t = 0, not the end of the first step


def test_engine_names_divergence_and_time_and_leaves_no_log(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    model = plant.build(TurntableParameters(radial_frequency=12000.0, gravity=0.0), {}, DT)
    qpos = np.zeros(model.nq)
    qpos[model.joint("rotor_x").qposadr[0]] = 1e-6
    with pytest.raises(RunError, match=r"the plant diverged.* at t = 0\.0\d+ s") as caught:
        Engine(model, qpos, np.zeros(model.nv), 1).advance(0, np.zeros((400, model.nu)))
    # 1 um grows by more than 1.5 a step, so the huge value is there within 100 steps.
    assert float(str(caught.value).split("t = ")[1].split(" s")[0]) < 100 * DT
    assert list(tmp_path.iterdir()) == []
    assert capfd.readouterr() == ("", "")


def test_engine_names_control_that_mujoco_drops(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # MuJoCo zeroes controls beyond 1e10 and goes on as if nothing had happened.
    monkeypatch.chdir(tmp_path)
    engine = Engine(plant.build(TurntableParameters(mode="ideal"), {}, DT), np.zeros(1), np.zeros(1), 1)
    control = np.zeros((100, 1))
    engine.advance(0, control)
    control[37] = 1e11
    with pytest.raises(RunError, match=r"MuJoCo stopped \(BADCTRL\) at t = 0\.0069 s"):
        engine.advance(100, control)  # step 137 is dropped, and ends at 0.0069 s
    assert list(tmp_path.iterdir()) == []


def test_engine_refuses_nan_control_and_names_its_time() -> None:
    engine = Engine(plant.build(TurntableParameters(mode="ideal"), {}, DT), np.zeros(1), np.zeros(1), 1)
    control = np.zeros((100, 1))
    control[60] = np.nan
    with pytest.raises(RunError, match=r"a control that is not finite at t = 0\.013 s"):
        engine.advance(200, control)


def test_parameters_do_not_import_mujoco() -> None:
    code = "import sys, testbed.models.turntable.parameters; sys.exit('mujoco' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_no_two_faces_of_shaft_and_disc_lie_in_one_plane() -> None:
    model = plant.build(TurntableParameters(), {}, DT)
    ends = [model.geom(name).pos[2] + side * model.geom(name).size[1] for name in ("shaft", "disc") for side in (-1, 1)]
    assert np.diff(np.sort(ends)).min() > 1e-3
