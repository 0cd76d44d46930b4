"""A channel on its own clock: sorted, gaps filled, increments and angles as the rates that they are."""

from __future__ import annotations

import numpy as np
import pytest

from testbed.errors import ScenarioError
from testbed.logs.reader import read_log
from testbed.playback.reel import wind


def channel(folder, stamps_us, values, unit="deg/s", **said):
    """Return the channel of a text file with stamps in microseconds."""
    path = folder / "log.csv"
    rows = "".join(f"{t},{'' if np.isnan(v) else repr(float(v))}\n" for t, v in zip(stamps_us, values, strict=True))
    path.write_text(f"t [us],w [{unit}]\n{rows}", encoding="utf-8")
    time = {"column": "t"}
    return read_log(path, {"channels": {"w": {"column": "w", "time": time, **said}}}).channels["w"]


def test_an_even_channel_keeps_its_samples(tmp_path):
    reel = wind(channel(tmp_path, range(1000, 101_000, 500), np.arange(200.0)))
    assert (reel.sample_rate_hz, reel.start_ns, reel.stamps_ns) == (2000.0, 1_000_000, None)
    np.testing.assert_allclose(reel.rate, np.deg2rad(np.arange(200.0)), rtol=1e-15)
    np.testing.assert_array_equal(reel.stamps(), 1_000_000 + 500_000 * np.arange(200))


def test_a_gap_is_filled_with_lost_readings(tmp_path):
    kept = [k for k in range(200) if not 50 <= k < 60]
    reel = wind(channel(tmp_path, [500 * k for k in kept], [float(k) for k in kept]))
    assert reel.missing == 10
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(reel.rate)), range(50, 60))
    np.testing.assert_allclose(np.rad2deg(reel.rate[kept]), kept, rtol=1e-14)


def test_lines_out_of_order_are_sorted_and_doubles_left_out(tmp_path):
    order = [0, 1, 3, 2, 4, 4, *range(5, 40)]
    reel = wind(channel(tmp_path, [1000 * k for k in order], [float(k) for k in order]))
    assert reel.doubled == 1
    np.testing.assert_allclose(np.rad2deg(reel.rate), np.arange(40.0), rtol=1e-14)


def test_a_jittering_clock_keeps_its_stamps(tmp_path, rng):
    stamps = np.rint(1000.0 * np.arange(300) + 30.0 * rng.standard_normal(300)).astype(int)
    reel = wind(channel(tmp_path, stamps, np.arange(300.0)))
    np.testing.assert_array_equal(reel.stamps(), 1000 * stamps)
    assert reel.sample_rate_hz == pytest.approx(1000.0, rel=1e-3)


@pytest.mark.parametrize("kind", ["increment", "angle"])
def test_the_mean_rate_of_an_interval_is_a_reading_at_its_end_and_a_reference_in_its_middle(kind, tmp_path):
    """A rate that grows as t: its mean over (t - T, t) is t - T/2, its own value in the middle."""
    t = 1e-3 * np.arange(1, 301)
    angle = 0.5 * t**2
    values = angle if kind == "angle" else np.diff(angle, prepend=0.0)
    made = channel(tmp_path, range(1000, 301_000, 1000), np.rad2deg(values), unit="deg", kind=kind)
    end, middle = wind(made), wind(made, middle=True)
    for reel, late in ((end, 0.5e-3), (middle, 0.0)):
        times = 1e-9 * reel.stamps()
        np.testing.assert_allclose(reel.rate, times - late, atol=1e-9)


def test_what_is_no_rate_or_has_no_kind_is_refused(tmp_path):
    with pytest.raises(ScenarioError, match="is a unit of angle: expected increment or angle"):
        wind(channel(tmp_path, range(0, 50_000, 1000), np.arange(50.0), unit="deg"))
    with pytest.raises(ScenarioError, match="expected a rate or an angle"):
        wind(channel(tmp_path, range(0, 50_000, 1000), np.arange(50.0), unit="V"))


def test_a_jump_of_a_whole_turn_is_no_rate(tmp_path):
    degrees = (2.0 * np.arange(400)) % 360.0
    reel = wind(channel(tmp_path, range(0, 400_000, 1000), degrees, unit="deg", kind="angle"))
    np.testing.assert_allclose(np.rad2deg(reel.rate), 2000.0, rtol=1e-9)


def test_another_clock_that_is_even_stays_even(tmp_path):
    reel = wind(channel(tmp_path, range(0, 100_000, 500), np.arange(200.0)))
    slower = reel.put_right(-reel.rate, 7_000_000 + 501_000 * np.arange(200))
    assert slower.stamps_ns is None
    assert slower.start_ns == 7_000_000
    assert slower.sample_rate_hz == pytest.approx(1e6 / 501.0, rel=2e-8)  # to 2 ns of 100 ms
    assert reel.put_right(2.0 * reel.rate, reel.stamps()).sample_rate_hz == 2000.0


def test_nanoseconds_of_the_epoch_that_went_through_a_double_are_even(tmp_path):
    """At 1.7e18 a double counts in 256: no step of 50 000 ns is one of these stamps' own."""
    stamps = np.array([float(1_700_000_005_500_000_000 + 50_000 * k) for k in range(4000)]).astype(np.int64)
    assert np.unique(np.diff(stamps)).size > 1
    path = tmp_path / "log.csv"
    path.write_text("t [ns],w [deg/s]\n" + "".join(f"{t},{k % 7}\n" for k, t in enumerate(stamps.tolist())))
    reel = wind(read_log(path).channels["w"])
    assert (reel.sample_rate_hz, reel.stamps_ns, reel.quantum_ns) == (20_000.0, None, 256.0)
