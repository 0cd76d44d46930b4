"""The MHD channel against closed forms, a mode sum, an independent integrator of the PDE, and its own invariants."""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from testbed.models.mhd_channel import modes as modes_module
from testbed.models.mhd_channel.channel import MhdChannel, one_mode_response
from testbed.models.mhd_channel.chebyshev import clenshaw_curtis, even_operators
from testbed.models.mhd_channel.fluids import FLUIDS, Fluid
from testbed.models.mhd_channel.thermal_drift import REFERENCE

if TYPE_CHECKING:
    from collections.abc import Callable

    from testbed.signals import FloatArray

MERCURY = Fluid(density=13534.0, viscosity=1.526e-3, conductivity=1.04e6)
NU = 1.526e-3 / 13534.0
FS = 20000.0
EPS = np.finfo(float).eps
BELOW_1_KHZ = np.logspace(-3, 3, 181)
CLOSURES = [
    ("local", 1.0),
    ("radial_field", 1.0),
    ("radial_field", 0.3),
    ("radial_field", 0.0),
    ("axial_field", 1.0),
    ("axial_field", 0.5),
    ("axial_field", 0.0),
]


def channel(
    closure: str = "local", load: float = 1.0, *, height: float = 15e-3, field: float = 0.448, nodes: int = 160
) -> MhdChannel:
    return MhdChannel(fluid=MERCURY, height=height, field=field, closure=closure, load_fraction=load, nodes=nodes)


def textbook_response(closure: str, beta: float, *, height: float, field: float, freq: FloatArray) -> Any:
    """Return the three closed forms as they are derived on paper, each on its own."""
    return textbook_transform(closure, beta, height=height, field=field, s=2j * np.pi * freq)


def textbook_transform(closure: str, beta: float, *, height: float, field: float, s: Any) -> Any:
    """Return them anywhere in the plane of s."""
    a = 1.04e6 * field**2 / 13534.0

    def F(rate: Any) -> Any:
        z = height / 2 * np.sqrt(rate / NU)
        return 1 - np.tanh(z) / z

    if closure == "local":
        return s / (s + a) * F(s + a)
    if closure == "radial_field":
        return s * F(s) / (s + beta * a * F(s))
    return s * F(s + a) / (s + a - a * (1 - beta) * F(s + a))


@pytest.mark.oracle
@pytest.mark.parametrize(("closure", "load"), CLOSURES)
@pytest.mark.parametrize(("height", "field"), [(15e-3, 0.448), (4e-3, 0.45), (10e-3, 0.036)])
def test_response_is_the_textbook_form(closure: str, load: float, height: float, field: float) -> None:
    expected = textbook_response(closure, load, height=height, field=field, freq=BELOW_1_KHZ)
    # The textbook form cancels where s or 1 - F is small: by up to 1e5 at 1 mHz.
    np.testing.assert_allclose(
        channel(closure, load, height=height, field=field).response(BELOW_1_KHZ), expected, rtol=1e-10
    )


@pytest.mark.oracle
@pytest.mark.parametrize(("height", "field"), [(15e-3, 0.448), (4e-3, 0.45), (10e-3, 0.036), (5e-3, 0.0)])
def test_local_response_is_the_sum_of_its_odd_modes(height: float, field: float) -> None:
    a = 1.04e6 * field**2 / 13534.0
    n2 = (np.pi * np.arange(1, 200001, 2)) ** 2
    s = 2j * np.pi * np.logspace(-2, 3, 11)[:, None]
    total = np.sum(8 / n2 * s / (s + a + n2 * NU / height**2), axis=1)
    # The tail beyond n = 2e5 is (4/3 pi^4) w l^2 / (nu n^3): 2e-11 at 1 kHz and 15 mm.
    np.testing.assert_allclose(channel(height=height, field=field).response(np.logspace(-2, 3, 11)), total, rtol=1e-9)


