"""Temperature features against scipy and a plain play operator; causal, block-invariant, proof against the
thermometer's steps.
"""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter

from testbed.compensation.features import Features, Scaling
from testbed.compensation.record import GyroRecord

ALL = Features(plays=(3.0, 10.0))


def wandering(rng, n=5000):
    return 293.15 + np.cumsum(rng.normal(size=n)) * 0.3


@pytest.mark.oracle
@pytest.mark.parametrize("sample_rate_hz", [1.0, 10.0])
def test_features_are_those_of_scipy_and_of_a_plain_loop(rng, sample_rate_hz):
    T = wandering(rng)

    def lag(x, tau):
        pole = np.exp(-1.0 / (sample_rate_hz * tau))
        return lfilter([1.0 - pole], [1.0, -pole], x, zi=[pole * x[0]])[0]

    def play(x, width):
        held, out = x[0], []
        for value in x:
            if value - held > width:
                held = value - width
            elif held - value > width:
                held = value + width
            out.append(held)
        return np.array(out)

    smooth = lag(T, ALL.smoothing)
    delay = 1.0 / np.expm1(1.0 / (sample_rate_hz * ALL.smoothing)) / sample_rate_hz
    slope, warm = (smooth - lag(smooth, ALL.smoothing)) / delay, smooth - 293.15
    lags = [smooth, *(lag(T, tau) for tau in ALL.lags)]
    columns = [warm, warm**2, warm**3, slope, warm * slope, *(a - b for a, b in itertools.pairwise(lags))]
    columns += [smooth - play(smooth, width) for width in ALL.plays]
    X = ALL.compute(T, sample_rate_hz)
    assert X.shape[1] == len(ALL.names) == len(columns)
    for column, expected, name in zip(X.T, columns, ALL.names, strict=True):
        # Rounding of 300 K through a low-pass, amplified by the powers.
        assert np.allclose(column, expected, rtol=0.0, atol=1e-9 * max(1.0, np.abs(expected).max())), name


@pytest.mark.oracle
def test_slope_of_a_ramp_is_its_rate():
    """Settled after 20 smoothing times: exp(-20) is left, times 20."""
    rate = 0.1 / 60.0
    T = 293.15 + rate * np.arange(round(20 * ALL.smoothing))
    assert ALL.compute(T, 1.0)[-1, ALL.names.index("dT/dt")] == pytest.approx(rate, rel=1e-6)


@pytest.mark.oracle
@pytest.mark.parametrize("rate", [0.0, 1e-4 / 60.0, 0.1 / 60.0, 1.0 / 60.0])
def test_steps_of_the_thermometer_stay_below_the_stated_slope_error(rate):
    """A single step is the worst case; a ramp's steps average out. Rounding errs by less than a step per change."""
    T = 293.15 + rate * np.arange(20_000.0)
    T[10_000:] += 0.04  # carries a steady temperature over one step
    read = np.round(T / 0.0625) * 0.0625
    column = ALL.names.index("dT/dt")
    error = np.abs(ALL.compute(read, 1.0) - ALL.compute(T, 1.0))[10:, column].max()
    assert error <= 1.01 * ALL.slope_error
    if rate == 0.0:
        single = np.full(5000, 300.0)
        single[100:] += 0.0625
        assert ALL.compute(single, 1.0)[:, column].max() == pytest.approx(ALL.slope_error, rel=0.01)


def test_the_slope_of_a_ramp_is_its_rate_where_readings_are_rare():
    """One reading in ten smoothing times: 250 K rounded to 3e-14 K, against a lag of 1e-5 K, leaves eight digits."""
    period, ramp = 10.0 * ALL.smoothing, 1e-4
    slopes = ALL.compute(250.0 + ramp * period * np.arange(5), 1.0 / period)[:, ALL.names.index("dT/dt")]
    assert slopes[-1] == pytest.approx(ramp, rel=1e-6)


