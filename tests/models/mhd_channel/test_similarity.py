"""The channel with its secondary flow: linear limit, refinement, spin-down, an independent integrator, its range."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from testbed.errors import RunError
from testbed.models.mhd_channel.channel import MhdChannel
from testbed.models.mhd_channel.chebyshev import clenshaw_curtis, even_operators, even_transport
from testbed.models.mhd_channel.linear_range import LARGEST_STROKE, LEAST_EKMAN, LEAST_ELSASSER, linear_range
from testbed.models.mhd_channel.similarity import SimilarityStage

NU = 1.526e-3 / 13534.0
CLOSURES = [("local", 1.0), ("radial_field", 1.0), ("radial_field", 0.0), ("axial_field", 1.0), ("axial_field", 0.0)]


def channel(closure: str = "local", load: float = 1.0, **change: Any) -> MhdChannel:
    """Return the weakly braked channel of Figure 2 of paper 1, with its secondary flow."""
    given = {"fluid": "mercury", "height": 10e-3, "field": 0.036, "nodes": 64, "flow": "similarity", **change}
    return MhdChannel(closure=closure, load_fraction=load, **given)


def sine(freq: float, rate_deg_s: float, periods: float, per_period: int) -> Any:
    return np.radians(rate_deg_s) * np.sin(2 * np.pi * np.arange(int(periods * per_period) + 1) / per_period)


def departure(it: MhdChannel, freq: float, rate_deg_s: float, *, per_period: int = 1000, periods: int = 16) -> complex:
    """Return by what the line of a sine departs from the linear channel's, over that line [-]."""
    wall = sine(freq, rate_deg_s, periods, per_period)
    flows = [
        it.model_copy(update={"flow": flow}).simulate(wall, freq * per_period) for flow in ("similarity", "linear")
    ]
    turn = np.exp(-2j * np.pi * np.arange(4 * per_period) / per_period)
    whole, linear = (np.mean(flow[-turn.size :] * turn) for flow in flows)
    return complex(whole / linear - 1.0)


# The linear limit


@pytest.mark.oracle
@pytest.mark.parametrize(("closure", "load"), CLOSURES)
@pytest.mark.parametrize("nodes", [64, 160])
def test_small_motion_is_that_of_the_linear_channel(closure: str, load: float, nodes: int) -> None:
    it = channel(closure, load, height=15e-3, field=0.448, nodes=nodes)
    # The secondary flow goes with the cube of the rate: at 1e-6 rad/s it is 1e-12 of what it is at 1 rad/s.
    wall = 1e-6 * np.random.default_rng(1).standard_normal(2000)
    linear = it.model_copy(update={"flow": "linear"}).simulate(wall, 20e3)
    np.testing.assert_allclose(it.simulate(wall, 20e3), linear, rtol=0, atol=1e-6 * np.abs(wall).max())


@pytest.mark.oracle
@pytest.mark.parametrize("freq", [0.5, 10.0, 100.0, 1000.0])
def test_small_sines_meet_the_closed_form(freq: float) -> None:
    it = channel(height=15e-3, field=0.448, nodes=160)
    # Settled by e^-15 after a second; the hold takes (w T)^2/12 of H - 1, 6e-6 of 1 at 100 Hz where H - 1 is 0.03.
    t = np.arange(20_000 + round(40_000 / max(freq, 1.0))) / 20e3
    got = it.simulate(1e-6 * np.sin(2 * np.pi * freq * t), 20e3)[20_000:] / 1e-6
    exact = np.imag(it.response(freq) * np.exp(2j * np.pi * freq * t[20_000:]))
    hold = (2 * np.pi * freq / 20e3) ** 2 / 12 * abs(it.response(freq) - 1.0)
    assert np.max(np.abs(got - exact)) < 1e-6 + 1.1 * hold


def test_departure_goes_with_the_square_of_the_rate() -> None:
    small, large = (departure(channel(), 1.0, rate) for rate in (1.0, 4.0))
    # Terms of fourth order are the square of this, 1e-12 of it.
    assert large / small == pytest.approx(16.0, rel=1e-3)


# Refinement


