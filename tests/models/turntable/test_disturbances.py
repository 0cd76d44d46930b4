"""Floor, error motion, imbalance and windage on the plant, each against the closed form of the bodies it moves."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
from scipy.linalg import expm

from testbed.errors import ScenarioError
from testbed.models.motion import CommandBlock, MotionProfile
from testbed.models.turntable import plant, servo
from testbed.models.turntable.disturbances import error_motion
from testbed.models.turntable.engine import Engine
from testbed.models.turntable.floor import AXES, Floor, FloorBand, FloorLine
from testbed.models.turntable.parameters import Mounting, TurntableParameters, Wobble
from testbed.models.turntable.servo import required_torque
from testbed.models.turntable.turntable import Turntable
from testbed.signals import random_stream

FS = 20000.0
DT = 1.0 / FS
STREAM = partial(random_stream, 7, "turntable", "floor")
# Axes along the table's x and y: they feel the tilt rates.
SENSORS = {
    "up": Mounting(),
    "along_x": Mounting(misalignment=(0.0, np.pi / 2)),
    "along_y": Mounting(misalignment=(-np.pi / 2, 0.0)),
}
# Without lever arms and gravity each direction is a chain of two bodies of its own.
BARE = TurntableParameters(
    platform_com_height=0.0, bearing_height=1e-9, rotor_com=(0.0, 0.0, 0.0), gravity=0.0, cogging=()
)


def constant(rate: float, n_time: int) -> CommandBlock:
    return MotionProfile([lambda t: np.full_like(t, rate)], 0.0, FS).process(n_time)


def chain(p: TurntableParameters, axis: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return M, C, K of platform and rotor along or about one axis, the rotor's coordinate relative to the platform."""
    i = AXES.index(axis)
    load = np.array([(p.platform_mass, p.rotor_mass), (p.platform_inertia[i - 3], p.rotor_inertia[i - 3])][i > 2])
    own = (p.radial_frequency, p.radial_frequency, p.axial_frequency, p.tilt_frequency, p.tilt_frequency, 1.0)[i]
    corner = 2 * np.pi * np.array([p.isolation_frequency[i], own])
    stiffness, damping = load * corner**2, 2 * np.array([p.isolation_damping, p.bearing_damping]) * corner * load
    if axis == "rz":
        kp, kv = servo.gains(p)
        stiffness[1], damping[1] = kp, kv + p.spindle_drag
    return np.array([[load.sum(), load[1]], [load[1], load[1]]]), np.diag(damping), np.diag(stiffness)


def follow(p: TurntableParameters, axis: str, place: np.ndarray, speed: np.ndarray) -> np.ndarray:
    """Return (platform, rotor, their rates), shape (n_time, 4), under floor inputs held over each step: exact."""
    M, C, K = chain(p, axis)
    A = np.zeros((6, 6))
    A[:2, 2:4] = np.eye(2)
    A[2:4, :2], A[2:4, 2:4] = -np.linalg.solve(M, K), -np.linalg.solve(M, C)
    A[2:4, 4:] = np.linalg.solve(M, np.array([[K[0, 0], C[0, 0]], [0.0, 0.0]]))
    step = expm(A * DT)
    x, states = np.zeros(4), np.empty((place.size, 4))
    for k in range(place.size):
        states[k] = x
        x = step[:4, :4] @ x + step[:4, 4:] @ np.array([place[k], speed[k]])
    return states


# ---------------------------------------------------------------- floor


@pytest.mark.oracle
@pytest.mark.parametrize("axis", AXES)
def test_floor_moves_the_table_as_its_mounts_pass_it_on(axis: str) -> None:
    size = {"angle": 1e-4} if "r" in axis else {"displacement": 1e-4}
    density = {"angular_acceleration_psd": 1e-3} if "r" in axis else {"acceleration_psd": 1e-3}
    floor = Floor(
        lines=(FloorLine(axis=axis, frequency=3.0, **size),),
        bands=(FloorBand(axis=axis, low=5.0, high=60.0, **density),),
        ramp_in=0.05,
    )
    p = BARE.model_copy(update={"floor": floor})
    n = 6000
    motion = floor.start(n * DT, STREAM)
    truth = Turntable(p, SENSORS, pose_stride=1, floor=motion).process(constant(0.0, n))
    expected = follow(p, axis, *motion.inputs((np.arange(n) + 0.5) * DT)[axis])
    if "r" in axis:
        moved = {"rx": truth.sensor_rate["along_x"], "ry": truth.sensor_rate["along_y"], "rz": truth.rate}[axis]
        total = expected[:, 2] + expected[:, 3]
    else:
        place = truth.poses["rotor"][0]
        moved, total = (place - place[0])[:, AXES.index(axis)], expected[:, 0] + expected[:, 1]
    scale = np.abs(total).max()
    assert scale > 1e-6
    # RK4's response to a held input, (w h)^4 / 120 of the bearing's 300 to 500 Hz (1e-6), of which the floor excites
    # (60/300)^2 at most; positions of 0.4 m are known to 1e-16.
    np.testing.assert_allclose(moved, total, rtol=0.0, atol=1e-7 * scale + 1e-15)