@pytest.mark.oracle
@pytest.mark.parametrize(("closure", "load"), CLOSURES)
@pytest.mark.parametrize(
    ("height", "field", "bound"), [(15e-3, 0.448, 1e-6), (15e-3, 5.0, 1e-6), (4e-3, 0.45, 1e-11), (10e-3, 0.036, 1e-7)]
)
def test_grid_meets_the_closed_form_below_1_khz(
    closure: str, load: float, height: float, field: float, bound: float
) -> None:
    # 1e-6 is promised for 15 mm; the thinner channels have proportionally better resolved layers.
    it = channel(closure, load, height=height, field=field)
    assert np.max(np.abs(it.discrete_response(BELOW_1_KHZ) - it.response(BELOW_1_KHZ))) < bound


@pytest.mark.oracle
@pytest.mark.parametrize(("closure", "load"), CLOSURES)
def test_grid_converges_faster_than_any_order(closure: str, load: float) -> None:
    grids = np.array([64, 96, 128])
    errors = []
    for nodes in grids:
        it = channel(closure, load, height=4e-3, field=0.45, nodes=int(nodes))
        errors.append(np.max(np.abs(it.discrete_response(BELOW_1_KHZ) - it.response(BELOW_1_KHZ))))
    orders = np.diff(np.log(errors)) / -np.diff(np.log(grids))
    assert orders[0] > 10.0
    assert orders[1] > orders[0]


@pytest.mark.oracle
@pytest.mark.parametrize(("closure", "load"), CLOSURES)
def test_rounding_stays_small_on_the_finest_grid(closure: str, load: float) -> None:
    it = channel(closure, load, height=4e-3, field=0.45, nodes=512)
    # The slowest mode is known to eps times the ratio of the extreme eigenvalues, 0.2 n^4/pi^2, at worst: 3e-7.
    assert np.max(np.abs(it.discrete_response(BELOW_1_KHZ) - it.response(BELOW_1_KHZ))) < 1e-10


@pytest.mark.oracle
def test_grid_response_far_up_tends_to_the_mean_without_the_walls() -> None:
    assert channel(nodes=64).discrete_response(1e12) == pytest.approx(1 - 1 / (64**2 - 1), abs=1e-9)


@pytest.mark.oracle
@pytest.mark.parametrize("height", [4e-3, 15e-3])
def test_opening_an_axial_circuit_lowers_the_corner_by_the_hartmann_number(height: float) -> None:
    closed, opened = (channel("axial_field", load, height=height, field=0.45) for load in (1.0, 0.0))
    # Open: F = 1 - 1/Ha at low frequency, so H = s/(s + a/Ha); terms of relative size 1/Ha are left out.
    ratio = closed.corner_freq_hz / opened.corner_freq_hz
    assert ratio == pytest.approx(closed.hartmann_number, rel=1 / closed.hartmann_number)


@pytest.mark.oracle
def test_corner_without_braking_is_a_multiple_of_the_viscous_rate() -> None:
    scaled = [
        channel("radial_field", 0.0, height=height, field=field).corner_freq_hz * height**2 / NU
        for height, field in [(4e-3, 0.45), (15e-3, 0.45), (1e-6, 0.0)]
    ]
    np.testing.assert_allclose(scaled, scaled[0], rtol=1e-10)
    # |F| = 1/sqrt(2), found by stepping the textbook form.
    freq = np.linspace(0.5, 5.0, 90001)
    gain = np.abs(textbook_response("local", 1.0, height=1.0, field=0.0, freq=freq * NU))
    assert scaled[0] == pytest.approx(freq[np.argmax(gain > np.sqrt(0.5))], abs=5e-5)


@pytest.mark.oracle
@pytest.mark.parametrize(("height", "field"), [(15e-3, 0.448), (4e-3, 0.45)])
def test_corner_of_a_strong_local_field_is_the_braking_rate(height: float, field: float) -> None:
    it = channel(height=height, field=field)
    # The Stokes layer takes (2/l) sqrt(nu/w) off the gain: 5 % at 4 mm and 2.5 Hz, twice that in frequency.
    assert it.corner_freq_hz == pytest.approx(it.braking_rate / (2 * np.pi), rel=0.1)
    assert abs(it.response(it.corner_freq_hz)) == pytest.approx(np.sqrt(0.5), abs=1e-11)


