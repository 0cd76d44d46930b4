"""The filter that follows gain and delay of its sensors."""

from __future__ import annotations

import functools
import math
from copy import deepcopy

import numpy as np
import pytest
from pydantic import ValidationError

from testbed.fusion import estimate
from testbed.fusion.belief import load_belief
from testbed.fusion.filters.self_calibrating import LateBelief, SelfCalibrating, SelfCalibratingParameters
from tests.records import DEG, FS, RATES, cut, ramped, record, rms

EQ39 = load_belief("eq39")
INNER = {"kalman": {"order": 3, "q": 1e10 * DEG**2}}


def ten(t):
    return DEG * np.sin(20.0 * np.pi * t)


def still(t):
    return np.zeros_like(t)


def fast(t):
    """Lines as a wheel's, 17 deg/s^2 of change in all."""
    return 0.02 * DEG * sum(np.sin(2.0 * np.pi * f * t) for f in (40.0, 80.0, 120.0))


@functools.cache
def spoilt(change="", seconds=8.0, motion=ten):
    """Return the rate and the readings with an MHD ARS of another gain or delay."""
    changes = {"": {}, "gain": {"scale_factor_error": 0.01}, "delay": {"delay": 0.5e-3}}[change]
    return record(ramped(motion), seconds, 3, {"mhd_ars": changes})


def built(**parameters):
    return SelfCalibrating(EQ39, RATES, SelfCalibratingParameters(**({"filter": INNER} | parameters)))


def error(block, rate, begin=4.0):
    return rms((block.rate - rate)[round(begin * FS) :]) / DEG


@pytest.mark.oracle
def test_the_lag_is_one_pole_behind_the_dynamics_and_leaves_their_states_alone():
    freq = np.array([0.1, 1.0, 10.0, 100.0, 1000.0])
    for one in EQ39.values():
        late = LateBelief(**one.model_dump(), lag=4e-4)
        wanted = one.response(freq) / (1.0 + 2j * math.pi * freq * 4e-4)
        np.testing.assert_allclose(late.realisation().response(freq), wanted, rtol=1e-9)
        assert late.n_state == one.n_state + 1 == late.realisation().B.size
        plain, n = one.realisation(), one.n_state
        for lag in (1e-6, 1e-3):
            found = LateBelief(**one.model_dump(), lag=lag).realisation()
            assert np.array_equal(found.A[:n, :n], plain.A)
            assert np.array_equal(found.B[:n], plain.B)


@pytest.mark.parametrize(
    ("change", "gain", "delay"), [("gain", 1.0 / 1.01, 0.0), ("delay", 1.0, -0.5e-3)], ids=["gain", "delay"]
)
def test_gain_and_delay_are_found_and_taken_out(change, gain, delay):
    """Against the filter inside on the same readings, and on those of a right sensor (the bars of
    `benchmarks/bench_self_calibration.py` for one seed and a shorter record).
    """
    rate, readings = spoilt(change)
    found = built().process(readings)
    last = {name: found.diagnostics[name][-1] for name in ("gain", "gain_std", "delay", "delay_std")}
    # Equation (39) is off by 0.15 % and 0.02 ms at 10 Hz.
    assert abs(last["gain"] - gain) < 4.0 * last["gain_std"] + 0.002
    assert abs(last["delay"] - delay) < 4.0 * last["delay_std"] + 3e-5
    given = {"sample_rate_hz": RATES, "verdict": False}
    alone = error(estimate("kalman", readings, **given, **INNER["kalman"]), rate)
    right = error(estimate("kalman", spoilt()[1], **given, **INNER["kalman"]), rate)
    assert error(found, rate) < 1.2 * right + 4e-4 < alone


@pytest.mark.oracle
def test_a_delay_on_fast_lines_is_known_as_well_as_the_record_tells():
    """Fisher information of T seconds: T <w'^2> / S, S the density of the gyro's noise. What is left is what the filter
    inside leaves that was told of the delay: it has to foresee the lines.
    """
    rate, readings = spoilt("delay", motion=fast)
    quick = {"order": 3, "q": 1e12 * DEG**2}
    found = built(filter={"kalman": quick}, start="rest").process(readings)
    delay, std = (found.diagnostics[name][-1] for name in ("delay", "delay_std"))
    change = sum((2.0 * np.pi * f * 0.02 * DEG) ** 2 / 2.0 for f in (40.0, 80.0, 120.0))
    # In the eighth second it knows seven, whose ends have half the weight; the ramp takes a little of the first.
    information = 6.0 * change / EQ39["mems_gyro"].input_noise ** 2 + 5e-4**-2
    assert std == pytest.approx(information**-0.5, rel=0.02, abs=0.0)
    assert abs(delay + 0.5e-3) < 3.0 * std
    late = EQ39 | {"mhd_ars": EQ39["mhd_ars"].model_copy(update={"delay": 0.5e-3})}
    given = {"sample_rate_hz": RATES, "verdict": False}
    told, not_told = (estimate("kalman", readings, belief=one, **given, **quick) for one in (late, EQ39))
    assert error(found, rate) < 1.05 * error(told, rate) < 0.85 * error(not_told, rate)


