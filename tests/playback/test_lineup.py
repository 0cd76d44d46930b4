"""Sensors side by side: where their common time begins, what lies outside of it, the reference at its instants."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from testbed.errors import ScenarioError
from testbed.playback.lineup import at_instants, line_up
from testbed.playback.reel import Reel
from testbed.units import DEG_H


def reel(name, rate_hz, n, start_s=0.0, **said):
    """Return a reel whose readings are the numbers of its samples."""
    return Reel(name, np.arange(float(n)), round(1e9 * start_s), rate_hz, **said)


def test_sensors_that_begin_together_keep_every_sample():
    made = line_up([reel("slow", 100.0, 100), reel("fast", 1000.0, 995)], None, "x")
    assert made.sensors == ("slow", "fast")
    assert made.rates == {"base": 1000.0, "slow": 100.0, "fast": 1000.0}
    assert made.n_time == 995
    np.testing.assert_array_equal(made.readings["fast"], np.arange(995.0))
    np.testing.assert_array_equal(made.readings["slow"], np.arange(100.0))
    assert made.dropped == {"slow": 0, "fast": 0}


def test_the_common_time_begins_where_all_have_a_sample():
    """The slow one begins 123 ms into the fast one's record, and 7 steps off its tens."""
    made = line_up([reel("fast", 1000.0, 1000), reel("slow", 100.0, 100, start_s=0.127)], None, "x")
    assert made.start_ns == 127_000_000
    assert made.readings["fast"][0] == 127.0
    assert made.readings["slow"][0] == 0.0
    assert made.dropped == {"fast": 127, "slow": 12}
    assert made.readings["slow"].size == 88


def test_a_sensor_that_ends_early_is_lost_from_there_on():
    made = line_up([reel("fast", 1000.0, 1000), reel("slow", 100.0, 60)], None, "x")
    assert np.isnan(made.readings["slow"][60:]).all()
    assert made.readings["slow"].size == 100


def test_three_clocks_meet_where_the_chinese_remainder_says():
    """Steps of 4 from 1 and of 10 from 3: the first common one of 4 k + 1 and 10 m + 3 is 13."""
    made = line_up([reel("a", 1000.0, 500), reel("b", 250.0, 100, 0.001), reel("c", 100.0, 40, 0.003)], None, "x")
    assert made.readings["a"][0] == 13.0
    assert (made.readings["b"][0], made.readings["c"][0]) == (3.0, 1.0)


@pytest.mark.parametrize(
    "other",
    [
        reel("slow", 300.0, 200),
        reel("slow", 100.0, 100, start_s=0.0005),
        reel("slow", 100.0, 100, stamps_ns=10_000_000 * np.arange(100)),
    ],
)
def test_other_clocks_keep_their_stamps(other):
    """A rate of no whole ratio, a clock half a step beside the other's, and one that jitters."""
    made = line_up([reel("fast", 1000.0, 1000), other], None, "x")
    assert made.stamps_ns is not None
    np.testing.assert_array_equal(made.stamps_ns["base"], made.stamps_ns["fast"])
    since = other.stamps() - made.start_ns
    inside = (since >= 0) & (since <= made.stamps_ns["base"][-1])
    np.testing.assert_array_equal(made.stamps_ns["slow"], since[inside])
    np.testing.assert_array_equal(made.readings["slow"], other.rate[inside])
    assert made.dropped["slow"] == np.count_nonzero(~inside)
    # Each reading in one block, whichever way it is cut.
    cuts = [0, 17, 400, made.n_time]
    firsts = [made.first("slow", cut) for cut in cuts]
    assert (firsts[0], firsts[-1]) == (0, made.stamps_ns["slow"].size)
    for cut, at in zip(cuts[1:-1], firsts[1:-1], strict=True):
        assert made.stamps_ns["slow"][at - 1] < made.stamps_ns["base"][cut] <= made.stamps_ns["slow"][at]


def test_what_was_not_recorded_at_the_same_time_is_refused():
    with pytest.raises(ScenarioError, match="recorded at the same time"):
        line_up([reel("fast", 1000.0, 1000), reel("slow", 100.0, 100, start_s=100.0)], None, "x")


def test_a_reference_on_the_same_clock_is_taken_as_it_is():
    base = reel("fast", 1000.0, 100, start_s=0.01)
    same = reel("reference", 1000.0, 200)
    np.testing.assert_array_equal(at_instants(same, base, 100), 10.0 + np.arange(100.0))
    finer = reel("reference", 4000.0, 800)
    np.testing.assert_array_equal(at_instants(finer, base, 100), 40.0 + 4.0 * np.arange(100.0))


def test_a_reference_of_another_clock_is_interpolated_and_unknown_outside():
    """A sine of 5 Hz sampled at 411 Hz: a cubic spline is off by less than (w T)^4 / 100 of it."""
    times = np.arange(400) / 411.0
    reference = Reel("reference", np.sin(10.0 * np.pi * times), 50_000_000, 411.0)
    base = reel("fast", 1000.0, 1000)
    found = at_instants(reference, base, 1000)
    wanted = np.arange(1000) / 1000.0
    np.testing.assert_array_equal(np.isnan(found), wanted < 0.05)
    inside = wanted > 0.06
    np.testing.assert_allclose(found[inside], np.sin(10.0 * np.pi * (wanted[inside] - 0.05)), atol=1e-6)


def test_nothing_is_known_across_a_gap_of_the_reference():
    values = np.arange(400.0)
    values[100:120] = np.nan
    found = at_instants(Reel("reference", values, 0, 411.0), reel("fast", 1000.0, 900), 900)
    lost = (np.arange(900) / 1000.0 > 99 / 411.0) & (np.arange(900) / 1000.0 < 120 / 411.0)
    np.testing.assert_array_equal(np.isnan(found), lost)


@pytest.mark.parametrize(("noise", "unit"), [(1.0, "deg/h"), (2.0, "deg/s")])
def test_the_unit_follows_the_noise_of_the_readings_and_not_their_motion(noise, unit):
    """A tenth of the Earth's rate is 1.5 deg/h; the table turns a thousand times faster, and some readings are lost."""
    t = np.arange(4000) / 100.0
    rate = 15_000.0 * np.sin(2e-3 * np.pi * t) + noise * np.random.default_rng(4).standard_normal(t.size)
    rate[::7] = np.nan
    made = line_up([reel("fog", 100.0, t.size)], None, "x")
    assert dataclasses.replace(made, readings={"fog": DEG_H * rate}).rate_unit == unit
    assert dataclasses.replace(made, readings={"fog": 0.0 * rate}).rate_unit == "deg/s"