@pytest.mark.oracle
@pytest.mark.parametrize(("closure", "load"), CLOSURES)
def test_corner_is_the_only_half_power_point(closure: str, load: float) -> None:
    it = channel(closure, load)
    gain = np.abs(it.response(it.corner_freq_hz * np.logspace(-4, 4, 801)))
    assert np.all((gain > np.sqrt(0.5) + 1e-9) == (np.arange(801) > 400))


@pytest.mark.oracle
@pytest.mark.parametrize("freq", [10.0, 100.0, 1000.0])
def test_stokes_layer_tail(freq: float) -> None:
    tail = 1 - 2 / 5e-3 * np.sqrt(NU / (2 * np.pi * freq)) * np.exp(-0.25j * np.pi)
    # Without a field the tail is F for tanh = 1; at 10 Hz Re z = 41, so what is neglected is e^-80.
    assert channel(height=5e-3, field=0.0).response(freq) == pytest.approx(tail, abs=1e-14)
    braked = channel(height=5e-3, field=0.448).response(freq)
    assert abs(braked - tail) < 1.04e6 * 0.448**2 / 13534.0 / (2 * np.pi * freq)


@pytest.mark.oracle
def test_equation_39_follows_from_the_physics() -> None:
    freq = np.logspace(-1, 3, 401)
    s = 2j * np.pi * freq
    eq39 = 2200 * s / (0.255 * s**2 + 2178 * s + 33900)
    ratio = 1.0143 * channel().response(freq) / (1 + 1j * freq / 1352.0) / eq39
    # Fitted: 0.22 % and 0.08 deg; field, pole and gain are rounded to three to five digits here (0.1 deg per 0.5 mT).
    assert np.max(np.abs(np.abs(ratio) - 1)) < 0.0025
    assert np.max(np.abs(np.angle(ratio, deg=True))) < 0.15


@pytest.mark.oracle
@pytest.mark.parametrize(("height", "field", "worst"), [(10e-3, 0.036, 0.09), (4e-3, 0.45, 0.025)])
def test_one_mode_form_is_off_by_what_its_docstring_says(height: float, field: float, worst: float) -> None:
    it = channel(height=height, field=field)
    error = np.abs(one_mode_response(it, BELOW_1_KHZ) - it.response(BELOW_1_KHZ))
    assert np.max(error) == pytest.approx(worst, rel=0.03)


def test_one_mode_form_has_its_corner_where_the_paper_puts_it() -> None:
    it = channel(height=10e-3, field=0.036)
    rate = np.pi**2 * NU / 10e-3**2 + 1.04e6 * 0.036**2 / 13534.0
    assert rate == pytest.approx(0.1, rel=0.15)  # "a about 0.1 1/s" of Figure 2
    assert one_mode_response(it, rate / (2 * np.pi)) == pytest.approx((1 + 1j) / 2, abs=4 * EPS)


def test_axial_field_in_short_circuit_is_local() -> None:
    local, axial = channel("local"), channel("axial_field", 1.0)
    np.testing.assert_array_equal(axial.response(BELOW_1_KHZ), local.response(BELOW_1_KHZ))
    np.testing.assert_array_equal(axial.discrete_response(BELOW_1_KHZ), local.discrete_response(BELOW_1_KHZ))


def test_radial_field_with_open_circuit_is_the_channel_without_field() -> None:
    opened, free = channel("radial_field", 0.0), channel(field=0.0)
    np.testing.assert_array_equal(opened.response(BELOW_1_KHZ), free.response(BELOW_1_KHZ))


@pytest.mark.oracle
@pytest.mark.parametrize("freq", [0.0, 1e-12, 1e-6, 1e-4, 1e-3])
def test_response_near_zero_frequency_has_no_cancellation(freq: float) -> None:
    it = channel(height=4e-3, field=0.0)
    # F = z^2/3 - 2 z^4/15 + ...: coefficients of tanh from tanh' = 1 - tanh^2, in exact fractions.
    tanh = [Fraction(1)]
    for n in range(1, 40):
        tanh.append(-sum((tanh[i] * tanh[n - 1 - i] for i in range(n)), Fraction(0)) / (2 * n + 1))
    z2 = (2e-3) ** 2 / NU * 2j * np.pi * freq
    assert abs(z2) < 0.3
    expected = -sum(float(c) * z2 ** (n + 1) for n, c in enumerate(tanh[1:]))
    assert it.response(freq) == pytest.approx(expected, rel=8 * EPS, abs=0.0)


