"""Thermal bias of a fibre-optic gyro against closed forms, an ODE solver and the properties of play operators."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from testbed.models.fog_thermal import COEFFICIENTS, FogThermal, advance_thermal

T0 = 293.15
FULL = FogThermal(
    linear=2e-8,
    quadratic=2e-10,
    cubic=-4e-12,
    shupe=1.3e-4,
    shupe_temperature=6e-7,
    gradient=1e-7,
    hysteresis=(1e-8, 5e-9),
    half_width=(4.0, 12.0),
)


def only(**kept):
    """Return a model with these terms alone."""
    return FogThermal(**kept)


def wave(n=4000, fs=0.1):
    t = np.arange(n) / fs
    return T0 + 25.0 * np.sin(2 * np.pi * t / 9000.0) + 10.0 * np.sin(2 * np.pi * t / 2100.0)


def play(x, r, p):
    """Return the play operator of `x` by its definition, one sample at a time."""
    out = []
    for value in x:
        p = min(max(p, value - r), value + r)
        out.append(p)
    return np.array(out)


@pytest.mark.oracle
def test_lags_meet_an_ode_solver() -> None:
    """Linear, Shupe and gradient terms from the temperatures of scipy's integrator, for a smooth input."""
    model = FULL.model_copy(update={"hysteresis": (0.0, 0.0)})
    T = wave(8000, 1.0)
    lags = np.array([model.coil_lag, model.spool_lag])

    def slopes(now, places):
        ambient = 25.0 * np.sin(2 * np.pi * now / 9000.0) + 10.0 * np.sin(2 * np.pi * now / 2100.0)
        return (ambient - places) / lags

    t = np.arange(T.size) / 1.0
    solved = solve_ivp(slopes, (0.0, t[-1]), [0.0, 0.0], method="DOP853", t_eval=t, rtol=1e-12, atol=1e-12)
    coil, spool = T0 + solved.y
    heat, slope = coil - T0, (T - coil) / model.coil_lag
    wanted = model.linear * heat + model.quadratic * heat**2 + model.cubic * heat**3
    wanted += (model.shupe + model.shupe_temperature * heat) * slope + model.gradient * (coil - spool)
    # Straight lines between samples lose (w T)^2 / 12 = 7.5e-7 of the 10 K at 2100 s; through the coil's lag 3e-6 K are
    # left, times w S = 4e-7 rad/s/K: 1e-12, a millionth of the bias.
    np.testing.assert_allclose(model.bias(T, 1.0), wanted, rtol=0, atol=1e-12)


@pytest.mark.oracle
def test_a_ramp_in_closed_form() -> None:
    """T_i = T_0 + r (t - tau (1 - e^(-t/tau))): the Shupe term tends to S r, the gradient to g r (tau_s - tau_c)."""
    r, fs = 0.1 / 60.0, 1.0
    t = np.arange(30_000) / fs
    coil, spool = (T0 + r * (t + tau * np.expm1(-t / tau)) for tau in (900.0, 1500.0))
    shupe = only(shupe=1.3e-4).bias(T0 + r * t, fs)
    gradient = only(gradient=1e-7).bias(T0 + r * t, fs)
    # Temperatures of 300 K are known to 6e-14 K, and the ramp itself is rounded to that.
    np.testing.assert_allclose(shupe, 1.3e-4 * -r * np.expm1(-t / 900.0), rtol=1e-9, atol=1e-18)
    np.testing.assert_allclose(gradient, 1e-7 * (coil - spool), rtol=1e-9, atol=1e-19)
    # e^(-30000/1500) = 2e-9 of the way is left.
    assert shupe[-1] == pytest.approx(1.3e-4 * r, rel=1e-8, abs=0)
    assert gradient[-1] == pytest.approx(1e-7 * r * 600.0, rel=1e-7, abs=0)


@pytest.mark.oracle
def test_statics_are_the_cubic() -> None:
    """After twenty lags at 60 degC there is the polynomial and the play that the heating left, r_j behind."""
    T = np.concatenate([T0 + np.linspace(0, 40, 1000), np.full(100_000, T0 + 40)])
    bias = FULL.bias(T, 1.0)[-1]
    statics = 2e-8 * 40 + 2e-10 * 40**2 - 4e-12 * 40**3
    assert bias == pytest.approx(statics - 1e-8 * 4.0 - 5e-9 * 12.0, rel=1e-9, abs=0)


def hysteresis(T, width=(3.0, 9.0), lag=1e-3):
    """Return the two play operators' p_j - T_o in kelvin; the lag is far below a sample, so T_o is the input."""
    each = [only(hysteresis=h, half_width=width, core_lag=lag) for h in ((1.0, 0.0), (0.0, 1.0))]
    return np.array([model.bias(T, 1.0) for model in each])