@pytest.mark.oracle
def test_grid_converges_faster_than_any_order() -> None:
    wall = sine(0.1, 50.0, 2, 2000)
    fine = channel(nodes=96).simulate(wall, 200.0)
    grids = np.array([24, 32, 48])
    errors = [np.max(np.abs(channel(nodes=int(n)).simulate(wall, 200.0) - fine)) for n in grids]
    orders = np.diff(np.log(errors)) / -np.diff(np.log(grids))
    assert orders.min() > 4.0
    assert errors[-1] < 1e-6


@pytest.mark.oracle
@pytest.mark.parametrize("closure", ["local", "axial_field"])
def test_step_converges_with_the_second_order(closure: str) -> None:
    steps = [500, 1000, 2000, 4000]
    ends = [channel(closure).simulate(sine(0.1, 50.0, 1.3, n), 0.1 * n)[:: n // 100] for n in steps]
    shortest = min(end.size for end in ends)
    moves = [np.max(np.abs(b[:shortest] - a[:shortest])) for a, b in pairwise(ends)]
    np.testing.assert_allclose(np.log2(np.divide(moves[:-1], moves[1:])), 2.0, atol=0.2)


# Nonlinear oracles


@pytest.mark.oracle
@pytest.mark.parametrize("nodes", [64, 96])
def test_spin_down_between_two_disks_follows_their_boedewadt_layers(nodes: int) -> None:
    """Mid-plane swirl W/(1 + 1.3494 sqrt(nu W) t/l)^2: either layer throws off 1.3494/2 sqrt(nu W) of fluid height."""
    rate, height = 100.0, 15e-3
    stage = channel(height=height, field=0.0, nodes=nodes).start(5000.0)
    stage.begin(rate)
    for second in range(1, 11):
        stage.process(np.zeros(5000))
        left = rate / (1 + 1.3494 * np.sqrt(NU * rate) * second / height) ** 2
        assert stage.profile()[nodes // 2] == pytest.approx(left, rel=0.015)


def volumes(cells: int, it: MhdChannel, wall: Any, slope: Any, end: float) -> float:
    """Return minus the mean slip at `end` by finite volumes over the half height, nothing shared with the package."""
    edges = it.height / 2 * np.linspace(0.0, 1.0, cells + 1) ** 1.5
    middle, width = (edges[1:] + edges[:-1]) / 2, np.diff(edges)
    near = np.concatenate([[-middle[0]], middle, [2 * edges[-1] - middle[-1]]])
    a, b, mean = it.braking_rate, it.radial_braking_rate, width / (it.height / 2)

    def spread(u: Any) -> tuple[Any, Any]:
        around = np.concatenate([[-u[0]], u, [u[-1]]])
        slopes = np.diff(around) / np.diff(near)
        return NU * np.diff(slopes) / width, (slopes[1:] + slopes[:-1]) / 2

    def move(t: float, state: Any) -> Any:
        s, g = state[:cells], state[cells:]
        at_edges = np.concatenate([[0.0], np.cumsum(-2.0 * g * width)])
        v = (at_edges[1:] + at_edges[:-1]) / 2
        (s_spread, s_slope), (g_spread, g_slope) = spread(s), spread(g)
        s_dot = s_spread - a * s - slope(t) - 2 * wall(t) * g - 2 * g * s - v * s_slope
        g_dot = g_spread - b * g + 2 * wall(t) * s + s * s - g * g - v * g_slope
        return np.concatenate([s_dot, g_dot - mean @ g_dot])

    solved = solve_ivp(move, (0.0, end), np.zeros(2 * cells), method="LSODA", rtol=1e-8, atol=1e-10)
    assert solved.success
    return float(-(mean @ solved.y[:cells, -1]))


@pytest.mark.oracle
@pytest.mark.parametrize("closure", ["local", "axial_field"])
def test_large_swing_agrees_with_an_independent_integrator(closure: str) -> None:
    it, freq, amplitude, end = channel(closure), 0.1, np.radians(50.0), 12.0
    turn = 2 * np.pi * freq
    coarse, middle, fine = (
        volumes(n, it, lambda t: amplitude * np.sin(turn * t), lambda t: amplitude * turn * np.cos(turn * t), end)
        for n in (24, 48, 96)
    )
    ours, linear = (
        it.model_copy(update={"flow": flow}).simulate(sine(freq, 50.0, 1.2, 8000), 800.0)[-1]
        for flow in ("similarity", "linear")
    )
    # The judge is of second order; what is extrapolated from its two finest grids is off by less than a tenth of their
    # difference, which is small against what the secondary flow does.
    judged, doubt = fine + (fine - middle) / 3, abs(fine - middle)
    assert abs(middle - coarse) > 2.5 * doubt
    assert doubt < 0.05 * abs(ours - linear)
    assert ours == pytest.approx(judged, abs=max(0.2 * doubt, 1e-6))


def test_figures_of_the_page_over_frequency_and_amplitude() -> None:
    sx300 = channel(height=15e-3, field=0.448)
    for freq in (0.1, 0.5, 2.5, 10.0):
        assert abs(departure(sx300, freq, 50.0)) < 1.25e-5
    reading = abs(channel().response(0.1))
    for rate, off, share in ((30.0, 0.47, 0.017), (50.0, 1.33, 0.029)):
        found = departure(channel(), 0.1, rate, periods=20)
        assert abs(found) * reading * rate == pytest.approx(off, abs=0.015)
        assert abs(found) == pytest.approx(share, abs=5e-4)
        # Nearly all of it is phase.
        assert abs(np.angle(1.0 + found)) > 0.95 * abs(found)


# The flow itself


@pytest.mark.parametrize(("closure", "load"), CLOSURES)
def test_no_fluid_is_gained_at_any_radius(closure: str, load: float) -> None:
    stage = channel(closure, load).start(1000.0)
    stage.process(sine(0.5, 300.0, 3.3, 2000))
    assert isinstance(stage, SimilarityStage)
    radial = stage.radial_profile()
    assert (radial[0], radial[-1]) == (0.0, 0.0)
    assert np.abs(radial).max() > 1e-2
    assert clenshaw_curtis(64) @ radial == pytest.approx(0.0, abs=1e-12 * np.abs(radial).max() * 64)


def test_a_case_that_turns_steadily_with_its_fluid_drives_nothing() -> None:
    stage = channel().start(1000.0)
    stage.begin(2.0)
    assert not stage.process(np.full(500, 2.0)).any()
    assert not stage.profile().any()


def test_a_steady_turn_changes_the_secondary_flow_and_not_the_linear_one() -> None:
    wall = sine(0.1, 30.0, 2, 2000)
    for flow, same in (("linear", True), ("similarity", False)):
        still, turning = (channel(flow=flow).start(200.0) for _ in range(2))
        turning.begin(1.0)
        moved = turning.process(1.0 + wall) - still.process(wall)
        assert (np.abs(moved).max() < 1e-12) == same


@pytest.mark.parametrize("flow", ["linear", "similarity"])
def test_turning_has_to_be_said_before_the_first_sample(flow: str) -> None:
    stage = channel(flow=flow).start(1000.0)
    stage.process(np.zeros(3))
    with pytest.raises(RuntimeError, match="turning: expected before the first sample, got it after 3"):
        stage.begin(1.0)


@pytest.mark.parametrize("cuts", [[1], [0, 0, 7], [499], list(range(1, 500))])
def test_any_division_into_blocks_gives_the_same_bits(cuts: list[int]) -> None:
    wall = 3.0 * np.random.default_rng(7).standard_normal(500)
    it = channel(nodes=160)
    whole, parts = it.start(20e3), it.start(20e3)
    expected = whole.process(wall)
    got = np.concatenate([parts.process(block) for block in np.split(wall, cuts)])
    np.testing.assert_array_equal(got, expected)
    np.testing.assert_array_equal(parts.profile(), whole.profile())


def recursion(it: MhdChannel, wall: Any, T: float) -> Any:
    """NumPy twin of the kernel, without modes: matrix functions of the operators on the grid's points."""
    half, spread = it.nodes // 2, NU / it.height**2
    second, mean = even_operators(it.nodes)
    slope, integral = even_transport(it.nodes)
    pressure = np.eye(half) - np.outer(np.ones(half), mean) / mean.sum()

    def steps(A: Any) -> list[Any]:
        block = np.zeros((3 * half, 3 * half))
        block[:half, :half], block[:half, half : 2 * half] = A * T, np.eye(half) * T
        block[half : 2 * half, 2 * half :] = np.eye(half)
        power = expm(block)
        return [power[:half, i * half : (i + 1) * half] for i in range(3)]

    def forces(rate: float, s: Any, g: Any) -> tuple[Any, Any]:
        v = integral @ (-2.0 * g)
        of_g = pressure @ (2.0 * rate * s + s * s - g * g - v * (slope @ g))
        return -2.0 * rate * g - 2.0 * g * s - v * (slope @ s), of_g

    keep, whole, growing = steps(spread * second - it.braking_rate * np.eye(half))
    radial = steps(pressure @ (spread * second) - it.radial_braking_rate * pressure)
    s, g = -np.full(half, wall[0]), np.zeros(half)
    now = before = forces(wall[0], s, g)
    out = [-mean @ s]
    for rate, increment in zip(wall[1:], np.diff(wall), strict=True):
        s = keep @ s + whole @ (now[0] - increment / T) + growing @ (now[0] - before[0])
        g = radial[0] @ g + radial[1] @ now[1] + radial[2] @ (now[1] - before[1])
        now, before = forces(rate, s, g), now
        out.append(-mean @ s)
    return np.array(out)


@pytest.mark.parametrize("closure", ["local", "axial_field"])
def test_kernel_equals_its_numpy_twin(closure: str) -> None:
    it = channel(closure, nodes=16)
    wall = 1.0 + 3.0 * np.sin(np.arange(400) / 40.0)
    # Roundings of 400 steps, and of an expm of norm 10 in the twin.
    np.testing.assert_allclose(it.simulate(wall, 100.0), recursion(it, wall, 0.01), rtol=0, atol=1e-9)


def test_a_flow_that_outruns_the_steps_is_refused_by_name() -> None:
    with pytest.raises(RunError, match="flow: expected a secondary flow that the steps of the samples can follow"):
        channel().simulate(1e3 * np.sin(np.arange(3000.0)), 10.0)


# Where the linear channel holds


@pytest.mark.oracle
@pytest.mark.parametrize(("closure", "load"), CLOSURES)
@pytest.mark.parametrize(("height", "field"), [(15e-3, 0.448), (10e-3, 0.036), (4e-3, 0.1), (4e-3, 0.9), (1e-3, 0.1)])
def test_within_its_range_the_linear_channel_is_right_to_a_thousandth(
    closure: str, load: float, height: float, field: float
) -> None:
    it = channel(closure, load, height=height, field=field)
    within = 0
    for freq in (0.03, 0.3, 3.0):
        for rate in (1.0, 10.0, 60.0):
            if linear_range(it, np.radians(rate), np.radians(rate) / (2 * np.pi * freq)).holds:
                within += 1
                assert abs(departure(it, freq, rate, per_period=500, periods=12)) < 1e-3
    assert within


def test_the_range_is_left_where_the_weak_channel_errs() -> None:
    for rate in (30.0, 50.0):
        numbers = linear_range(channel(), np.radians(rate), np.radians(rate) / (0.2 * np.pi))
        assert not numbers.holds
        assert (numbers.stroke, numbers.elsasser, numbers.ekman) == pytest.approx(
            (
                np.radians(rate) / (0.2 * np.pi),
                1.04e6 * 0.036**2 / 13534.0 / np.radians(rate),
                NU / 1e-4 / np.radians(rate),
            )
        )


def test_any_of_the_three_numbers_is_enough() -> None:
    numbers = linear_range(channel(), 1.0, 1.0)._replace(stroke=1.0, elsasser=1.0, ekman=0.1)
    assert not numbers.holds
    for change in ({"stroke": LARGEST_STROKE}, {"elsasser": LEAST_ELSASSER}, {"ekman": LEAST_EKMAN}):
        assert numbers._replace(**change).holds


def test_rest_is_within_the_range() -> None:
    assert linear_range(channel(), 0.0, 0.0).holds


def test_the_reynolds_number_of_the_page() -> None:
    """Slip times thickness of the layer over nu, at 15 mm: about 19 without braking, 1.2 with that of sx300."""
    turn, radius = 2j * np.pi * 0.5, 15e-3
    for a, slip, expected in ((0.0, 1.0, 18.7), (1.04e6 * 0.448**2 / 13534.0, None, 1.17)):
        layer = 1.0 / np.real(np.sqrt((turn + a) / NU))
        moved = slip or abs(channel(height=15e-3, field=0.448).response(0.5))
        assert np.radians(30.0) * radius * moved * layer / NU == pytest.approx(expected, rel=0.03)