@pytest.mark.parametrize(("closure", "load"), CLOSURES)
@pytest.mark.parametrize("field", [0.0, 0.448, 30.0])
def test_response_is_finite_everywhere_and_zero_at_dc(closure: str, load: float, field: float) -> None:
    it = channel(closure, load, height=1.0, field=field)
    with np.errstate(all="raise", under="ignore"):
        gain = np.abs(it.response(np.concatenate([[0.0], np.logspace(-30, 15, 451)])))
    assert gain[0] == 0.0
    assert np.all(np.isfinite(gain))
    assert np.all(np.diff(gain) > -8 * EPS)
    assert gain[-1] == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize(("closure", "load"), CLOSURES)
def test_response_of_a_negative_frequency_is_the_conjugate(closure: str, load: float) -> None:
    it = channel(closure, load)
    np.testing.assert_array_equal(it.response(-BELOW_1_KHZ), np.conj(it.response(BELOW_1_KHZ)))


# In time


def finite_volumes(
    cells: int, *, height: float, delta: float, kappa: float, acceleration: Callable[[float], float], t: FloatArray
) -> FloatArray:
    """Return minus the mean slip by finite volumes (second order) and Radau: nothing is shared with the package."""
    edges = height / 2 * np.linspace(0.0, 1.0, cells + 1) ** 2
    centres, widths = (edges[1:] + edges[:-1]) / 2, np.diff(edges)
    A = np.zeros((cells, cells))
    for i in range(cells):
        below = NU / ((centres[i] - centres[i - 1]) if i else centres[0]) / widths[i]
        A[i, i] -= below
        if i:
            A[i, i - 1] += below
            A[i - 1, i] += below * widths[i] / widths[i - 1]
            A[i - 1, i - 1] -= below * widths[i] / widths[i - 1]
    mean = widths / (height / 2)
    A -= delta * np.eye(cells) + kappa * np.outer(np.ones(cells), mean)
    solution = solve_ivp(
        lambda time, u: A @ u - acceleration(time),
        (0.0, t[-1]),
        np.zeros(cells),
        method="Radau",
        t_eval=t,
        jac=A,
        rtol=1e-8,
        atol=1e-10,
        max_step=2e-3,
    )
    assert solution.success
    return -(mean @ solution.y)


# delta and kappa over a, written out from the three equations of motion.
BRAKING = {
    ("local", 1.0): (1.0, 0.0),
    ("radial_field", 1.0): (0.0, 1.0),
    ("radial_field", 0.3): (0.0, 0.3),
    ("radial_field", 0.0): (0.0, 0.0),
    ("axial_field", 1.0): (1.0, 0.0),
    ("axial_field", 0.5): (1.0, -0.5),
    ("axial_field", 0.0): (1.0, -1.0),
}


@pytest.mark.oracle
@pytest.mark.parametrize(("closure", "load"), CLOSURES)
def test_simulation_agrees_with_an_independent_integrator(closure: str, load: float) -> None:
    height, width, centre = 4e-3, 0.01, 0.05
    a = 1.04e6 * 0.45**2 / 13534.0
    t = np.arange(0, 3001, 20) / FS

    def pulse(time: Any) -> Any:
        return np.exp(-(((time - centre) / width) ** 2))

    def slope(time: float) -> float:
        return float(-2 * (time - centre) / width**2 * pulse(time))

    delta, kappa = (a * factor for factor in BRAKING[closure, load])
    coarse, middle, fine = (
        finite_volumes(n, height=height, delta=delta, kappa=kappa, acceleration=slope, t=t) for n in (20, 40, 80)
    )
    ours = channel(closure, load, height=height, field=0.45).simulate(pulse(np.arange(3001) / FS), FS)[::20]
    step = np.max(np.abs(fine - middle))
    # The judge converges with the order of its scheme, two, so the fine grid is off by a third of the step and what is
    # extrapolated from it by one order more; our hold adds (T/width)^2/6 = 4e-6.
    assert np.log2(np.max(np.abs(middle - coarse)) / step) == pytest.approx(2.0, abs=0.2)
    assert step < 2e-4
    assert np.max(np.abs(ours - (fine + (fine - middle) / 3))) < step / 20 + 4e-6