@pytest.mark.oracle
def test_play_is_its_definition() -> None:
    T = wave(2000)
    got = hysteresis(T)
    for row, r in zip(got, (3.0, 9.0), strict=True):
        # The lag of 1 ms leaves the slope times 1 ms, 3e-4 K.
        np.testing.assert_allclose(row, play(T, r, T[0]) - T, rtol=0, atol=1e-3)


@pytest.mark.property
def test_play_has_a_dead_band_and_saturates() -> None:
    """Within the half-width p stays, so p - T is minus the change; beyond it is -r heating, +r cooling."""
    small = T0 + 2.9 * np.sin(np.linspace(0, 20, 500))
    np.testing.assert_allclose(hysteresis(small)[0], small[0] - small, atol=1e-3)
    up, down = (T0 + sign * np.linspace(0, 30, 500) for sign in (1, -1))
    np.testing.assert_allclose(hysteresis(up)[:, -1], [-3.0, -9.0], atol=1e-3)
    np.testing.assert_allclose(hysteresis(down)[:, -1], [3.0, 9.0], atol=1e-3)


@pytest.mark.property
def test_play_is_rate_independent() -> None:
    """The same temperatures ten times as slow give the same loop."""
    T = wave(1000)
    slow = np.interp(np.arange(10 * T.size - 9) / 10.0, np.arange(T.size), T)
    np.testing.assert_allclose(hysteresis(slow)[:, ::10], hysteresis(T), atol=1e-3)


@pytest.mark.property
def test_play_remembers_its_turning_points() -> None:
    """Return-point memory: a closed inner loop leaves no trace, whatever its shape."""

    def path(*corners):
        return T0 + np.concatenate([np.linspace(a, b, 400)[:-1] for a, b in pairwise(corners)])

    plain, looped = path(0, 30, -20, 25), path(0, 30, -20, 15, -12, 15, 25)
    np.testing.assert_allclose(hysteresis(looped)[:, -1], hysteresis(plain)[:, -1], atol=1e-3)


@pytest.mark.property
def test_equilibrium_and_reference_give_no_bias() -> None:
    assert np.array_equal(FULL.bias(np.full(50, T0), 1.0), np.zeros(50))
    # Anywhere else at rest: statics alone, from the first sample on.
    cold = FULL.bias(np.full(50, T0 - 40.0), 20_000.0)
    assert np.ptp(cold) == 0.0
    assert cold[0] == pytest.approx(2e-8 * -40 + 2e-10 * 1600 + 4e-12 * 64_000, rel=1e-12, abs=0)


@pytest.mark.property
@pytest.mark.parametrize("sizes", [[1, 0, 1, 998], [333, 333, 334], [999, 1]])
def test_any_blocks_give_the_same_bits(sizes) -> None:
    T = wave(1000)
    stage, cuts = FULL.start(0.1), np.cumsum([0, *sizes])
    parts = [stage.process(T[a:b]) for a, b in pairwise(cuts)]
    assert np.array_equal(np.concatenate(parts), FULL.bias(T, 0.1))


@pytest.mark.oracle
def test_kernel_is_its_numpy_twin() -> None:
    u, keep, rise, width = wave(500) - T0, np.exp([-0.1, -0.2, -0.3]), np.array([0.9, 0.8, 0.7]), np.array([2.0, 5.0])
    fast = np.array([1.0, 0.1, 0.2, 0.3, 0.5, -0.5])
    behind, plays = np.empty((3, u.size)), np.empty((2, u.size))
    slow, e, p = fast.copy(), [], []
    advance_thermal(u, keep, rise, width, fast, behind, plays)
    for value in u:
        slow[1:4] = keep * slow[1:4] + rise * (value - slow[0])
        slow[0] = value
        core = value - slow[3]
        slow[4:] = np.minimum(np.maximum(slow[4:], core - width), core + width)
        e.append(slow[1:4].copy())
        p.append(slow[4:].copy())
    # A compiler may fuse a multiplication and an addition: last digits.
    np.testing.assert_allclose(behind.T, e, rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(plays.T, p, rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(fast, slow, rtol=1e-12, atol=1e-13)


def test_the_clock_does_not_matter() -> None:
    """The same straight lines at 1 Hz and at 1 kHz: exact for such an input, so only rounding differs."""
    T = T0 + np.concatenate([np.linspace(0, 5, 21), np.linspace(5, -3, 31)[1:]])
    fine = np.interp(np.arange(1000 * (T.size - 1) + 1) / 1000.0, np.arange(T.size), T)
    np.testing.assert_allclose(FULL.bias(fine, 1000.0)[::1000], FULL.bias(T, 1.0), rtol=1e-9, atol=1e-17)


def test_a_given_equilibrium_is_kept() -> None:
    """Started at 20 degC and then at 30 degC at once: the coil follows with its lag."""
    stage = only(linear=1.0).start(1.0, T0)
    heat = stage.process(np.full(2000, T0 + 10.0))
    # The jump is a straight line over the second before the first sample: its end is (1 - e^-h)/h behind, h = 1/900.
    behind = -10.0 * 900.0 * np.expm1(-1.0 / 900.0) * np.exp(-np.arange(2000) / 900.0)
    np.testing.assert_allclose(heat, 10.0 - behind, rtol=1e-10)
    assert np.array_equal(stage.coil_temperature.shape, (2000,))


def test_a_temperature_that_is_not_finite_is_refused() -> None:
    with pytest.raises(ValueError, match="temperature: expected finite values, got nan"):
        FULL.bias(np.array([T0, np.nan]), 1.0)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"shupe": "0.45 deg/h"}, "wrong dimension"),
        ({"quadratic": "1e-5 deg/h/K"}, "wrong dimension"),
        ({"half_width": ["5 degC", "5 K"]}, "expected at most 100"),
        ({"coil_lag": "0 s"}, "more than 0"),
    ],
)
def test_wrong_units_are_refused(values, message) -> None:
    with pytest.raises(ValueError, match=message):
        FogThermal.model_validate(values, context={"border": True})


