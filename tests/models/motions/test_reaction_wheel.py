"""The reaction wheel against a closed form, a rotating clock and an integrated structure."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp

from testbed.models.motions.reaction_wheel import ReactionWheel, StructuralMode, WheelHarmonic

SPEED = 2 * np.pi * 40.0
T = np.linspace(0.0, 2.0, 4001)


def rate_of(motion, duration=2.0, seed=1):
    return motion.start(duration, np.random.default_rng(seed))


def wheel(**changes):
    values = {"speed": SPEED, "harmonics": (WheelHarmonic(number=1, coefficient=1e-6, phase=0.4),), "inertia": 20.0}
    return ReactionWheel(**(values | changes))


@pytest.mark.oracle
def test_rate_of_a_rigid_platform_is_the_integral_of_torque_over_inertia():
    harmonics = (
        WheelHarmonic(number=1, coefficient=1e-6, phase=0.4),
        WheelHarmonic(number=2.5, coefficient=3e-7, phase=-1.0),
    )
    expected = sum(
        -h.coefficient * SPEED / (20.0 * h.number) * np.cos(h.number * SPEED * T + h.phase) for h in harmonics
    )
    # Roundings of a phase of 1300 rad.
    assert_allclose(rate_of(wheel(harmonics=harmonics))(T), expected, rtol=0, atol=1e-12 * np.abs(expected).max())


@pytest.mark.oracle
@pytest.mark.parametrize("freq_hz", [36.0, 40.0, 47.0])
def test_steady_line_is_that_of_an_integrated_flexible_structure(freq_hz):
    """Rigid body and one mode as equations of motion: I w' = T, q'' + 2 z W q' + W^2 q = T; rate = w + (g / I) q'."""
    mode = StructuralMode(frequency=freq_hz, damping=0.05, gain=0.5)
    motion, W = wheel(modes=(mode,)), 2 * np.pi * freq_hz

    def slope(t, x):
        torque = 1e-6 * SPEED**2 * np.sin(SPEED * t + 0.4)
        return [torque / 20.0, x[2], torque - 2 * 0.05 * W * x[2] - W**2 * x[1]]

    # After 2 s the start has decayed by exp(-0.05 W 2) < 2e-10.
    t = 2.0 + np.arange(400) / 400 / 40.0 * 4
    x = solve_ivp(slope, (0.0, t[-1]), [0.0, 0.0, 0.0], t_eval=t, rtol=1e-9, atol=1e-14).y
    rate = x[0] + 0.5 / 20.0 * x[2]
    got = rate_of(motion)(t)
    # The rigid body keeps the constant rate that the switched-on torque gave it: four whole periods have mean zero.
    assert_allclose(rate - rate.mean(), got - got.mean(), rtol=0, atol=1e-6 * np.abs(got).max())


def test_amplification_at_resonance_is_the_gain_over_twice_the_damping():
    mode = StructuralMode(frequency=80.0, damping=0.01, gain=0.5)
    # 1 + g s^2 / (2 z W s) = 1 + j g / (2 z)
    assert_allclose(wheel(modes=(mode,)).amplification(np.array([80.0])), 1 + 25j, rtol=1e-12)
    assert_allclose(wheel(modes=(mode,)).amplification(np.array([1e-3, 1e7])), [1.0, 1.5], rtol=1e-6)


@pytest.mark.parametrize("stop", [2 * np.pi * 20.0, 2 * np.pi * 90.0])
def test_ramp_has_the_stated_instantaneous_phase_and_amplitude(stop):
    motion = wheel(stop_speed=stop, ramp_time=1.2)
    t = np.linspace(0.0, 2.0, 20_001)
    # Speed linear from start to stop over 1.2 s, then constant: angle by the trapezoid of the piecewise linear speed,
    # exact where a knot is a sample.
    speed = np.interp(t, [0.0, 1.2], [SPEED, stop])
    angle = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(t))])
    expected = -1e-6 * speed / 20.0 * np.cos(angle + 0.4)
    assert_allclose(rate_of(motion)(t), expected, rtol=0, atol=1e-9 * np.abs(expected).max())