@pytest.mark.parametrize("times", [15.0, 50.0, 1e6])
def test_readings_too_rare_for_a_slope_are_refused(times):
    """Farther apart the lag is the rounding of the readings, then nothing: a division by zero once."""
    rate = 1.0 / (times * ALL.smoothing)
    with pytest.raises(ValueError, match="expected several readings within the 276 s"):
        ALL.start(rate)
    assert Features(slopes=False).compute(np.array([300.0, 301.0]), rate).shape == (2, 6)


@pytest.mark.property
@settings(max_examples=25, deadline=None)
@given(st.lists(st.integers(0, 400), max_size=6), st.integers(0, 2**31))
def test_any_division_into_blocks_gives_the_same_bits(cuts, seed):
    T = wandering(np.random.default_rng(seed), 400)
    stage = ALL.start(1.0)
    parts = [stage.process(part) for part in np.split(T, sorted(cuts))]
    assert np.array_equal(np.concatenate(parts), ALL.compute(T, 1.0))


@pytest.mark.property
def test_the_future_does_not_change_the_past(rng):
    T = wandering(rng)
    other = T.copy()
    other[3000:] += 40.0
    assert np.array_equal(ALL.compute(T, 1.0)[:3000], ALL.compute(other, 1.0)[:3000])
    assert not np.array_equal(ALL.compute(T, 1.0)[3000], ALL.compute(other, 1.0)[3000])


def test_rest_gives_nothing_but_the_temperature():
    X = ALL.compute(np.full(100, 300.0), 1.0)
    assert np.all(X[:, 3:] == 0.0)
    assert np.all(X[:, 0] == 300.0 - 293.15)


def test_scaling_standardises_and_flags_what_lies_outside(rng):
    X = rng.uniform(-3.0, 5.0, size=(500, 2)) * [1e-6, 1e6]
    X = np.column_stack([X, np.full(500, 7.1)])
    scaling = Scaling.fit(X)
    Z = scaling.apply(X)
    assert np.allclose(Z.mean(axis=0), 0.0, rtol=0.0, atol=1e-9)
    assert np.allclose(Z.std(axis=0), [1.0, 1.0, 0.0], rtol=0.0, atol=1e-9)
    assert not scaling.extrapolated(Z).any()
    beyond = Z[:1].copy()
    span = scaling.high[1] - scaling.low[1]
    for share, flagged in ((0.04, False), (0.06, True)):
        beyond[0, 1] = scaling.high[1] + share * span
        assert scaling.outside(beyond)[0] == pytest.approx(share)
        assert bool(scaling.extrapolated(beyond)[0]) is flagged


@pytest.mark.parametrize("change", [{"degree": 0}, {"lags": (0.0,)}, {"slope_error": np.nan}, {"plays": (-1.0,)}])
def test_bad_features_are_refused(change):
    with pytest.raises(ValueError, match="features"):
        Features(**change)


@pytest.mark.parametrize(
    ("rate", "temperature", "sample_rate_hz", "name"),
    [
        (np.zeros(20), np.full(19, 300.0), 1.0, "one length"),
        (np.zeros(3), np.full(3, 300.0), 1.0, "at least 16"),
        (np.r_[np.zeros(19), np.nan], np.full(20, 300.0), 1.0, "rate.*sample 19"),
        (np.zeros(20), np.r_[np.inf, np.full(19, 300.0)], 1.0, "temperature.*sample 0"),
        (np.zeros(20), np.full(20, -3.0), 1.0, "kelvin"),
        (np.zeros(20), np.full(20, 300.0), 0.0, "sample_rate_hz"),
        (np.zeros((2, 20)), np.full(20, 300.0), 1.0, "vector"),
    ],
)
def test_a_bad_record_is_refused(rate, temperature, sample_rate_hz, name):
    with pytest.raises(ValueError, match=name):
        GyroRecord(rate, temperature, sample_rate_hz)


def test_nan_temperature_is_refused_and_leaves_the_stage_as_it_was():
    stage, bad = ALL.start(1.0), np.array([300.0, np.nan])
    stage.process(np.array([300.0, 301.0]))
    with pytest.raises(ValueError, match="temperature"):
        stage.process(bad)
    expected = ALL.compute(np.array([300.0, 301.0, 302.0]), 1.0)[-1:]
    assert np.array_equal(stage.process(np.array([302.0])), expected)