def test_the_unit_of_the_shupe_term() -> None:
    """0.45 (deg/h)/(K/min) is 0.45 deg/h at 1 K/min."""
    model = FogThermal.model_validate({"shupe": "0.45 deg/h/(K/min)"}, context={"border": True})
    assert model.shupe / 60.0 == pytest.approx(np.deg2rad(0.45) / 3600.0, rel=1e-12, abs=0)


def test_terms_alone_over_the_papers_oven() -> None:
    """The table of docs/fog.md: standard deviation of each group of terms alone [deg/h]."""
    from testbed.models.temperature import TemperatureProfile
    from testbed.sensors import load_preset

    ramps = [{"hold": 7200.0}, {"ramp": 333.15, "over": 24_000.0}, {"ramp": 243.15, "over": 54_000.0}]
    oven = TemperatureProfile.model_validate({"start": 293.15, "steps": ramps}).at(0, 85_200, 1.0)
    model = load_preset("fog_paper3").thermal
    groups = {
        "statics": ("linear", "quadratic", "cubic"),
        "Shupe": ("shupe", "shupe_temperature"),
        "gradient": ("gradient",),
        "hysteresis": ("hysteresis",),
    }
    zero = {name: 0.0 for names in groups.values() for name in names} | {"hysteresis": (0.0, 0.0)}
    alone = {
        group: model.model_copy(update={**zero, **{name: getattr(model, name) for name in names}}).bias(oven, 1.0)
        for group, names in groups.items()
    }
    for group, bias in alone.items():
        print(f"{group}: {np.rad2deg(bias.std()) * 3600.0:.3f} deg/h")
    # The terms add up, and the hysteresis is what the half-widths allow: 4 K at 2e-3 and 12 K at 1e-3 deg/h/K to both
    # sides.
    np.testing.assert_allclose(sum(alone.values()), model.bias(oven, 1.0), rtol=0, atol=1e-18)
    assert np.rad2deg(np.ptp(alone["hysteresis"])) * 3600.0 == pytest.approx(0.04, rel=1e-6)


def test_coefficients_scatter_by_themselves_and_by_what_is_said() -> None:
    """Two hundred cycles: each mean is the coefficient, each relative std the scatter, no two go together."""
    model, n = FULL.model_copy(update={"scatter": 0.1}), 200
    drawn = [model.drawn(np.random.default_rng(seed)) for seed in range(n)]
    names = COEFFICIENTS[:-1]
    true = np.array([*(getattr(FULL, name) for name in names), *FULL.hysteresis])
    relative = np.array([[*(getattr(one, name) for name in names), *one.hysteresis] for one in drawn]) / true - 1.0
    # Four sigma over eight coefficients: sigma of a mean is 0.1/sqrt(n), of a std 0.1/sqrt(2 n), of a correlation
    # 1/sqrt(n).
    assert np.abs(relative.mean(axis=0)).max() < 0.4 / n**0.5
    assert np.abs(relative.std(axis=0) - 0.1).max() < 0.4 / (2 * n) ** 0.5
    assert np.abs(np.corrcoef(relative.T) - np.eye(8)).max() < 4.0 / n**0.5
    assert {one.scatter for one in drawn} == {0.0}
    assert {(one.coil_lag, one.half_width, one.reference_temperature) for one in drawn} == {
        (FULL.coil_lag, FULL.half_width, FULL.reference_temperature)
    }


def test_without_scatter_nothing_is_drawn() -> None:
    rng = np.random.default_rng(1)
    assert FULL.drawn(rng) is FULL
    assert rng.random() == np.random.default_rng(1).random()