@pytest.mark.parametrize("phase", [0.35, 0.6, 0.85])
def test_a_record_that_begins_in_mid_motion_leaves_gain_and_delay_alone(phase):
    """A line of 0.5 Hz cut where the sensors' dynamics, begun at rest, would make 7 % of gain or 40 ms of it."""
    whole, readings = record(ramped(lambda t: DEG * np.sin(np.pi * t)), 11.0, 4)
    _, readings = cut(whole, readings, 2.0 * (2.0 + phase))
    found = built().process(readings)
    for name, wanted, off in (("gain", 1.0, 0.002), ("delay", 0.0, 2e-4)):
        value, std = found.diagnostics[name], found.diagnostics[f"{name}_std"]
        assert np.max(np.abs(value - wanted) - 4.0 * std) < off
    assert found.diagnostics["gain_std"][-1] < 0.003


def test_single_readings_that_are_lost_cost_nothing():
    """One in 200 of either sensor: 5 % of the means of ten readings lack one."""
    rate, readings = spoilt("gain")
    rng = np.random.default_rng(6)
    lossy = {name: np.where(rng.random(z.size) < 0.005, np.nan, z) for name, z in readings.items()}
    whole, found = built().process(readings), built().process(lossy)
    for name in ("gain", "delay"):
        std = whole.diagnostics[f"{name}_std"][-1]
        assert found.diagnostics[f"{name}_std"][-1] == pytest.approx(std, rel=0.02)
        assert abs(found.diagnostics[name][-1] - whole.diagnostics[name][-1]) < std
    assert error(found, rate) < 1.1 * error(whole, rate)


def test_at_rest_it_is_the_filter_inside():
    rate, readings = spoilt(motion=still)
    alone = estimate("kalman", readings, sample_rate_hz=RATES, verdict=False, **INNER["kalman"])
    found = built().process(readings)
    assert error(found, rate) < 1.05 * error(alone, rate)


def test_any_division_into_blocks_gives_the_same_bits():
    """Through seconds in which it learns, goes back and starts again."""
    _, readings = spoilt("delay", 5.0)
    whole = built().process(readings)
    # Nothing is known in the first three seconds: the dynamics settle, then a spectrum is of two.
    assert len(set(whole.diagnostics["delay"])) == 3
    stage, blocks = built(), []
    for a, b in ((0, 13), (13, 20_000), (20_000, 20_007), (20_007, 75_000), (75_000, 100_000)):
        part = {
            name: readings[name][-(-a * int(fs) // 20_000) : -(-b * int(fs) // 20_000)] for name, fs in RATES.items()
        }
        blocks.append(stage.process(part))
    assert np.array_equal(np.concatenate([one.rate for one in blocks]), whole.rate)
    assert np.array_equal(np.concatenate([one.std for one in blocks]), whole.std)


def test_a_copy_goes_on_by_itself():
    _, readings = spoilt("gain", 4.0)
    first = {name: z[: round(2.5 * RATES[name])] for name, z in readings.items()}
    rest = {name: z[round(2.5 * RATES[name]) :] for name, z in readings.items()}
    stage = built()
    stage.process(first)
    twin = deepcopy(stage)
    a = stage.process(rest)
    assert np.array_equal(a.rate, twin.process(rest).rate)


def test_an_order_that_cannot_extrapolate_is_refused():
    for given in ({"kalman": {}}, {"wideband": {"order": 1, "q": 1.0}}):
        with pytest.raises(ValidationError, match="expected order 2 or 3"):
            SelfCalibratingParameters(filter=given)


def test_a_filter_that_cannot_go_on_is_refused_by_name():
    with pytest.raises(ValidationError, match=r"expected one of \['kalman', 'wideband'\].*'complementary'"):
        SelfCalibratingParameters(filter={"complementary": {}})
    with pytest.raises(ValidationError, match=r"kalman\.ordre"):
        SelfCalibratingParameters(filter={"kalman": {"ordre": 3}})
    with pytest.raises(ValidationError, match="at most 1"):
        SelfCalibratingParameters(filter={"kalman": {"order": 2}, "wideband": {}})


def test_a_blind_sensor_is_scaled_whichever_is_named_first():
    _, readings = spoilt("gain", 4.0)
    turned = SelfCalibrating(EQ39, dict(reversed(RATES.items())), SelfCalibratingParameters(filter=INNER))
    a, b = built().process(readings), turned.process(readings)
    np.testing.assert_allclose(a.diagnostics["gain"], b.diagnostics["gain"], rtol=1e-12)
    np.testing.assert_allclose(a.rate, b.rate, rtol=0.0, atol=1e-6 * DEG)
