"""The plant by its modes, against MuJoCo at a sixteenth of its step, and against a matrix exponential of its own."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from itertools import pairwise
from pathlib import Path

import mujoco
import numpy as np
import pytest
from scipy.linalg import expm

from testbed.errors import RunError, ScenarioError
from testbed.models.motion import MotionProfile
from testbed.models.turntable import modal, plant
from testbed.models.turntable.linear import linear_plant
from testbed.models.turntable.modes import settle
from testbed.models.turntable.parameters import Cogging, Mounting, TurntableParameters
from testbed.models.turntable.turntable import Turntable
from testbed.scenario.loader import load_scenario
from testbed.scenario.step_choice import choose_step
from testbed.signals import BASE_RATE_HZ, random_stream
from tests.scenes import short, short_file

DEG = np.pi / 180.0
SENSORS = {"mhd_ars": Mounting(), "mems_gyro": Mounting(position=(0.0, 0.0, 0.05), misalignment=(0.02, -0.03))}
SCENARIOS = Path(__file__).parents[3] / "scenarios"
QUIET = sorted(
    path.relative_to(SCENARIOS)
    for path in SCENARIOS.rglob("*.yaml")
    if not (path.parent.name in {"fog", "paper2"} or path.stem in {"disturbed_table", "static_allan"})
)
MODAL = ("{preset: air_bearing}", "{preset: air_bearing, engine: modal}")


def sine(freq_hz, amplitude=DEG):
    return MotionProfile([lambda t: amplitude * np.sin(2 * np.pi * freq_hz * t + 0.3)], 0.05, BASE_RATE_HZ)


def play(parameters, motion, *, cuts=(0, 4000), sensors=SENSORS, **options):
    table = Turntable(parameters, sensors, BASE_RATE_HZ, **options)
    return signals([table.process(motion.process(b - a)) for a, b in pairwise(cuts)], sensors)


def signals(parts, sensors=SENSORS):
    joined = {
        name: np.concatenate([getattr(part, name) for part in parts])
        for name in ("rate", "encoder_rate", "angle", "torque")
    }
    return joined | {name: np.concatenate([part.sensor_rate[name] for part in parts]) for name in sensors}


def worst(first, second):
    """Return the largest change of a rate over the largest rate."""
    scale = np.abs(first["rate"]).max()
    rates = first.keys() - {"angle", "torque"}
    return max(np.abs(first[name] - second[name]).max() for name in rates) / scale


@pytest.mark.oracle
@pytest.mark.slow
@pytest.mark.parametrize("path", QUIET, ids=str)
def test_modes_are_mujoco_at_a_sixteenth_of_its_step_on_every_quiet_scenario(path):
    """RK4 at 3.1 us is right to 1e-11 of the largest rate (fourth order, 4e-9 at 50 us)."""
    scenario = load_scenario(SCENARIOS / path)
    mountings = {name: sensor.mounting for name, sensor in scenario.sensors.items()}
    assert scenario.turntable.mode in {"servo", "ideal"}
    # A profile begins with its ramp of 0.1 s: the part behind it is louder, and a quarter of a second of it is enough.
    n_time = 20 if scenario.lines == () and "static" in path.stem else round(0.35 * BASE_RATE_HZ)
    found = [
        play(scenario.turntable, scenario.profile(0.1), cuts=(0, n_time), sensors=mountings, **options)
        for options in ({"substeps": 16}, {"modal": True})
    ]
    if np.abs(found[0]["rate"]).max() < 1e-12:
        assert np.abs(found[1]["rate"]).max() < 1e-12
        return
    print(f"{path}: {worst(*found):.1e} of the largest rate")
    assert worst(*found) < 2e-10
    assert np.abs(found[0]["angle"] - found[1]["angle"]).max() < 2e-10 * np.abs(found[0]["angle"]).max()


@pytest.mark.oracle
@pytest.mark.slow
@pytest.mark.parametrize("what", ["floor", "imbalance", "windage"])
def test_modes_hold_to_5e_7_where_the_table_is_disturbed(what):
    """What is not linear there is a product of two small motions, which the linear plant leaves out."""
    parameters, floor = TurntableParameters(), None
    if what == "floor":
        scenario = load_scenario(SCENARIOS / "disturbed_table.yaml")
        parameters = scenario.turntable.model_copy(update={"mode": "servo", "earth_rate": None})
        floor = parameters.floor.start(0.4, partial(random_stream, 7, "turntable", "floor"))
    elif what == "imbalance":
        parameters = TurntableParameters(rotor_com=(1e-4, 0.0, 0.05))
    else:
        parameters = TurntableParameters(spindle_windage=1e-2)
    found = [
        play(parameters, sine(10.0, 5 * DEG), cuts=(0, 8000), floor=floor, **options)
        for options in ({"substeps": 16}, {"modal": True})
    ]
    print(f"{what}: {worst(*found):.1e} of the largest rate")
    assert worst(*found) < 5e-7


def test_the_ideal_hinge_takes_the_commanded_rates():
    """Its torque is the inverse of the hold, so that every rate is met: rounding of 4000 steps is left."""
    motion = sine(40.0)
    command = motion.process(4000)
    table = Turntable(TurntableParameters(mode="ideal"), SENSORS, BASE_RATE_HZ, modal=True)
    truth = table.process(command)
    np.testing.assert_allclose(truth.rate, command.rate[:-1], rtol=0, atol=1e-12)
    np.testing.assert_allclose(truth.angle, command.angle[:-1], rtol=0, atol=1e-9)


@pytest.mark.oracle
def test_the_kernel_is_the_matrix_exponential_of_the_linear_plant():
    """A plain loop over x+ = Phi x + Gamma u without cogging; rounding grows with the condition of the modes, 2e3."""
    parameters = TurntableParameters(cogging=())
    model = plant.build(parameters, SENSORS, 5e-5)
    data = mujoco.MjData(model)
    settle(model, data)
    outputs = [model.sensor(name).adr[0] for name in (f"q_{plant.SPINDLE}", "encoder_rate")]
    motor = int(model.actuator_ctrladr[model.actuator(plant.MOTOR).id])
    inputs = [motor, motor + 1, motor + 2]
    qvel = np.zeros(model.nv)
    rng = np.random.default_rng(3)
    control = np.zeros((600, model.nu))
    control[:, inputs] = 1e-3 * rng.standard_normal((600, 3))
    rows, _ = modal.ModalEngine(model, data, qvel, inputs, outputs, parameters, 5e-5, 400).advance(0, control)
    linear = linear_plant(model, data, inputs, outputs, int(model.joint(plant.SPINDLE).dofadr[0]))
    n = len(linear.A)
    step = expm(5e-5 * np.block([[linear.A, linear.B], [np.zeros((3, n + 3))]]))
    x, expected = np.zeros(n), np.empty_like(rows)
    for k, u in enumerate(control[:, inputs]):
        expected[k] = linear.y0 + linear.C @ x
        x = step[:n, :n] @ x + step[:n, n:] @ u
    np.testing.assert_allclose(rows, expected, rtol=0, atol=1e-11 * float(np.abs(expected).max()))


def test_any_blocks_give_the_same_bits_and_poses():
    parameters = TurntableParameters(rotor_com=(1e-4, 0.0, 0.05))
    cuts = [(0, 4000), (0, 1, 399, 400, 401, 3333, 4000)]
    tables = [Turntable(parameters, SENSORS, BASE_RATE_HZ, modal=True, pose_stride=100) for _ in cuts]
    parts = []
    for table, cut in zip(tables, cuts, strict=True):
        motion = sine(10.0)
        parts.append([table.process(motion.process(b - a)) for a, b in pairwise(cut)])
    whole, divided = map(signals, parts)
    assert all(np.array_equal(whole[name], divided[name]) for name in whole)
    for body in plant.BODIES:
        for i in range(2):
            joined = np.concatenate([part.poses[body][i] for part in parts[1]])
            assert np.array_equal(parts[0][0].poses[body][i], joined)


@pytest.mark.parametrize("mode", ["servo", "ideal"])
def test_poses_are_those_of_mujoco(mode):
    poses = [
        Turntable(TurntableParameters(mode=mode), SENSORS, modal=flag).process(sine(5.0).process(2000)).poses
        for flag in (False, True)
    ]
    for body in plant.BODIES:
        for first, second in zip(poses[0][body], poses[1][body], strict=True):
            np.testing.assert_allclose(second, first, rtol=0, atol=1e-9)


def test_cogging_bends_with_the_angle():
    """A table that turns through many teeth: the torque of a linear plant would grow with the angle."""
    parameters = TurntableParameters(cogging=(Cogging(torque=5e-3, periods=48, phase=0.2),))
    motions = [MotionProfile([lambda t: np.full_like(t, 0.5)], 0.05, BASE_RATE_HZ) for _ in range(2)]
    found = [play(parameters, m, modal=flag) for m, flag in zip(motions, (False, True), strict=True)]
    assert worst(*found) < 1e-6


@pytest.mark.oracle
def test_a_swing_of_many_teeth_is_right_to_the_reference():
    """30 deg/s at 0.1 Hz: held flat over a step, the bent torque costs 2e-10 of the rate; RK4 at 3.1 us leaves 2e-13,
    which is its change to 1.6 us.
    """
    found = [
        play(TurntableParameters(), sine(0.1, 30 * DEG), cuts=(0, 3000), **options)
        for options in ({"substeps": 16}, {"modal": True})
    ]
    print(f"wide swing: {worst(*found):.1e} of the largest rate")
    assert worst(*found) < 1e-11


def test_a_rising_torque_is_integrated_at_every_speed_of_a_mode():
    """Against Gauss's quadrature, which is exact to rounding for exponents of this size; 0 is a mode that integrates.

    Where series and closed form meet, the latter has lost a digit.
    """
    a = np.array([0.0, 1e-9, -1e-3, 0.3 + 0.4j, -0.999, 1j, -1.001, 3.0 - 2.0j])
    nodes, weights = np.polynomial.legendre.leggauss(30)
    u = 0.5 * (nodes + 1.0)
    expected = (np.exp(np.multiply.outer(a, 1.0 - u)) * (u - 0.5)) @ weights / 2.0
    np.testing.assert_allclose(modal._rising(a.astype(complex)), expected, rtol=1e-13, atol=1e-16)


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"mode": "digital"}, "expected mode servo or ideal, got 'digital'"),
        ({"earth_rate": {"latitude": 0.8}}, "expected no earth_rate"),
        ({"step": 1e-4}, "expected none beside engine modal"),
        ({"mode": "ideal", "spindle_drag": 0.0}, "expected modes apart from each other"),
    ],
)
def test_a_table_that_modes_do_not_play_is_refused_at_check(change, expected, tmp_path):
    from testbed.document import Document
    from testbed.models.turntable.earth import EarthRate
    from testbed.scenario.checks import cross_check

    if "earth_rate" in change:
        change = {"earth_rate": EarthRate(**change["earth_rate"])}
    scenario = short(tmp_path, MODAL)
    scenario = replace(scenario, turntable=scenario.turntable.model_copy(update=change))
    document = Document(short_file(tmp_path, MODAL))
    cross_check(scenario, document)
    assert [problem for problem in document.problems if expected in problem.message], document.problems


def test_auto_takes_modes_where_they_stand_for_mujoco_and_says_so(tmp_path):
    auto = ("{preset: air_bearing}", "{preset: air_bearing, engine: auto}")
    choice = choose_step(short(tmp_path, auto))
    assert choice.modal
    assert 0.0 < choice.error < 1e-6
    digital = choose_step(short(tmp_path, ("{preset: air_bearing}", "{mode: digital, engine: auto}")))
    assert not digital.modal


def test_auto_refuses_a_wrong_mode(tmp_path, monkeypatch):
    """The damping of one mode is planted wrong by a part in 1e3 of its step."""
    right = modal.modes_of

    def wrong(*arguments):
        modes = right(*arguments)
        # The slowest pair is that of the platform's yaw or the servo: any will do that the spindle excites.
        at = int(np.argmax(np.abs(modes.shape[1]) * np.abs(modes.push[2])))
        step = modes.step.copy()
        step[at] *= 1.0 - 1e-3
        return replace(modes, step=step)

    monkeypatch.setattr("testbed.models.turntable.modal.modes_of", wrong)
    assert not choose_step(short(tmp_path, ("{preset: air_bearing}", "{preset: air_bearing, engine: auto}"))).modal


def test_a_command_that_is_not_finite_or_too_much_is_named():
    table = Turntable(TurntableParameters(), SENSORS, modal=True)
    command = sine(10.0).process(100)
    bad = replace(command, rate_mid=np.where(np.arange(100) == 40, np.nan, command.rate_mid))
    with pytest.raises(RunError, match=r"rate_mid = nan at t = 0\.002 s"):
        table.process(bad)
    with pytest.raises(RunError, match="the motor saturated at its 6 N"):
        Turntable(TurntableParameters(), SENSORS, modal=True).process(sine(200.0, 100 * DEG).process(2000))


def test_exposed_sensors_need_mujoco():
    with pytest.raises(ScenarioError, match="which turn with the table"):
        Turntable(TurntableParameters(), SENSORS, exposed=["mems_gyro"], modal=True)
