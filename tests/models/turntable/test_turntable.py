"""The turntable in time: the truth against closed forms, its step against half the step, its failures by name."""

from __future__ import annotations

import re
from itertools import pairwise
from typing import TYPE_CHECKING

import mujoco
import numpy as np
import pytest
from scipy.linalg import expm

from testbed.errors import RunError, ScenarioError
from testbed.models.motion import CommandBlock, MotionProfile
from testbed.models.turntable import plant, servo
from testbed.models.turntable.earth import EarthRate
from testbed.models.turntable.parameters import Digital, Mounting, TurntableParameters, Wobble
from testbed.models.turntable.servo import required_torque
from testbed.models.turntable.turntable import Turntable
from testbed.parts import preset

if TYPE_CHECKING:
    from testbed.models.turntable.truth import TruthBlock

FS = 20000.0
DT = 1.0 / FS
DEG = np.pi / 180.0
SENSORS = {
    "mhd_ars": Mounting(),
    "mems_gyro": Mounting(position=(0.0, 0.0, 0.05), misalignment=(0.02, -0.03)),
}
CALM = TurntableParameters(cogging=())
MODES = ["servo", "digital", "ideal", "fixed"]


def command(freq_hz: float, amplitude: float, n_time: int, ramp_in: float = 0.05) -> CommandBlock:
    """Return a sine of rate from t = 0, ramped in."""
    return MotionProfile([lambda t: amplitude * np.sin(2 * np.pi * freq_hz * t)], ramp_in, FS).process(n_time)


def constant(rate: float, n_time: int) -> CommandBlock:
    return MotionProfile([lambda t: np.full_like(t, rate)], 0.0, FS).process(n_time)


def random_command(n_time: int, seed: int = 3) -> CommandBlock:
    """White random rate, one value per step, linear between: nothing is smooth about it."""
    rate = 0.05 * DEG * np.random.default_rng(seed).standard_normal(n_time + 1)
    rate[:2] = 0.0
    mid = 0.5 * (rate[:-1] + rate[1:])
    angle = np.concatenate([[0.0], np.cumsum(mid) * DT])
    return CommandBlock(0, rate, angle, mid, angle[:-1] + (0.375 * rate[:-1] + 0.125 * rate[1:]) * DT)


def cut(block: CommandBlock, first: int, last: int) -> CommandBlock:
    ends, steps = slice(first, last + 1), slice(first, last)
    return CommandBlock(
        block.start + first, block.rate[ends], block.angle[ends], block.rate_mid[steps], block.angle_mid[steps]
    )


def columns(truth: TruthBlock) -> dict[str, np.ndarray]:
    single = {name: getattr(truth, name) for name in ("rate", "angle", "encoder_rate", "torque")}
    return {**single, **truth.sensor_rate}


# ---------------------------------------------------------------- the modes without a plant


@pytest.mark.oracle
@pytest.mark.parametrize("freq_hz", [0.5, 10.0, 100.0, 1000.0])
def test_ideal_follows_the_command_exactly(freq_hz: float) -> None:
    block = command(freq_hz, DEG, 10_000)
    truth = Turntable(TurntableParameters(mode="ideal"), SENSORS).process(block)
    # Roundings of 10 000 torques, each eps * the largest change of rate.
    assert np.abs(truth.rate - block.rate[:-1]).max() < 1e-10 * np.abs(block.rate).max()
    np.testing.assert_allclose(truth.rate, truth.encoder_rate, rtol=0.0, atol=1e-15 * DEG)
    # A held torque makes the rate linear between the samples: the angle is the trapezoid's, (w h)^2 / 12 off, and half
    # of that again for what the ramp adds.
    bound = (2 * np.pi * max(freq_hz, 10.0) * DT) ** 2 / 8 * np.abs(block.angle).max()
    assert np.abs(truth.angle - block.angle[:-1]).max() < bound