def inverse_laplace(transform: Callable[[Any], Any], t: FloatArray) -> FloatArray:
    """Invert a Laplace transform by the fixed Talbot contour (Abate and Valko 2004), to about 1e-10 of its size."""
    m = 32
    angle = np.arange(1, m) * np.pi / m
    cot = 1 / np.tan(angle)
    contour = angle * (cot + 1j)
    weight = 1 + 1j * angle * (1 + cot**2) - 1j * cot
    radius = 2 * m / (5 * t[:, None])
    bend = np.real(np.exp(radius * t[:, None] * contour) * transform(radius * contour) * weight).sum(axis=1)
    tip = 0.5 * np.exp(radius[:, 0] * t) * np.real(transform(radius + 0j)[:, 0])
    inverse: FloatArray = radius[:, 0] / m * (tip + bend)
    return inverse


def step_error(closure: str, load: float, *, nodes: int, height: float, field: float) -> float:
    """Return the largest distance of the step response from the inverted closed form, 1 ms to 1 s after the jump."""
    k = np.unique(np.rint(np.geomspace(20, 20000, 60)).astype(int))
    exact = inverse_laplace(lambda s: textbook_transform(closure, load, height=height, field=field, s=s) / s, k / FS)
    ours = channel(closure, load, nodes=nodes, height=height, field=field).simulate(np.ones(20001), FS)
    return float(np.max(np.abs(ours[k] - exact)))


@pytest.mark.oracle
@pytest.mark.parametrize(("closure", "load"), CLOSURES)
@pytest.mark.parametrize(("height", "field", "bound"), [(15e-3, 0.448, 1e-6), (4e-3, 0.45, 2e-9), (10e-3, 0.036, 1e-7)])
def test_step_response_is_the_closed_form_in_time(
    closure: str, load: float, height: float, field: float, bound: float
) -> None:
    # Bounds of the grid as in frequency; at 4 mm what is left is the contour's rounding, eps e^(2m/5) = 8e-11.
    assert step_error(closure, load, nodes=160, height=height, field=field) < bound


@pytest.mark.oracle
@pytest.mark.parametrize(("closure", "load"), CLOSURES)
def test_step_response_converges_faster_than_any_order(closure: str, load: float) -> None:
    grids = np.array([48, 64, 96])
    errors = [step_error(closure, load, nodes=int(n), height=4e-3, field=0.45) for n in grids]
    orders = np.diff(np.log(errors)) / -np.diff(np.log(grids))
    # Spectral: a method of fixed order p would give p twice, and none in use has 8.
    assert orders[0] > 8.0
    assert orders[1] > orders[0]