@pytest.mark.oracle
@pytest.mark.parametrize("freq_hz", [0.5, 1.8, 5.0, 20.0, 100.0])
def test_yaw_transmissibility_is_the_closed_form_but_for_the_hold(freq_hz: float) -> None:
    """Floor yaw to inertial rate of the table, with the servo holding the rotor; Q = 8.4 at 1.8 Hz."""
    floor = Floor(lines=(FloorLine(axis="rz", frequency=freq_hz, angle=1e-4),), ramp_in=0.0)
    p = BARE.model_copy(update={"floor": floor})
    n = 80_000
    truth = Turntable(p, SENSORS, floor=floor.start(4.0, STREAM)).process(constant(0.0, n))
    M, C, K = chain(p, "rz")
    s = 2j * np.pi * freq_hz
    push = np.array([K[0, 0] + s * C[0, 0], 0.0])
    expected = 1e-4 * s * np.linalg.solve(M * s**2 + C * s + K, push).sum()
    A = np.block([[np.zeros((2, 2)), np.eye(2)], [-np.linalg.solve(M, K), -np.linalg.solve(M, C)]])
    # The start excites the four modes of platform and servo: they are fitted along with the line.
    t = np.arange(n) * DT
    modes = [np.exp(pole * t) for pole in np.linalg.eigvals(A) if pole.imag >= 0.0]
    basis = [np.sin(s.imag * t), np.cos(s.imag * t)]
    basis += [part for mode in modes for part in ((mode.real, mode.imag) if mode.imag.any() else (mode.real,))]
    fit = np.linalg.lstsq(np.stack(basis, axis=1), truth.rate, rcond=None)[0]
    ratio = (fit[0] + 1j * fit[1]) / expected
    # Inputs held at mid-step have the gain sinc(f h) = 1 - (w h)^2 / 24 and no lag: -1.3e-8 at 1.8 Hz, -4.1e-5 at 100.
    hold = (s.imag * DT) ** 2 / 24
    print(f"{freq_hz} Hz: |T| {abs(expected) / abs(1e-4 * s):.4g}, amplitude {abs(ratio) - 1:+.2e}, hold {-hold:+.2e}")
    assert abs(ratio) - 1 == pytest.approx(-hold, rel=0.02, abs=2e-10)
    assert abs(np.angle(ratio)) < 0.02 * hold + 1e-9


def test_floor_needs_its_realisation() -> None:
    floor = Floor(lines=(FloorLine(axis="x", frequency=1.0, displacement=1e-6),))
    with pytest.raises(ValueError, match="floor: expected its realisation"):
        Turntable(TurntableParameters(floor=floor), SENSORS)


def test_floor_faster_than_the_clock_is_refused() -> None:
    floor = Floor(lines=(FloorLine(axis="x", frequency=10e3, displacement=1e-9),))
    with pytest.raises(
        ScenarioError, match="floor: expected frequencies below 10000 Hz, half the base clock, got 10000"
    ):
        Turntable(TurntableParameters(floor=floor), SENSORS, floor=floor.start(1.0, STREAM))


@pytest.mark.parametrize("mode", ["servo", "digital"])
def test_any_division_into_blocks_gives_the_same_bits(mode: str) -> None:
    floor = Floor(
        lines=(FloorLine(axis="rz", frequency=7.0, angle=1e-6),),
        bands=(FloorBand(axis="x", low=5.0, high=60.0, acceleration_psd=1e-6),),
    )
    p = TurntableParameters(mode=mode, floor=floor, wobble=(Wobble(axis="ry", angle=1e-6, periods=3),))
    runs = []
    for sizes in ((2000,), (1, 399, 600, 1000)):
        motion = MotionProfile([lambda t: 0.1 * np.sin(60.0 * t)], 0.02, FS)
        table = Turntable(p, SENSORS, floor=floor.start(0.1, STREAM))
        blocks = [table.process(motion.process(n)) for n in sizes]
        runs.append([np.concatenate([block.sensor_rate[name] for block in blocks]) for name in SENSORS])
    np.testing.assert_array_equal(*runs)