@pytest.mark.oracle
@pytest.mark.parametrize(("drag", "windage"), [(0.0, 0.0), (0.5, 0.0), (0.0, 0.5), (5e-4, 0.1)])
def test_ideal_follows_random_rate_at_any_drag(drag: float, windage: float) -> None:
    block = random_command(4000)
    parameters = TurntableParameters(mode="ideal", spindle_drag=drag, spindle_windage=windage)
    truth = Turntable(parameters, SENSORS).process(block)
    assert np.abs(truth.rate - block.rate[:-1]).max() < 1e-10 * np.abs(block.rate).max()


def test_fixed_is_the_command_bit_for_bit() -> None:
    block = command(10.0, DEG, 3000)
    truth = Turntable(TurntableParameters(mode="fixed"), {"mhd_ars": Mounting()}).process(block)
    for value in (truth.rate, truth.encoder_rate, truth.sensor_rate["mhd_ars"]):
        np.testing.assert_array_equal(value, block.rate[:-1])
    np.testing.assert_array_equal(truth.angle, block.angle[:-1])
    assert not truth.torque.any()
    assert not np.shares_memory(truth.rate, block.rate)


def test_fixed_at_rest_is_exactly_zero() -> None:
    truth = Turntable(TurntableParameters(mode="fixed"), SENSORS).process(constant(0.0, 1000))
    assert not any(value.any() for value in columns(truth).values())


@pytest.mark.parametrize("mode", MODES)
def test_misaligned_sensor_feels_the_projection(mode: str) -> None:
    a, b = SENSORS["mems_gyro"].misalignment
    truth = Turntable(CALM.model_copy(update={"mode": mode}), SENSORS).process(command(20.0, DEG, 2000))
    scale = np.abs(truth.rate).max()
    # Rx(a) Ry(b) e_z on the vertical; a balanced table does not turn about x and y.
    expected = np.cos(a) * np.cos(b) * truth.rate
    np.testing.assert_allclose(truth.sensor_rate["mems_gyro"], expected, rtol=0.0, atol=1e-14 * scale)
    np.testing.assert_allclose(truth.sensor_rate["mhd_ars"], truth.rate, rtol=0.0, atol=1e-14 * scale)


def test_misaligned_sensor_feels_the_rocking_of_an_unbalanced_table() -> None:
    parameters = CALM.model_copy(update={"rotor_com": (1e-3, 0.0, 0.05)})
    a, b = SENSORS["mems_gyro"].misalignment
    truth = Turntable(parameters, SENSORS).process(command(20.0, 20 * DEG, 4000))
    cross = truth.sensor_rate["mems_gyro"] - np.cos(a) * np.cos(b) * truth.rate
    assert np.abs(cross).max() > 1e-7 * np.abs(truth.rate).max()


# ---------------------------------------------------------------- the full plant


def two_bodies(parameters: TurntableParameters, block: CommandBlock) -> tuple[np.ndarray, np.ndarray]:
    """Return encoder rate and inertial rate by an exact zero-order-hold solution of platform yaw and spindle.

    Independent of MuJoCo and of `feed_forward`: M q'' + C q' + K q = B (angle, rate, torque), held over each step.
    """
    p = parameters
    kp, kv = servo.gains(p)
    rotor, platform, corner = p.spindle_inertia, p.platform_inertia[2], 2 * np.pi * p.isolation_frequency[5]
    M = np.array([[platform + rotor, rotor], [rotor, rotor]])
    K = np.diag([platform * corner**2, kp])
    C = np.diag([2 * p.isolation_damping * corner * platform, kv + p.spindle_drag])
    B = np.array([[0.0, 0.0, 0.0], [kp, kv, 1.0]])
    A = np.zeros((7, 7))
    A[:2, 2:4] = np.eye(2)
    A[2:4, :2], A[2:4, 2:4], A[2:4, 4:] = -np.linalg.solve(M, K), -np.linalg.solve(M, C), np.linalg.solve(M, B)
    step = expm(A * DT)
    torque = rotor * FS * np.diff(block.rate) + p.spindle_drag * block.rate_mid
    inputs = np.stack([block.angle_mid, block.rate_mid, torque], axis=1)
    x = np.zeros(4)
    states = np.empty((block.n_time, 4))
    for k, u in enumerate(inputs):
        states[k] = x
        x = step[:4, :4] @ x + step[:4, 4:] @ u
    return states[:, 3], states[:, 2] + states[:, 3]


