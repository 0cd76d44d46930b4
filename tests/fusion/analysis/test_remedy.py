"""What is safe is put right, marked, and nothing else is touched."""

from __future__ import annotations

import math

import numpy as np
import pytest

from testbed.fusion.analysis.finding import Finding, Verdict
from testbed.fusion.analysis.remedy import remedied

FIRST = 1_700_000_000_000_000_000  # ns, so late that a float holds it to 256 ns only


def finding(kind, value, sensor="gyro", unit="1"):
    return Finding(kind, sensor, value, value, value, unit, "put it right")


@pytest.fixture
def record():
    time_ns = {"mhd": FIRST + np.arange(2000, dtype=np.int64) * 50_000, "gyro": FIRST + np.arange(200) * 500_000}
    return {name: np.sin(np.arange(one.size)) for name, one in time_ns.items()}, time_ns


def test_factors_multiply(record):
    readings, time_ns = record
    found = remedied(
        readings,
        time_ns,
        Verdict((finding("sign", -1.0), finding("unit", math.degrees(1.0)), finding("gain", 1.1, "mhd"))),
    )
    np.testing.assert_allclose(found.readings["gyro"], -readings["gyro"] / math.degrees(1.0), rtol=1e-14)
    np.testing.assert_allclose(found.readings["mhd"], readings["mhd"] / 1.1, rtol=1e-14)
    assert all(one.fixed for one in found.verdict.findings)
    assert found.verdict.unfixed == ()


def test_stamps_of_a_known_clock_come_back_to_the_nanosecond(record):
    """Stamps made by the equation itself, in integers of a ratio of 1000 ppm."""
    readings, time_ns = record
    true = FIRST + np.arange(200, dtype=np.int64) * 60_000_000_000  # over three hours
    late = true + (true - FIRST) // 1000 + 20_000_000
    given = {"mhd": time_ns["mhd"], "gyro": late}
    found = remedied(readings, given, Verdict((finding("offset", 0.02, unit="s"), finding("rate", 1e-3))))
    # One of rounding, and of 1e13 ns times 1e-3 a float holds 2e-6.
    assert np.max(np.abs(found.time_ns["gyro"] - true)) <= 1
    assert np.array_equal(found.time_ns["mhd"], time_ns["mhd"])


def test_what_is_not_safe_stands(record):
    readings, time_ns = record
    found = remedied(readings, time_ns, Verdict((finding("bandwidth", 480.0, unit="Hz"), finding("gaps", 0.1))))
    assert [one.fixed for one in found.verdict.findings] == [False, False]
    assert all(np.array_equal(found.readings[name], readings[name]) for name in readings)


def test_inputs_stay_as_they_are(record):
    readings, time_ns = record
    before = {name: one.copy() for name, one in readings.items()}, {name: one.copy() for name, one in time_ns.items()}
    remedied(readings, time_ns, Verdict((finding("sign", -1.0), finding("offset", 0.1, unit="s"))))
    for kept, now in zip(before, (readings, time_ns), strict=True):
        assert all(np.array_equal(kept[name], now[name]) for name in kept)


def test_a_finding_says_itself_in_the_units_of_the_border():
    one = Finding("offset", "gyro", 0.02, 0.0199, 0.0201, "s", "shift its stamps")
    assert str(one) == "gyro: offset 20.000 ms (19.900 to 20.100): shift its stamps"
    one = Finding("rate", "gyro", 1852e-6, 1850e-6, 1854e-6, "1", "give its true rate", fixed=True)
    assert str(one) == "gyro: rate 1852.0 ppm (1850.0 to 1854.0): give its true rate [fixed]"