# ---------------------------------------------------------------- error motion


def test_error_motion_is_the_stated_harmonic_and_its_derivative() -> None:
    one = Wobble(axis="rx", angle=2e-6, periods=3, phase=0.4)
    angle = np.linspace(-5.0, 5.0, 101)
    tilt, tilt_rate = error_motion(one, angle, np.full(101, 1.7))
    np.testing.assert_allclose(tilt, 2e-6 * np.sin(3 * angle + 0.4), rtol=0.0, atol=1e-20)
    np.testing.assert_allclose(tilt_rate, 2e-6 * 3 * 1.7 * np.cos(3 * angle + 0.4), rtol=0.0, atol=1e-19)


@pytest.mark.oracle
@pytest.mark.parametrize("periods", [1, 2, 5])
def test_wobble_tilts_the_spin_axis_through_the_compliance_of_the_bearing(periods: int) -> None:
    """Steady spin, tilt enforced along a circle: a rigid gyro on a spring, zeta = alpha + i beta."""
    spin, size = 2 * np.pi * 5.0, 1e-5
    circle = (
        Wobble(axis="rx", angle=size, periods=periods, phase=np.pi / 2),
        Wobble(axis="ry", angle=size, periods=periods),
    )
    heavy = {"platform_mass": 4e8, "platform_inertia": (24e6, 24e6, 45e6)}
    p = BARE.model_copy(update={"wobble": circle, "tilt_frequency": 60.0, "bearing_damping": 0.1, **heavy})
    truth = Turntable(p, SENSORS).process(constant(spin, 14_000))
    late = slice(12_000, None)  # the start has decayed with 0.1 * 2 pi 60 Hz: exp(-22)
    felt = (truth.sensor_rate["along_x"] + 1j * truth.sensor_rate["along_y"])[late]
    transverse, polar, s = p.rotor_inertia[0], p.rotor_inertia[2], 1j * periods * spin
    corner = 2 * np.pi * p.tilt_frequency
    stiffness, damping = transverse * corner**2, 2 * p.bearing_damping * corner * transverse
    compliance = (stiffness + damping * s) / (transverse * s**2 - 1j * polar * spin * s + damping * s + stiffness)
    angle = truth.angle[late]
    # The tilt is held over each step: within one the bearing pulls back and forth, and at its ends the rate is lower by
    # (corner h)^2 / 12 = 3e-5 than on average.
    expected = s * size * compliance * np.exp(1j * (periods - 1) * angle) * (1 - (corner * DT) ** 2 / 12)
    # The same of the spindle, kp / I h^2 / 12, comes in with the turning of the sensor's axes.
    spindle = servo.gains(p)[0] / p.spindle_inertia * DT**2 / 12
    assert np.abs(felt / expected - 1).max() < spindle
    assert truth.encoder_rate[late].mean() / spin - 1 == pytest.approx(-spindle, rel=0.01)
    assert spindle == pytest.approx(1.85e-5, rel=1e-3)
    assert abs(abs(compliance) - 1) > 1e-3  # so the compliance and the gyroscopic moment are seen
    # About its own axis the table feels the wobble in second order only.
    assert np.abs(truth.rate[late] - truth.encoder_rate[late]).max() < 1e-7 * spin


@pytest.mark.parametrize("mode", ["servo", "digital"])
def test_table_at_rest_starts_in_the_tilt_that_its_bearing_enforces(mode: str) -> None:
    p = TurntableParameters(mode=mode, cogging=(), wobble=(Wobble(axis="rx", angle=1e-4, periods=1, phase=1.0),))
    truth = Turntable(p, SENSORS).process(constant(0.0, 2000))
    # Newton's equilibrium leaves 1e-9 rad/s^2 at most, over a period of the slowest mode.
    assert max(np.abs(rate).max() for rate in truth.sensor_rate.values()) < 1e-9
    tilt = np.hypot(*truth.poses["rotor"][1][0, 1:3]) * 2
    assert tilt == pytest.approx(1e-4 * np.sin(1.0), rel=0.1)  # the bearing yields under the overhung mass


def test_wobble_reaches_a_misaligned_sensor() -> None:
    p = TurntableParameters(wobble=(Wobble(axis="rx", angle=1e-4, periods=1),))
    mountings = {"straight": Mounting(), "tilted": Mounting(misalignment=(0.0, 0.01))}
    still = Turntable(p.model_copy(update={"wobble": ()}), mountings).process(constant(10.0, 4000)).sensor_rate
    moved = Turntable(p, mountings).process(constant(10.0, 4000)).sensor_rate
    change = {name: np.abs(moved[name] - still[name])[2000:].max() for name in mountings}
    assert 0.3 < change["tilted"] / (np.sin(0.01) * 1e-4 * 10.0) < 3.0  # the platform rocks along
    assert change["straight"] < 0.02 * change["tilted"]