@pytest.mark.oracle
@pytest.mark.parametrize("freq_hz", [0.5, 10.0, 100.0, 1000.0])
def test_full_plant_matches_the_two_body_solution(freq_hz: float) -> None:
    # Balanced and without cogging, yaw is decoupled from the ten other directions.
    block = command(freq_hz, DEG, 10_000)
    truth = Turntable(CALM, SENSORS).process(block)
    encoder, inertial = two_bodies(CALM, block)
    scale = np.abs(block.rate).max()
    # RK4's response to a held torque on the servo's pole of 133 Hz is (p h)^4 / 120 = 2.6e-8 off; twice is allowed.
    assert np.abs(truth.encoder_rate - encoder).max() < 5e-8 * scale
    assert np.abs(truth.rate - inertial).max() < 5e-8 * scale


@pytest.mark.oracle
@pytest.mark.parametrize("freq_hz", [20.0, 100.0])
def test_encoder_and_inertial_rate_differ_by_the_recoil_of_the_platform(freq_hz: float) -> None:
    block = command(freq_hz, DEG, 20_000)
    truth = Turntable(CALM, SENSORS).process(block)
    p, s = CALM, 2j * np.pi * freq_hz
    rotor, platform, corner = p.spindle_inertia, p.platform_inertia[2], 2 * np.pi * p.isolation_frequency[5]
    spring = platform * (corner**2 + 2 * p.isolation_damping * corner * s)
    expected = 1 - rotor * s**2 / ((platform + rotor) * s**2 + spring)
    # The start excites the yaw mode (decay 1.5 s), so its decaying sine is fitted along with the line.
    t = np.arange(10_000, 20_000) * DT
    load = platform * corner**2 / (platform + rotor)
    decay = p.isolation_damping * corner * platform / (platform + rotor)
    ring = np.sqrt(load - decay**2)
    basis = np.stack(
        [
            np.cos(s.imag * t),
            np.sin(s.imag * t),
            np.exp(-decay * t) * np.cos(ring * t),
            np.exp(-decay * t) * np.sin(ring * t),
        ],
        axis=1,
    )
    fit = np.linalg.lstsq(basis, np.stack([truth.rate, truth.encoder_rate], axis=1)[10_000:], rcond=None)[0]
    line = fit[0] - 1j * fit[1]
    # Left over: the slow servo pole (17 Hz, exp(-50)) and the servo's pull on the yaw mode, 1e-3 of a ringing of 1e-3.
    assert abs(line[0] / line[1] - expected) < 1e-7
    if freq_hz == 100.0:
        assert 1 - abs(line[0] / line[1]) == pytest.approx(rotor / platform, rel=3e-3)  # 0.111 %


@pytest.mark.parametrize("freq_hz", [0.5, 10.0, 100.0, 1000.0, None])
def test_halving_the_step_changes_the_truth_by_less_than_1e_6(freq_hz: float | None) -> None:
    parameters = TurntableParameters(rotor_com=(1e-4, 0.0, 0.05))
    block = random_command(3000) if freq_hz is None else command(freq_hz, DEG, 3000)
    coarse = Turntable(parameters, SENSORS).process(block)
    fine = Turntable(parameters, SENSORS, substeps=2).process(block)
    scale = np.abs(coarse.rate).max()
    change = np.abs(coarse.rate - fine.rate).max() / scale
    assert 0.0 < change < 1e-6
    for name in SENSORS:
        assert np.abs(coarse.sensor_rate[name] - fine.sensor_rate[name]).max() < 1e-6 * scale


def test_halving_the_step_shrinks_the_error_by_its_fourth_order() -> None:
    block = command(100.0, DEG, 2000)
    rates = [Turntable(CALM, SENSORS, substeps=n).process(block).rate for n in (1, 2, 4)]
    first, second = (np.abs(a - b).max() for a, b in pairwise(rates))
    assert 12.0 < first / second < 20.0  # 2^4 = 16; the next order and rounding take a quarter