def test_ramp_passes_each_mode_at_its_frequency():
    mode = StructuralMode(frequency=60.0, damping=0.01, gain=0.5)
    motion = wheel(stop_speed=2 * np.pi * 80.0, modes=(mode,))
    t = np.linspace(0.0, 10.0, 200_001)
    rate = np.abs(rate_of(motion, duration=10.0)(t))
    # 40 Hz to 80 Hz in the whole run: 60 Hz at 5 s; a width of 2 z f = 1.2 Hz is 0.3 s, a period 17 ms.
    assert t[np.argmax(rate)] == pytest.approx(5.0, abs=0.05)
    assert rate.max() == pytest.approx(1e-6 * 2 * np.pi * 60.0 / 20.0 * abs(1 + 25j), rel=0.01)


def test_lines_are_the_harmonics_at_constant_speed_and_none_in_a_ramp():
    harmonics = tuple(WheelHarmonic(number=h, coefficient=1e-7) for h in (1.0, 2.0, 5.2))
    assert_allclose(wheel(harmonics=harmonics).lines(), [40.0, 80.0, 208.0], rtol=1e-15)
    assert wheel(harmonics=harmonics).top_frequency() == pytest.approx(208.0, rel=1e-15)
    ramp = wheel(harmonics=harmonics, stop_speed=2 * np.pi * 50.0)
    assert ramp.lines() == ()
    assert ramp.top_frequency() == pytest.approx(260.0, rel=1e-15)


def test_phases_that_are_not_given_come_from_the_seed_and_given_ones_do_not():
    free = (WheelHarmonic(number=1, coefficient=1e-6), WheelHarmonic(number=2, coefficient=1e-6))
    motion = wheel(harmonics=free)
    assert np.array_equal(rate_of(motion, seed=1)(T), rate_of(motion, seed=1)(T))
    assert not np.array_equal(rate_of(motion, seed=1)(T), rate_of(motion, seed=2)(T))
    assert np.array_equal(rate_of(wheel(), seed=1)(T), rate_of(wheel(), seed=2)(T))
    # Giving one phase leaves the other as it was.
    first = wheel(harmonics=(free[0].model_copy(update={"phase": 0.3}), free[1]))
    second = wheel(harmonics=(free[1],))
    drawn = np.random.default_rng(1).uniform(0.0, 2 * np.pi, 2)[1]
    given = wheel(harmonics=(free[1].model_copy(update={"phase": float(drawn)}),))
    alone = wheel(harmonics=(free[0].model_copy(update={"phase": 0.3}),))
    assert_allclose(rate_of(first)(T), rate_of(alone)(T) + rate_of(given)(T), rtol=0, atol=1e-18)
    assert second.lines() == (80.0,)


@pytest.mark.parametrize(
    ("part", "key", "value"),
    [
        ("harmonics", "number", 1.5),
        ("harmonics", "coefficient", 2e-6),
        ("harmonics", "phase", 0.5),
        ("modes", "frequency", 41.0),
        ("modes", "damping", 0.02),
        ("modes", "gain", 0.6),
    ],
)
def test_every_number_of_a_harmonic_and_a_mode_changes_the_motion(part, key, value):
    base = wheel(modes=(StructuralMode(frequency=42.0, damping=0.01, gain=0.5),))
    changed = base.model_copy(update={part: (getattr(base, part)[0].model_copy(update={key: value}),)})
    assert not np.array_equal(rate_of(base)(T), rate_of(changed)(T))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"harmonics": (WheelHarmonic(number=1, coefficient=1e-6),) * 2}, "all different numbers"),
        ({"stop_speed": SPEED}, "differs from speed"),
        ({"ramp_time": 1.0}, "no ramp_time without it"),
        ({"speed": 0.0}, "more than 0"),
        ({"harmonics": ()}, "at least 1 item"),
        ({"inertia": np.nan}, "got nan"),
    ],
)
def test_wheel_refuses_what_makes_no_sense(changes, message):
    with pytest.raises(ValueError, match=message):
        wheel(**changes)