# ---------------------------------------------------------------- imbalance and drag


@pytest.mark.oracle
@pytest.mark.parametrize("turns_per_s", [3.0, 8.0])
def test_imbalance_whirls_platform_and_rotor(turns_per_s: float) -> None:
    """Centrifugal force m e W^2 on rotor and platform, a two-body chain in x and in y: zeta = x + i y."""
    spin, e = 2 * np.pi * turns_per_s, 1e-3
    p = BARE.model_copy(
        update={"rotor_com": (e, 0.0, 0.0), "isolation_frequency": (3.0,) * 6, "isolation_damping": 0.5}
    )
    n = 40_000
    truth = Turntable(p, SENSORS, pose_stride=100).process(constant(spin, n))
    M, C, K = chain(p, "x")
    s = 1j * spin
    force = p.rotor_mass * e * spin**2
    expected = np.linalg.solve(M * s**2 + C * s + K, np.array([force, force]))
    turn = np.exp(1j * truth.angle[::100])
    platform = (truth.poses["platform"][0] @ [1.0, 1j, 0.0]) / turn
    rotor = ((truth.poses["rotor"][0] - truth.poses["platform"][0]) @ [1.0, 1j, 0.0]) / turn
    # The start decays with 0.5 * 2 pi 3 Hz: exp(-17) at 1.8 s. Yaw and spin stay coupled by e^2: 20e-6 / 0.05.
    late = slice(360, None)
    assert np.abs(platform[late] / expected[0] - 1).max() < 1e-3
    assert np.abs(rotor[late] / expected[1] - 1).max() < 1e-3
    print(
        f"{turns_per_s} 1/s: platform {1e6 * abs(expected[0]):.1f} um, rotor in its bearing "
        f"{1e6 * abs(expected[1]):.2f} um"
    )


@pytest.mark.oracle
def test_windage_slows_a_hinge_by_the_hyperbolic_tangent() -> None:
    p = TurntableParameters(mode="ideal", spindle_drag=0.0, spindle_windage=0.02)
    model = plant.build(p, {}, DT)
    torque, n = 0.5, 8000
    rows = Engine(model, np.zeros(1), np.zeros(1), 1).advance(0, np.full((n, 1), torque))
    t = np.arange(n) * DT
    final = np.sqrt(torque / p.spindle_windage)
    expected = final * np.tanh(np.sqrt(torque * p.spindle_windage) / p.spindle_inertia * t)
    encoder = rows[:, model.sensor("encoder_rate").adr[0]]
    # RK4 at h / tau = 1e-4: truncation 1e-20 a step; the rest is rounding over 8000 steps.
    np.testing.assert_allclose(encoder, expected, rtol=0.0, atol=1e-11 * final)


@pytest.mark.parametrize("mode", ["servo", "digital", "ideal"])
def test_motor_carries_drag_and_windage_at_a_constant_rate(mode: str) -> None:
    p = TurntableParameters(mode=mode, spindle_drag=2e-3, spindle_windage=3e-3, cogging=())
    p = p.model_copy(update={"digital": p.digital.model_copy(update={"ripple": (), "encoder_bits": 40})})
    for rate in (10.0, -10.0):
        block = constant(rate, 4000)
        torque = Turntable(p, SENSORS).process(block).torque
        expected = 2e-3 * rate + 3e-3 * rate * abs(rate)
        if mode == "servo":
            # At the beginning of a step the reference, held at its value in the middle, leads by half a step.
            expected += servo.gains(p)[0] * rate * DT / 2
        # The platform follows the drag of 0.3 N m at 1.8 Hz, with 0.3 / 45 kg m^2 * 1.5 s = 1e-2 rad/s at most.
        np.testing.assert_allclose(torque[2000:], expected, rtol=2e-2)
        assert required_torque(p, block, FS).max() == pytest.approx(abs(expected), rel=1e-4)


def test_feed_forward_takes_its_error_of_the_drag_from_both_kinds() -> None:
    p = TurntableParameters(spindle_drag=2e-3, spindle_windage=3e-3, feedforward_drag_error=0.1)
    torque = servo.feed_forward(p, constant(-10.0, 3), DT)
    np.testing.assert_allclose(torque, -1.1 * (2e-2 + 0.3), rtol=1e-14)