def test_servo_tracks_the_command_within_its_known_error() -> None:
    block = command(10.0, DEG, 20_000, ramp_in=0.5)
    truth = Turntable(TurntableParameters(), SENSORS).process(block)
    late = slice(12_000, None)
    error = np.abs(truth.encoder_rate - block.rate[:-1])[late].max() / DEG
    # The feed-forward leaves the recoil (0.11 %), which the servo shrinks; the cogging adds a few 1e-5.
    assert error < 1.5e-3


def test_feed_forward_error_shows_at_high_frequency() -> None:
    block = command(500.0, 0.5 * DEG, 4000)
    wrong = CALM.model_copy(update={"feedforward_inertia_error": 0.02, "feedforward_drag_error": 0.2})
    peaks = [np.abs(Turntable(p, SENSORS).process(block).rate[2000:]).max() for p in (CALM, wrong)]
    # Far above the servo's corner the motor decides: 2 % of inertia are 2 % of rate, less the servo's (150/500)^2.
    assert peaks[1] / peaks[0] == pytest.approx(1.02, abs=0.002)


def test_inertial_angle_is_the_integral_of_the_inertial_rate() -> None:
    block = command(50.0, DEG, 8000)
    truth = Turntable(CALM, SENSORS).process(block)
    steps = 0.5 * DT * (truth.rate[1:] + truth.rate[:-1])
    integral = np.concatenate([[0.0], np.cumsum(steps)])
    # Within a step the rate loop adds kv / I (h tau - tau^2) / 2 of the acceleration, which the trapezoid misses.
    bound = 1.2 * servo.gains(CALM)[1] / CALM.spindle_inertia * DT**2 / 12 * np.abs(truth.rate).max()
    assert np.abs(truth.angle - integral).max() < bound
    assert np.ptp(truth.angle) * 1e-3 > 10 * bound  # so the recoil, which the spindle alone would miss, is seen


@pytest.mark.parametrize("mode", MODES)
def test_angle_is_not_wrapped(mode: str) -> None:
    truth = Turntable(TurntableParameters(mode=mode), SENSORS).process(constant(40.0, 6000))
    expected = 40.0 * np.arange(6000) * DT
    assert expected[-1] > 2 * np.pi
    # The platform follows the drag of 20 mN m by 20e-3 / (k = 5.8e3) = 4e-6 rad; cogging moves the servo by 1e-6.
    np.testing.assert_allclose(truth.angle, expected, rtol=0.0, atol=2e-5)


def test_static_table_stays_still() -> None:
    truth = Turntable(TurntableParameters(), SENSORS).process(constant(0.0, 10_000))
    # The equilibrium leaves accelerations of 1e-13 rad/s^2, which spring and servo hold below 1e-13 h.
    for value in (truth.rate, truth.encoder_rate, *truth.sensor_rate.values()):
        assert np.abs(value).max() < 1e-16
    # The servo stands against the cogging.
    # ... which moves it by 6e-4 / kp = 1.3e-7 rad, and so the cogging by 24 of that.
    assert np.abs(truth.torque + 2e-3 * np.sin(0.3)).max() < 1e-8


def test_static_table_stays_still_at_another_angle() -> None:
    block = constant(0.0, 4000)
    turned = CommandBlock(0, block.rate, block.angle + 1.0, block.rate_mid, block.angle_mid + 1.0)
    truth = Turntable(TurntableParameters(), SENSORS).process(turned)
    # The last bit of an angle of 1 rad, times the 133 Hz of the servo.
    assert np.abs(truth.rate).max() < np.finfo(float).eps * 2 * np.pi * 133
    assert truth.angle[0] == pytest.approx(1.0, abs=1e-6)  # but for the cogging on the servo's stiffness


