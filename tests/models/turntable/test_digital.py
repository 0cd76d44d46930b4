"""The digital servo: its loop against an independent one, its encoder's noise, its ripple, its failures."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.linalg import expm

from testbed.errors import RunError, ScenarioError
from testbed.models.motion import CommandBlock, MotionProfile
from testbed.models.turntable import servo
from testbed.models.turntable.digital import Controller, check_loop, closed_loop
from testbed.models.turntable.parameters import Digital, Mounting, Ripple, TurntableParameters
from testbed.models.turntable.servo import required_torque
from testbed.models.turntable.turntable import Turntable

if TYPE_CHECKING:
    from testbed.models.turntable.truth import TruthBlock

FS = 20000.0
DT = 1.0 / FS
DEG = np.pi / 180.0
SENSORS = {"mhd_ars": Mounting()}


def parameters(bandwidth: float = 150.0, **digital: object) -> TurntableParameters:
    return TurntableParameters(
        mode="digital",
        rate_bandwidth=bandwidth,
        position_bandwidth=bandwidth / 10,
        digital=Digital(**{"ripple": (), **digital}),
    )


def command(freq_hz: float, amplitude: float, n_time: int, ramp_in: float = 0.5) -> CommandBlock:
    return MotionProfile([lambda t: amplitude * np.sin(2 * np.pi * freq_hz * t)], ramp_in, FS).process(n_time)


def run(p: TurntableParameters, block: CommandBlock) -> TruthBlock:
    return Turntable(p, SENSORS).process(block)


# ---------------------------------------------------------------- the controller alone


def test_controller_sees_whole_counts_only() -> None:
    p = parameters(encoder_bits=10)
    kp = servo.gains(p)[0]
    count = 2 * np.pi / 1024
    for angle, counts in ((0.0, 0), (0.49 * count, 0), (0.51 * count, 1), (-0.51 * count, -1), (7.4 * count, 7)):
        # At its first tick there is no difference yet.
        assert Controller(p).torque(angle, 0.0, 0.25) == pytest.approx(0.25 - kp * counts * count, rel=1e-12)


@pytest.mark.oracle
@pytest.mark.parametrize("rate", [20e3, 5e3])
def test_controller_filters_the_difference_with_its_corner(rate: float) -> None:
    p = parameters(encoder_bits=40, controller_rate=rate, velocity_filter=200.0)
    kp, kv = servo.gains(p)
    controller = Controller(p)
    t = np.arange(60) / rate
    torque = np.array([controller.torque(0.0, 0.3 * tick, 0.0) for tick in t])
    # The error grows at 0.3 rad/s: a first-order low-pass of 200 Hz sampled exactly.
    expected = kp * 0.3 * t + kv * 0.3 * -np.expm1(-2 * np.pi * 200.0 * t)
    # The encoder's count of 6e-12 rad differenced at the tick rate is not in it: the angle stands still.
    np.testing.assert_allclose(torque, expected, rtol=0.0, atol=1e-12 * torque.max())


@pytest.mark.oracle
def test_closed_loop_matrix_is_controller_and_hinge() -> None:
    p = parameters(encoder_bits=40, controller_rate=5e3)
    controller, step = Controller(p), closed_loop(p)
    inertia, drag = p.spindle_inertia, p.spindle_drag
    hinge = expm(np.array([[0, 1, 0], [0, -drag / inertia, 1 / inertia], [0, 0, 0]]) / 5e3)
    x, state = np.array([1e-3, 0.0]), np.array([1e-3, 0.0, -1e-3, 0.0])
    for _ in range(200):
        x = hinge[:2, :2] @ x + hinge[:2, 2] * controller.torque(x[0], 0.0, 0.0)
        state = step @ state
        np.testing.assert_allclose(state[:2], x, rtol=0.0, atol=1e-7)  # counts of 6e-12 rad at 5 kHz through kv / I
    assert np.abs(np.linalg.eigvals(step)).max() < 1.0


# ---------------------------------------------------------------- on the plant


def sampled(p: TurntableParameters, block: CommandBlock) -> tuple[np.ndarray, np.ndarray]:
    """Return encoder and inertial rate of platform yaw and spindle under the controller without counts: exact holds."""
    kp, kv = servo.gains(p)
    rotor, platform, corner = p.spindle_inertia, p.platform_inertia[2], 2 * np.pi * p.isolation_frequency[5]
    M = np.array([[platform + rotor, rotor], [rotor, rotor]])
    K, C = (
        np.diag(d) for d in ([platform * corner**2, 0.0], [2 * p.isolation_damping * corner * platform, p.spindle_drag])
    )
    A = np.zeros((5, 5))
    A[:2, 2:4] = np.eye(2)
    A[2:4, :2], A[2:4, 2:4], A[2:4, 4] = -np.linalg.solve(M, K), -np.linalg.solve(M, C), np.linalg.solve(M, [0.0, 1.0])
    step = expm(A * DT)
    stride = round(FS / p.digital.controller_rate)
    alpha = 1 - np.exp(-2 * np.pi * p.digital.velocity_filter / p.digital.controller_rate)
    x, states, difference, last, torque = np.zeros(4), np.empty((block.n_time, 4)), 0.0, 0.0, 0.0
    for k in range(block.n_time):
        states[k] = x
        if k % stride == 0:
            e = block.angle[k] - x[1]
            difference += alpha * ((e - last) * p.digital.controller_rate - difference)
            last = e
            forward = rotor * FS * (block.rate[k + 1] - block.rate[k]) + p.spindle_drag * block.rate_mid[k]
            torque = forward + kp * e + kv * difference
        x = step[:4, :4] @ x + step[:4, 4] * torque
    return states[:, 3], states[:, 2] + states[:, 3]


@pytest.mark.oracle
@pytest.mark.parametrize("rate", [20e3, 10e3, 4e3])
@pytest.mark.parametrize("freq_hz", [10.0, 200.0])
def test_fine_encoder_gives_the_sampled_two_body_solution(freq_hz: float, rate: float) -> None:
    p = parameters(encoder_bits=40, controller_rate=rate).model_copy(update={"cogging": ()})
    block = command(freq_hz, DEG, 6000, ramp_in=0.05)
    truth = run(p, block)
    encoder, inertial = sampled(p, block)
    # RK4 is exact for a held torque here. A count of 6e-12 rad moves the rate by kv / I times it, 5e-9 rad/s; two of
    # them.
    assert np.abs(truth.encoder_rate - encoder).max() < 1e-8
    assert np.abs(truth.rate - inertial).max() < 1e-8


def test_reference_through_the_encoders_filter_leaves_the_feed_forward_alone() -> None:
    """An encoder rate that alone went through the filter would cost 0.77 % at 10 Hz."""
    truth = run(parameters(), command(10.0, DEG, 40_000))
    t = np.arange(20_000, 40_000) * DT
    basis = np.stack([np.sin(20 * np.pi * t), np.cos(20 * np.pi * t)], axis=1)
    amplitude = np.hypot(*np.linalg.lstsq(basis, truth.encoder_rate[20_000:], rcond=None)[0]) / DEG
    print(f"encoder amplitude at 10 Hz: {100 * (amplitude - 1):+.4f} %")
    assert abs(amplitude - 1) < 1e-4


@pytest.mark.slow
@pytest.mark.parametrize(
    ("bits", "bandwidth", "corner", "rate", "total", "band"),
    [
        (24, 150.0, 600.0, 20e3, 5.2e-5, (6.9e-6, 5.2e-5)),
        (28, 150.0, 600.0, 20e3, 3.1e-6, (2.8e-7, 3.1e-6)),
        (24, 150.0, 600.0, 5e3, 9.4e-5, (9.0e-5, 2.7e-5)),
        (24, 50.0, 200.0, 20e3, 8.5e-6, (7.4e-6, 4.1e-6)),
    ],
)
def test_noise_of_a_table_that_holds_still(
    bits: int, bandwidth: float, corner: float, rate: float, total: float, band: tuple[float, float]
) -> None:
    """The limit cycle of the counts, against an earlier program for the same plant: rms, and 0.1-1 kHz, 1-10 kHz
    [rad/s].
    """
    p = parameters(bandwidth, encoder_bits=bits, velocity_filter=corner, controller_rate=rate)
    noise = run(p, command(1.0, 0.0, 60_000)).rate[20_000:]
    line = 2 * np.abs(np.fft.rfft(noise)) ** 2 / noise.size**2
    freq = np.fft.rfftfreq(noise.size, DT)
    got = [np.sqrt(line[(freq >= low) & (freq < high)].sum()) for low, high in ((100, 1000), (1000, 10_001))]
    print(
        f"{bits} bit, {bandwidth:g}/{corner:g} Hz, {rate:g} Hz: {noise.std():.2e} rad/s, bands {got[0]:.1e} "
        f"{got[1]:.1e}"
    )
    # A limit cycle is sharp in its size; how it shares the bands depends on its start.
    assert noise.std() == pytest.approx(total, rel=0.1)
    np.testing.assert_allclose(got, band, rtol=0.25)


@pytest.mark.oracle
def test_ripple_is_proportional_to_the_command() -> None:
    """A servo of hardly any gain leaves the feed-forward alone: what the motor gives over it is the ripple."""
    ripple = (Ripple(relative=0.02, periods=6, phase=0.4), Ripple(relative=0.01, periods=11))
    p = parameters(1e-2, ripple=ripple, encoder_bits=30).model_copy(
        update={"spindle_drag": 0.05, "torque_limit": 50.0, "cogging": ()}
    )
    block = MotionProfile([lambda t: 8.0 + 2.0 * np.sin(30.0 * t)], 0.05, FS).process(16_000)
    truth = run(p, block)
    wanted = servo.feed_forward(p, block, DT)
    expected = wanted * (1 + 0.02 * np.sin(6 * truth.angle + 0.4) + 0.01 * np.sin(11 * truth.angle))
    # What is left of the servo: kv = 3e-3 N m s on errors of 1e-2 rad/s; the platform yields by 1e-3 rad.
    np.testing.assert_allclose(truth.torque, expected, rtol=0.0, atol=1e-4 * np.abs(wanted).max())
    assert np.ptp(truth.angle) > 2 * np.pi


def test_ripple_shows_in_the_rate_where_the_servo_is_slow() -> None:
    block = command(20.0, 10 * DEG, 20_000)
    smooth, rough = (run(parameters(ripple=r), block).rate for r in ((), (Ripple(relative=0.05, periods=90),)))
    assert np.abs(rough - smooth)[10_000:].max() > 1e-3 * 10 * DEG


def test_required_torque_bounds_what_the_motor_gives() -> None:
    for rate in (20e3, 5e3):
        p = parameters(controller_rate=rate, ripple=(Ripple(relative=0.02, periods=6),))
        block = command(50.0, DEG, 12_000)
        torque, needed = np.abs(run(p, block).torque).max(), required_torque(p, block, FS).max()
        assert 0.8 * needed < torque < needed


@pytest.mark.oracle
def test_required_torque_is_ripple_hold_count_and_cogging() -> None:
    ripple = (Ripple(relative=0.02, periods=6), Ripple(relative=0.03, periods=7))
    p = parameters(controller_rate=5e3, encoder_bits=20, ripple=ripple)
    block = MotionProfile([lambda t: 40.0 * t], 0.0, FS).process(10)
    kp, kv = 0.05 * 2 * np.pi * 150 * 2 * np.pi * 15, 0.05 * 2 * np.pi * 150
    count, alpha = 2 * np.pi / 2**20, 1 - np.exp(-2 * np.pi * 600 / 5e3)
    motion = 0.05 * 40.0 + 5e-4 * block.rate_mid
    expected = 1.05 * motion + kv * 40.0 * (200e-6 - 50e-6) / 2 + (kp + kv * alpha * 5e3) * count + 2e-3
    np.testing.assert_allclose(required_torque(p, block, FS), expected, rtol=1e-9)  # 40 t over 50 us rounds at 1e-12


# ---------------------------------------------------------------- failures


def test_saturation_is_found_and_timed() -> None:
    p = parameters(controller_rate=10e3, encoder_bits=30)
    block = command(500.0, 5 * DEG, 4000, ramp_in=0.05)
    first = int(np.argmax(required_torque(p, block, FS) > p.torque_limit)) * DT
    with pytest.raises(
        RunError, match=r"the motor saturated at its 6 N\*m at t = \S+ s; the run got this far"
    ) as caught:
        run(p, block)
    found = re.search(r"t = (\S+) s", str(caught.value))
    assert found is not None
    assert float(found[1]) == pytest.approx(first, abs=1e-3)  # half a period
    assert round(float(found[1]) * FS) % 2 == 0  # at a tick of the controller


@pytest.mark.parametrize("rate", [3e3, 40e3, 7001.0])
def test_controller_that_the_clock_cannot_run_is_refused(rate: float) -> None:
    with pytest.raises(ScenarioError, match=r"digital.controller_rate: expected 20000 Hz divided by a whole number"):
        Turntable(parameters(controller_rate=rate), SENSORS)


def test_unstable_loop_is_refused_before_the_run() -> None:
    unstable = parameters(controller_rate=500.0)
    with pytest.raises(ScenarioError, match="expected a stable digital servo, got a pole of magnitude"):
        check_loop(unstable, FS)
    check_loop(parameters(30.0, controller_rate=500.0), FS)
    with pytest.raises(ScenarioError, match="stable digital servo"):
        Turntable(unstable, SENSORS)


def test_plant_that_diverges_is_reported() -> None:
    block = MotionProfile([lambda t: np.full_like(t, 1e7)], 0.0, FS).process(10)
    strong = parameters().model_copy(update={"torque_limit": 1e12})
    with pytest.raises(RunError, match="the plant diverged at t = 0 s; the run got this far"):
        run(strong, block)


@pytest.mark.parametrize("axis", ["x", "y"])
def test_plant_whose_spindle_is_nowhere_is_reported(axis: str) -> None:
    """A floor that moves by 1e12 m leaves an angle that is no number for the encoder to round."""
    line = {"axis": axis, "frequency": 10.0, "displacement": 1e12}
    p = parameters().model_copy(update={"floor": {"lines": [line]}})
    floor = p.floor.start(0.02, lambda *_: np.random.default_rng(0))
    table = Turntable(p, SENSORS, floor=floor)
    with np.errstate(all="ignore"), pytest.raises(RunError, match="the run got this far"):
        table.process(command(10.0, 0.1 * DEG, 400))


@pytest.mark.parametrize("substeps", [1, 3])
def test_substeps_keep_the_controllers_clock(substeps: int) -> None:
    p = parameters(encoder_bits=40, controller_rate=10e3)
    block = command(20.0, DEG, 2000, ramp_in=0.02)
    coarse = run(p, block).rate
    fine = Turntable(p, SENSORS, substeps=substeps).process(block).rate
    assert np.abs(coarse - fine).max() < 1e-6 * np.abs(coarse).max()