@pytest.mark.oracle
@pytest.mark.parametrize(("closure", "load"), CLOSURES)
def test_hold_is_of_second_order_in_the_sample_period(closure: str, load: float) -> None:
    it, freq = channel(closure, load, height=1e-3), 20.0
    rates, errors = np.array([500.0, 1000.0, 2000.0]), []
    for rate in rates:
        t = np.arange(int(16 * rate)) / rate  # the slowest mode, 1.1 1/s, is down to e^-17
        settled = it.simulate(np.sin(2 * np.pi * freq * t), rate)[-int(rate) // 10 :]
        exact = np.imag(it.response(freq) * np.exp(2j * np.pi * freq * t[-settled.size :]))
        errors.append(np.max(np.abs(settled - exact)))
    # (w T)^2/12 of what the hold acts on; the next term, (w T)^4, is 6 % of it at 500 Hz, the Stokes layer's root less.
    np.testing.assert_allclose(-np.diff(np.log2(errors)), 2.0, atol=0.1)


@pytest.mark.oracle
@pytest.mark.parametrize("height", [4e-3, 15e-3])
def test_step_response_is_the_sum_of_decaying_modes(height: float) -> None:
    k = np.concatenate([np.arange(1, 40), np.arange(40, 20000, 400)])
    t = k / FS
    n2 = (np.pi * np.arange(1, 60001, 2)) ** 2
    a = 1.04e6 * 0.448**2 / 13534.0
    expected = np.array([np.sum(8 / n2 * np.exp(-(a + n2 * NU / height**2) * time)) for time in t])
    got = channel(height=height).simulate(np.ones(20000), FS)
    deficit = 1 / (160**2 - 1)
    # At the jump the grid's mean lacks its two wall weights; the lack diffuses away within the first cell's time.
    assert got[0] == pytest.approx(1 - deficit, abs=1e-12)
    error = np.abs(got[k] - expected)
    assert np.max(error) < deficit
    # From 1 ms on the content is below 1 kHz, where the grid is good to 1e-6.
    assert np.max(error[t >= 1e-3]) < 1e-6


@pytest.mark.oracle
@pytest.mark.parametrize(("freq", "bound"), [(10.0, 1e-6), (1000.0, 1e-4)])
@pytest.mark.parametrize(
    ("closure", "load", "height"), [("local", 1.0, 15e-3), ("axial_field", 0.3, 4e-3), ("radial_field", 1.0, 4e-3)]
)
def test_sine_settles_to_the_closed_form(freq: float, bound: float, closure: str, load: float, height: float) -> None:
    it = channel(closure, load, height=height)
    t = np.arange(int(40 * FS)) / FS
    tail = slice(-4000, None)  # the slowest mode, 0.57 1/s, is down by e^-22 then
    got = it.simulate(np.sin(2 * np.pi * freq * t), FS)[tail]
    expected = np.imag(it.response(freq) * np.exp(2j * np.pi * freq * t[tail]))
    # The hold takes (pi f T)^2/3 off the line; it acts on H - 1 only, as the held samples themselves are exact.
    assert np.max(np.abs(got - expected)) < bound


@pytest.mark.oracle
def test_profile_settles_to_the_exact_one() -> None:
    it, freq = channel(height=4e-3, field=0.45), 10.0
    t = np.arange(int(3 * FS)) / FS
    stage = it.start(FS)
    stage.process(np.sin(2 * np.pi * freq * t))
    s = 2j * np.pi * freq
    a = it.braking_rate
    k = np.sqrt((s + a) / NU)
    shape = -s / (s + a) * (1 - np.cosh(k * (it.heights - 2e-3)) / np.cosh(k * 2e-3))
    expected = np.imag(shape * np.exp(2j * np.pi * freq * t[-1]))
    # (2 pi f T)^2/12 of the hold.
    np.testing.assert_allclose(stage.profile(), expected, rtol=0, atol=1e-6)


@pytest.mark.parametrize(("closure", "load"), CLOSURES)
def test_profile_is_zero_at_the_walls_even_and_has_the_output_as_its_mean(closure: str, load: float) -> None:
    it = channel(closure, load, nodes=64)
    stage = it.start(FS)
    out = stage.process(np.random.default_rng(3).standard_normal(500))
    u = stage.profile()
    assert u.shape == it.heights.shape == (65,)
    assert (it.heights[0], it.heights[-1]) == (0.0, 15e-3)
    assert (u[0], u[-1]) == (0.0, 0.0)
    np.testing.assert_array_equal(u, u[::-1])
    assert clenshaw_curtis(64) @ u == pytest.approx(-out[-1], abs=1e-12)


def test_at_rest_the_profile_is_zero_and_after_a_jump_flat() -> None:
    stage = channel(nodes=16).start(FS)
    assert not stage.profile().any()
    stage.process(np.array([2.5]))
    np.testing.assert_allclose(stage.profile()[1:-1], -2.5, rtol=1e-12)


@pytest.mark.parametrize(("closure", "load"), CLOSURES)
def test_constant_rate_is_blocked(closure: str, load: float) -> None:
    it = channel(closure, load, height=4e-3)
    out = it.simulate(np.full(200000, 3.0), FS)
    slowest = {"local": 15.0}.get(closure, NU * np.pi**2 / 4e-3**2)
    assert abs(out[-1]) <= 3.0 * np.exp(-slowest * (out.size - 1) / FS)
    # Every gain is positive, so a jump can only decay.
    assert np.all(np.diff(out) <= 0.0)


def recursion(it: MhdChannel, wall: FloatArray) -> FloatArray:
    """NumPy twin of the kernel, from the modes."""
    modes = it._modes()
    E = np.exp(-modes.decay / FS)
    beta = (1 - E) / (modes.decay / FS)
    z = np.full(E.size, wall[0])
    out = [modes.gain @ z]
    for increment in np.diff(wall):
        z = E * z + beta * increment
        out.append(modes.gain @ z)
    return np.array(out)


@pytest.mark.parametrize(("closure", "load"), CLOSURES)
def test_kernel_equals_its_numpy_twin(closure: str, load: float) -> None:
    wall = np.random.default_rng(5).standard_normal(2000)
    it = channel(closure, load, height=4e-3)
    # 80 terms summed in another order; 1 - E loses eps/(decay T) of the slowest mode, whose increments do not build up.
    np.testing.assert_allclose(it.simulate(wall, FS), recursion(it, wall), rtol=0, atol=1e-10)


@pytest.mark.parametrize("nodes", [160, 90, 8])
@pytest.mark.parametrize("cuts", [[1], [1, 2, 3], [0, 0, 7], [499], [100, 101, 333], list(range(1, 500))])
def test_any_division_into_blocks_gives_the_same_bits(nodes: int, cuts: list[int]) -> None:
    wall = np.random.default_rng(7).standard_normal(500)
    it = channel(nodes=nodes)
    whole, parts = it.start(FS), it.start(FS)
    expected = whole.process(wall)
    got = np.concatenate([parts.process(block) for block in np.split(wall, cuts)])
    np.testing.assert_array_equal(got, expected)
    np.testing.assert_array_equal(parts.profile(), whole.profile())


@pytest.mark.property
@settings(deadline=None, max_examples=25)
@given(
    st.floats(-1e3, 1e3),
    st.floats(-1e3, 1e3),
    st.integers(0, 2**32 - 1),
    st.sampled_from(CLOSURES),
)
def test_simulation_is_linear(alpha: float, beta: float, seed: int, case: tuple[str, float]) -> None:
    x, y = np.random.default_rng(seed).standard_normal((2, 200))
    it = channel(*case, nodes=32)
    got = it.simulate(alpha * x + beta * y, FS)
    expected = alpha * it.simulate(x, FS) + beta * it.simulate(y, FS)
    # 200 steps of 16 modes, each rounding once.
    np.testing.assert_allclose(got, expected, rtol=0, atol=200 * 16 * EPS * 5 * (abs(alpha) + abs(beta)) + 1e-300)


def test_simulation_leaves_its_input_alone_and_repeats() -> None:
    wall = np.random.default_rng(9).standard_normal(100)
    wall.flags.writeable = False
    it = channel(nodes=32)
    np.testing.assert_array_equal(it.simulate(wall, FS), it.simulate(wall.copy(), FS))


@pytest.mark.parametrize("sample_rate", [1000.0, 2000.0, 100000.0])
def test_a_ramp_does_not_depend_on_the_sample_rate(sample_rate: float) -> None:
    it = channel(height=4e-3)
    times = np.arange(1, 101) / 1000.0
    slow = it.simulate(np.arange(101) / 1000.0, 1000.0)[1:]
    got = it.simulate(np.arange(int(0.1 * sample_rate) + 1) / sample_rate, sample_rate)
    # A ramp is exact under the hold; what differs is rounding over 10000 steps.
    np.testing.assert_allclose(got[np.rint(times * sample_rate).astype(int)], slow, rtol=0, atol=10000 * EPS)


# Parameters and errors


def test_fluids_by_name_and_by_properties() -> None:
    assert MhdChannel(fluid="mercury", height=15e-3, field=0.448).fluid.at(REFERENCE) == MERCURY
    border = {"border": True}
    text = {"fluid": "galinstan", "height": "15 mm", "field": "0.448 T", "closure": "local"}
    it = MhdChannel.model_validate(text, context=border)
    assert (it.height, it.field, it.fluid) == (15e-3, 0.448, FLUIDS["galinstan"])
    own = {"density": "13534 kg/m^3", "viscosity": "1.526 mPa*s", "conductivity": "1.04e6 S/m"}
    assert MhdChannel.model_validate({**text, "fluid": own}, context=border).fluid == MERCURY
    assert MhdChannel.model_validate(it.model_dump(context=border), context=border) == it
    assert MhdChannel(fluid="NaK", height=1e-3, field=0.1).fluid.kinematic_viscosity == pytest.approx(1.05e-6, rel=1e-3)


def test_derived_numbers() -> None:
    it = channel(height=4e-3, field=0.45)
    assert it.braking_rate == pytest.approx(15.56, abs=0.005)
    # In `local` Ha^2 is the ratio of braking to viscous rate on the half height.
    assert it.hartmann_number**2 == pytest.approx(it.braking_rate * (2e-3) ** 2 / NU)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"fluid": "mercry"}, "unknown fluid 'mercry'; did you mean 'mercury'"),
        ({"load_fraction": 0.5}, "expected 1 with closure 'local'"),
        ({"closure": "axial_field", "load_fraction": 1.5}, "load_fraction"),
        ({"closure": "axial_field", "load_fraction": float("nan")}, "load_fraction"),
        ({"closure": "axail_field"}, "'local', 'radial_field' or 'axial_field'"),
        ({"nodes": 33}, "expected an even number from 8 to 512, got 33"),
        ({"nodes": 6}, "got 6"),
        ({"nodes": 1024}, "got 1024"),
        ({"height": 0.0}, "height"),
        ({"field": -0.1}, "field"),
        ({"hieght": 1.0}, "hieght"),
    ],
)
def test_bad_parameters_are_named(change: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        MhdChannel.model_validate({"fluid": "mercury", "height": 15e-3, "field": 0.448, **change})


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_a_bad_sample_is_named_and_leaves_the_state(bad: float) -> None:
    stage = channel(nodes=32).start(FS)
    stage.process(np.ones(10))
    before = stage.profile()
    with pytest.raises(ValueError, match=f"wall_rate: expected finite samples, got {bad} at sample 13"):
        stage.process(np.array([1.0, 1.0, 1.0, bad, 1.0, np.nan]))
    np.testing.assert_array_equal(stage.profile(), before)


def test_a_wrong_shape_is_named() -> None:
    with pytest.raises(ValueError, match=r"wall_rate: expected shape \(n_time,\), got \(2, 3\)"):
        channel(nodes=32).simulate(np.zeros((2, 3)), FS)


@pytest.mark.parametrize("sample_rate", [0.0, -1.0, np.inf, np.nan])
def test_a_bad_sample_rate_is_named(sample_rate: float) -> None:
    with pytest.raises(ValueError, match="sample_rate_hz: expected a positive"):
        channel(nodes=32).start(sample_rate)


@pytest.mark.parametrize("method", ["response", "discrete_response"])
def test_a_bad_frequency_is_named(method: str) -> None:
    with pytest.raises(ValueError, match="freq_hz: expected finite frequencies in Hz, got nan"):
        getattr(channel(nodes=32), method)(np.array([1.0, np.nan]))


def test_a_grid_with_growing_modes_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    second, mean = even_operators(16)
    monkeypatch.setattr(modes_module, "even_operators", lambda _: (-second, mean))
    with pytest.raises(
        ValueError, match=r"nodes: expected a grid with real, decaying modes, got a mode of .* 16 intervals"
    ):
        modes_module.channel_modes.__wrapped__(16, 1.0, 0.0, 0.0)