# ---------------------------------------------------------------- blocks and poses


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("cuts", [(0, 3000), (0, 1, 2, 1000, 2999, 3000), (0, 400, 800, 3000), (0, 0, 399, 1201, 3000)])
def test_any_division_into_blocks_gives_the_same_bits(mode: str, cuts: tuple[int, ...]) -> None:
    parameters = TurntableParameters(mode=mode, rotor_com=(1e-4, 0.0, 0.05))
    block = command(10.0, DEG, 3000)
    whole = Turntable(parameters, SENSORS).process(block)
    table = Turntable(parameters, SENSORS)
    parts = [table.process(cut(block, a, b)) for a, b in pairwise(cuts)]
    assert [part.start for part in parts] == list(cuts[:-1])
    for name, value in columns(whole).items():
        np.testing.assert_array_equal(np.concatenate([columns(part)[name] for part in parts]), value)
    for body, poses in whole.poses.items():
        for i in range(2):
            np.testing.assert_array_equal(np.concatenate([part.poses[body][i] for part in parts]), poses[i])


@pytest.mark.parametrize("mode", MODES)
def test_poses_are_those_of_the_model_at_the_pose_samples(mode: str) -> None:
    block = command(2.0, 60 * DEG, 3000)
    table = Turntable(TurntableParameters(mode=mode), SENSORS, pose_stride=100)
    truth = table.process(cut(block, 0, 1050))
    truth = table.process(cut(block, 1050, 3000))
    assert set(truth.poses) == {"platform", "rotor"}
    for place, turn in truth.poses.values():
        assert place.shape == (19, 3)
        assert turn.shape == (19, 4)
        np.testing.assert_allclose(np.linalg.norm(turn, axis=1), 1.0, rtol=0.0, atol=1e-15 * 4)
    turn = truth.poses["rotor"][1]
    angle = 2 * np.arctan2(turn[:, 3], turn[:, 0])
    np.testing.assert_allclose(angle, truth.angle[50::100], rtol=0.0, atol=1e-12)
    place = truth.poses["rotor"][0] - truth.poses["platform"][0]
    assert place[:, 2] == pytest.approx(table.parameters.bearing_height, abs=1e-4)  # less the sag in the bearing


def test_process_refuses_a_block_that_does_not_follow() -> None:
    table = Turntable(TurntableParameters(mode="fixed"), SENSORS)
    block = command(10.0, DEG, 300)
    table.process(cut(block, 0, 100))
    with pytest.raises(ValueError, match="start: expected 100, the sample after the last block, got 200"):
        table.process(cut(block, 200, 300))


# ---------------------------------------------------------------- failures


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_nan_command_raises_and_names_the_time(mode: str, value: float) -> None:
    block = command(10.0, DEG, 1000)
    block.rate[250] = value
    with pytest.raises(RunError, match=rf"got rate = {value} at t = 0\.0125 s"):
        Turntable(TurntableParameters(mode=mode), SENSORS).process(block)


def test_saturated_motor_raises_and_names_the_time() -> None:
    parameters = TurntableParameters()
    block = command(1000.0, 2 * DEG, 4000)
    needed = required_torque(parameters, block, FS)
    first = int(np.argmax(needed > parameters.torque_limit)) * DT
    table = Turntable(parameters, SENSORS)
    truth = table.process(cut(block, 0, 200))
    assert np.abs(truth.torque).max() < parameters.torque_limit
    with pytest.raises(RunError, match=r"the motor saturated at its 6 N\*m") as caught:
        table.process(cut(block, 200, 4000))
    found = re.search(r"at t = (\S+) s; the run got this far", str(caught.value))
    assert found is not None
    # The servo's own torque moves it by less than half a period.
    assert float(found[1]) == pytest.approx(first, abs=0.5e-3)


def test_ideal_knows_no_torque_limit() -> None:
    block = command(1000.0, 5 * DEG, 2000)
    truth = Turntable(TurntableParameters(mode="ideal"), SENSORS).process(block)
    assert np.abs(truth.torque).max() > 20.0


def test_table_that_falls_over_is_refused_before_the_run() -> None:
    with pytest.raises(ScenarioError, match="growing mode"):
        Turntable(TurntableParameters(platform_com_height=2.0), SENSORS)


