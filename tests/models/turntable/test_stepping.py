"""Integration steps of several holds against the base step, block by block, and with the correction left out."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from testbed.errors import ScenarioError
from testbed.models.motion import MotionProfile
from testbed.models.turntable import stepping
from testbed.models.turntable.parameters import Mounting, TurntableParameters
from testbed.models.turntable.turntable import Turntable

FS = 20000.0
DEG = np.pi / 180.0
SENSORS = {"mhd_ars": Mounting(), "mems_gyro": Mounting(position=(0.0, 0.0, 0.05), misalignment=(0.02, -0.03))}
PLANT = TurntableParameters(rotor_com=(1e-4, 0.0, 0.05))


def sine(freq_hz, amplitude=DEG):
    return lambda t: amplitude * np.sin(2 * np.pi * freq_hz * t + 0.3)


def play(rate, holds=1, *, cuts=(0, 4000), ramp_in=0.05, parameters=PLANT):
    motion = MotionProfile([rate], ramp_in, FS)
    table = Turntable(parameters, SENSORS, holds=holds)
    parts = []
    for a, b in pairwise(cuts):
        command = motion.process(b - a)
        parts.append(table.process(command, motion.peek(table.lookahead)))
    return parts


def signals(parts):
    names = ("rate", "encoder_rate", "angle", "torque")
    joined = {name: np.concatenate([getattr(part, name) for part in parts]) for name in names}
    return joined | {name: np.concatenate([part.sensor_rate[name] for part in parts]) for name in SENSORS}


def errors(rate, holds, **options):
    base, long = signals(play(rate, **options)), signals(play(rate, holds, **options))
    scale = np.abs(base["rate"]).max()
    return {name: np.abs(base[name] - long[name]).max() / scale for name in base}


@pytest.mark.parametrize(("freq_hz", "holds"), [(0.5, 3), (10.0, 2), (10.0, 3), (50.0, 2), (100.0, 2)])
def test_truth_of_longer_steps_is_that_of_the_base_step(freq_hz, holds):
    found = errors(sine(freq_hz), holds)
    print(f"{freq_hz:g} Hz, {holds} holds: rate {found['rate']:.1e}, torque {found['torque'] * DEG:.1e} N m per deg/s")
    for name in ("rate", "encoder_rate", *SENSORS):
        assert found[name] < 1e-6
    # An angle is the integral of the rate: 1e-6 of it over a period at most.
    assert found["angle"] < 1e-6 / freq_hz
    # The rate loop turns errors of rate into torque: kv = 47 N m s/rad.
    assert found["torque"] < 50 * 1e-6


@pytest.mark.parametrize(
    "rate", [lambda t: np.full_like(t, 0.5), lambda t: 0.02 * np.cos(20.0 * np.pi * t)], ids=["constant", "cosine"]
)
def test_table_that_starts_in_motion(rate):
    assert errors(rate, 2, ramp_in=0.0)["rate"] < 1e-6


@pytest.mark.parametrize("freq_hz", [0.5, 10.0, 100.0])
def test_ideal_table_follows_the_command_with_longer_steps(freq_hz):
    ideal = TurntableParameters(mode="ideal")
    motion = MotionProfile([sine(freq_hz)], 0.05, FS)
    (truth,) = play(sine(freq_hz), 3, parameters=ideal)
    # Fifth order through six points, (w H)^6 / 720 * 3.5 = 3e-9 at 100 Hz, besides the ramp-in's jump of its third
    # derivative.
    assert np.abs(truth.rate - motion.process(4000).rate[:-1]).max() < 1e-8 * DEG


def test_plain_mean_of_the_held_references_would_be_wrong(monkeypatch):
    """Without the correction of first moments the rates are wrong by parts in 1e5, far above 1e-6."""
    monkeypatch.setattr(stepping, "lag", lambda _holds, _dt: 0.0)
    assert errors(sine(10.0), 2)["rate"] > 3e-5


def test_error_goes_with_the_fourth_power_of_the_step():
    two, four = (errors(sine(10.0), holds)["rate"] for holds in (2, 4))
    # Moments of fourth order and RK4 alike: (4^4 - 1) / (2^4 - 1) = 17.
    assert four / two == pytest.approx(17.0, rel=0.2)


@pytest.mark.parametrize("mode", ["servo", "ideal"])
@pytest.mark.parametrize("holds", [2, 3, 5])
@pytest.mark.parametrize("cuts", [(0, 1, 2, 3, 4, 900, 2000), (0, 399, 400, 401, 1201, 2000), (0, 0, 7, 7, 2000)])
def test_any_division_into_blocks_gives_the_same_bits(mode, holds, cuts):
    parameters = PLANT.model_copy(update={"mode": mode})
    whole = play(sine(10.0), holds, cuts=(0, 2000), parameters=parameters)
    parts = play(sine(10.0), holds, cuts=cuts, parameters=parameters)
    for name, value in signals(whole).items():
        np.testing.assert_array_equal(signals(parts)[name], value)
    for body, poses in whole[0].poses.items():
        for i in range(2):
            np.testing.assert_array_equal(np.concatenate([part.poses[body][i] for part in parts]), poses[i])


def test_fixed_table_needs_no_look_ahead():
    assert Turntable(TurntableParameters(mode="fixed"), {}, holds=4).lookahead == 0


def test_missing_look_ahead_is_refused():
    table = Turntable(PLANT, {}, holds=2)
    with pytest.raises(ValueError, match="ahead: expected 12 steps behind the block, got None"):
        table.process(MotionProfile([sine(1.0)], 0.0, FS).process(100))


def test_step_beyond_the_fastest_mode_is_refused():
    with pytest.raises(ScenarioError, match=r"expected every mode below 530\.5 Hz at a step of 0\.0003 s"):
        Turntable(PLANT, {}, holds=6)


def test_responses_are_those_of_the_free_rotor_on_its_platform():
    table = Turntable(TurntableParameters(), SENSORS)
    data, _ = table._at_start(MotionProfile([sine(1.0)], 0.0, FS).process(1))
    _, sensed = stepping.responses(table.model, data)
    p, torque = table.parameters, sensed[table._motor + 2]
    rotor, platform = p.spindle_inertia, p.platform_inertia[2]
    # A torque between both: the rotor turns by 1/I, the platform back by 1/Ip; second differences of 1e-6 lose 1e-8.
    gyro, encoder = table.model.sensor("rate_table_axis").adr[0] + 2, table.model.sensor("encoder_rate").adr[0]
    assert torque[gyro] == pytest.approx(1 / rotor, rel=1e-6)
    assert torque[encoder] == pytest.approx(1 / rotor + 1 / platform, rel=1e-6)
    assert not sensed[:, table.model.sensor("q_spindle").adr[0]].any()