def test_substeps_make_room_for_a_stiffer_bearing() -> None:
    stiff = TurntableParameters(radial_frequency=3000.0)
    with pytest.raises(ScenarioError, match="expected every mode below"):
        Turntable(stiff, SENSORS)
    truth = Turntable(stiff, SENSORS, substeps=4).process(command(10.0, DEG, 400))
    assert truth.rate.shape == (400,)


# ---------------------------------------------------------------- presets


def table_preset(name: str, **changes: object) -> TurntableParameters:
    read = TurntableParameters.model_validate(preset("testbed.models", name), context={"border": True})
    return read.model_copy(update=changes)


@pytest.mark.parametrize("mode", ["servo", "digital"])
def test_high_torque_table_passes_50_deg_s_at_60_hz(mode: str) -> None:
    parameters = table_preset("air_bearing_high_torque", mode=mode)
    block = command(60.0, 50 * DEG, 8000, ramp_in=0.1)
    needed = required_torque(parameters, block, FS).max()
    truth = Turntable(parameters, SENSORS).process(block)
    torque = np.abs(truth.torque).max()
    assert 19.7 < torque < needed < parameters.torque_limit  # I A w = 19.7 N m
    late = slice(4000, None)  # four periods after the ramp
    t = np.arange(8000)[late] * DT
    basis = np.stack([np.sin(120 * np.pi * t), np.cos(120 * np.pi * t), t, np.ones_like(t)], axis=1)
    amplitude = np.hypot(*np.linalg.lstsq(basis, truth.rate[late], rcond=None)[0][:2]) / (50 * DEG)
    print(f"{mode}: {torque:.1f} N m of {parameters.torque_limit:g} N m, amplitude {100 * (amplitude - 1):+.3f} %")
    # What misses is the recoil of the platform, I / I_platform = 0.13 %, of which the servo takes part back.
    assert abs(amplitude - 1) < 2e-3


def test_plain_table_does_not() -> None:
    block = command(60.0, 50 * DEG, 4000, ramp_in=0.1)
    assert required_torque(TurntableParameters(), block, FS).max() > 6.0
    with pytest.raises(RunError, match=r"the motor saturated at its 6 N\*m"):
        Turntable(TurntableParameters(), SENSORS).process(block)


# ---------------------------------------------------------------- every parameter counts

OTHER_VALUES = {
    "gravity": 1.6,
    "platform_mass": 380.0,
    "platform_inertia": (25.0, 24.0, 46.0),
    "platform_com_height": 0.06,
    "isolation_frequency": (1.6, 1.5, 2.6, 2.1, 2.0, 1.9),
    "isolation_damping": 0.07,
    "bearing_height": 0.26,
    "rotor_mass": 21.0,
    "rotor_inertia": (0.071, 0.07, 0.051),
    "rotor_com": (2e-4, 0.0, 0.05),
    "radial_frequency": 380.0,
    "axial_frequency": 480.0,
    "tilt_frequency": 280.0,
    "bearing_damping": 0.04,
    "spindle_drag": 6e-4,
    "spindle_windage": 1e-3,
    "cogging": (),
    "rate_bandwidth": 140.0,
    "position_bandwidth": 14.0,
    "feedforward_inertia_error": 0.01,
    "feedforward_drag_error": 0.1,
    "digital": Digital(encoder_bits=23),
    "wobble": (Wobble(axis="ry", angle=1e-6, periods=2),),
    "earth_rate": EarthRate(latitude=0.8),
}
# Shown elsewhere: the modes, the step and the engine in tests of their own, the height of the sensors in the picture,
# the limit when it is reached.
ELSEWHERE = {"mode", "step", "engine", "mounting_height", "torque_limit", "floor"}


def test_other_values_cover_every_parameter() -> None:
    assert set(OTHER_VALUES) | ELSEWHERE == set(TurntableParameters.model_fields)


@pytest.mark.parametrize("name", OTHER_VALUES)
def test_every_parameter_changes_the_truth(name: str) -> None:
    mountings = {"lateral": Mounting(misalignment=(0.3, 0.4))}
    base = TurntableParameters(mode="digital", rotor_com=(1e-4, 0.0, 0.05))
    block = command(20.0, DEG, 600, ramp_in=0.01)
    other = base.model_copy(update={name: OTHER_VALUES[name]})
    truths = [columns(Turntable(p, mountings, pose_stride=1).process(block))["lateral"] for p in (base, other)]
    assert not np.array_equal(*truths)


@pytest.mark.parametrize(
    "digital", [{"controller_rate": 10e3}, {"velocity_filter": 500.0}, {"ripple": ()}, {"encoder_bits": 25}]
)
def test_every_parameter_of_the_digital_servo_changes_the_truth(digital: dict[str, object]) -> None:
    block = command(20.0, DEG, 600, ramp_in=0.01)
    rates = [
        Turntable(TurntableParameters(mode="digital", digital=Digital(**one)), SENSORS).process(block).rate
        for one in ({}, digital)
    ]
    assert not np.array_equal(*rates)


@pytest.mark.parametrize("mode", MODES)
def test_lever_alone_changes_no_rate(mode: str) -> None:
    # A rate is the same at every point of a rigid body.
    mountings = {"centre": Mounting(), "rim": Mounting(position=(0.12, -0.05, 0.03))}
    felt = Turntable(TurntableParameters(mode=mode), mountings).process(command(20.0, DEG, 1000)).sensor_rate
    np.testing.assert_allclose(felt["rim"], felt["centre"], rtol=0.0, atol=1e-15 * DEG)
    poses = plant.build(TurntableParameters(mode=mode), mountings, DT)
    np.testing.assert_allclose(poses.site("rim").pos - poses.site("centre").pos, (0.12, -0.05, 0.03), atol=1e-15)


# ---------------------------------------------------------------- torque and model


@pytest.mark.oracle
def test_required_torque_is_inertia_drag_and_cogging() -> None:
    parameters = TurntableParameters(spindle_drag=0.02, rate_bandwidth=1e-6)
    amplitude, freq_hz = 10 * DEG, 20.0
    needed = required_torque(parameters, command(freq_hz, amplitude, 4000, ramp_in=0.0), FS)
    corner = 2 * np.pi * freq_hz
    t = (np.arange(4000) + 0.5) * DT
    motion = parameters.spindle_inertia * corner * np.cos(corner * t) + parameters.spindle_drag * np.sin(corner * t)
    # The mean acceleration over a step: (w h)^2 / 24 = 1.6e-6 below that in its middle.
    np.testing.assert_allclose(needed, np.abs(amplitude * motion) + 2e-3, rtol=0.0, atol=2e-6 * amplitude * corner)


def test_required_torque_bounds_what_the_motor_gives() -> None:
    parameters = TurntableParameters()
    block = command(50.0, DEG, 8000, ramp_in=0.2)
    torque = Turntable(parameters, SENSORS).process(block).torque
    needed = required_torque(parameters, block, FS)
    assert np.abs(torque).max() < needed.max()
    assert np.abs(torque).max() > 0.98 * needed.max()  # the cogging is only 0.7 % of it


@pytest.mark.parametrize("mode", MODES)
def test_model_is_there_for_drawing_in_every_mode(mode: str) -> None:
    model = Turntable(TurntableParameters(mode=mode), SENSORS).model
    assert isinstance(model, mujoco.MjModel)
    assert model.nv == (12 if mode in {"servo", "digital"} else 1)
    assert {model.body(i).name for i in range(model.nbody)} == {"world", "platform", "rotor"}
    assert {"mhd_ars", "mems_gyro"} <= {model.site(i).name for i in range(model.nsite)}


def test_table_rests_at_the_height_that_is_drawn_in_every_mode() -> None:
    heights = []
    for mode in ("servo", "ideal"):
        truth = Turntable(TurntableParameters(mode=mode), SENSORS).process(constant(0.0, 1))
        heights.append(truth.poses["platform"][0][0, 2])
    assert heights[0] == pytest.approx(heights[1], abs=1e-12)
