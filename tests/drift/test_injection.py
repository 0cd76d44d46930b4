"""Known rates: their shape, and what is measured of a linear system whose gain is known."""

import numpy as np
import pytest
from scipy.signal import lfilter

from testbed.compensation.record import GyroRecord
from testbed.drift import injection
from testbed.signals import sample_times

FS = 1.0
T = sample_times(0, 43_200, FS)
SIZE = 2.4e-7  # rad/s


def record(rate):
    return GyroRecord(rate=rate, temperature=np.full(rate.size, 293.0), sample_rate_hz=FS)


def test_usable_periods_have_four_samples_each_and_two_periods_in_the_record():
    periods = injection.usable_periods(T.size, FS)
    assert periods == injection.PERIODS  # 12 h hold two periods of 6 h, 1 Hz samples the 10 s sine ten times
    assert injection.usable_periods(T.size, 0.2) == tuple(p for p in injection.PERIODS if p >= 20.0)
    assert injection.usable_periods(T.size - 1, FS) == injection.PERIODS[:-1]


def test_the_sum_of_sines_has_each_line_once_and_no_great_crest():
    rate = injection.sines(T, injection.PERIODS, [SIZE] * len(injection.PERIODS))
    assert np.mean(rate**2) == pytest.approx(len(injection.PERIODS) * SIZE**2 / 2.0, rel=0.02, abs=0.0)
    assert np.abs(rate).max() < 0.9 * len(injection.PERIODS) * SIZE


def test_line_gains_of_a_first_order_lag_are_its_transfer_function():
    """Independent: the closed form of y_k = a y_{k-1} + (1 - a) x_k on the unit circle; the start dies out in a short
    record's beginning.
    """
    a = 0.95
    periods, sizes = (10.0, 60.0, 600.0, 3600.0), (SIZE, 2.0 * SIZE, SIZE, 5.0 * SIZE)
    out = lfilter([1.0 - a], [1.0, -a], injection.sines(T, periods, sizes))
    expected = [(1.0 - a) / (1.0 - a * np.exp(-2j * np.pi / p)) for p in periods]
    for line, value in zip(injection.line_gains(out, FS, periods, sizes), expected, strict=True):
        # The transient of 20 s in 43200 s is worth at most 20/43200 of the amplitudes' sum in each line.
        assert line.gain == pytest.approx(abs(value), abs=2.0 * 20.0 * 9.0 / 43_200)
        assert line.phase == pytest.approx(np.angle(value), abs=0.03)


def test_the_survivor_of_a_linear_compensation_does_not_depend_on_the_record():
    noise = record(np.random.default_rng(3).normal(0.0, 1e-6, T.size))
    known = injection.step(T, SIZE)

    def half(of):
        return 0.5 * of.rate

    survived = injection.survivor(half, noise, half(noise), known)
    np.testing.assert_allclose(survived, 0.5 * known, atol=1e-20)
    assert injection.pattern_gain(survived, known) == pytest.approx(0.5, rel=1e-9)


def test_earth_turns_show_the_vertical_component_once_up_and_once_down():
    rate = injection.earth_turns(T, latitude=np.pi / 6.0)
    np.testing.assert_allclose(np.unique(rate), 7.292115e-5 * np.array([-0.5, 0.0, 0.5]), rtol=1e-12)
    assert rate.mean() == pytest.approx(0.0, abs=1e-20)
    # Up, east, down, west, twice: eight stations of equal length, up first.
    stations = rate.reshape(8, -1)
    assert np.ptp(stations, axis=1).max() == 0.0
    np.testing.assert_array_equal(np.sign(stations[:, 0]), [1, 0, -1, 0, 1, 0, -1, 0])


def test_what_follows_the_temperature_is_a_line_in_it():
    heat = 300.0 + np.random.default_rng(4).standard_normal(1000)
    rate = injection.heat_rate(heat, 2e-7)
    # The mean of temperatures of 300 K is known to eps * 300 K.
    assert rate.mean() == pytest.approx(0.0, abs=1e-18)
    assert rate.std() == pytest.approx(2e-7, rel=1e-12, abs=0.0)
    assert np.corrcoef(rate, heat)[0, 1] == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("order", [1, 2, 4])
def test_the_cutoff_of_a_low_pass_is_found_between_the_lines(order):
    corner = 1.0 / 150.0
    gains = [
        injection.LineGain(p, float((1.0 + (1.0 / p / corner) ** (2 * order)) ** -0.5), 0.0) for p in injection.PERIODS
    ]
    # Straight in the logarithms between lines at most a factor of three apart: the curve bends by less than 15 %.
    assert injection.cutoff(gains) == pytest.approx(corner, rel=0.15)


def test_no_cutoff_where_short_periods_pass_or_none_does():
    lines = [injection.LineGain(p, 1.0, 0.0) for p in injection.PERIODS]
    assert injection.cutoff(lines) is None
    assert injection.cutoff([injection.LineGain(p, 0.2, 0.0) for p in injection.PERIODS]) is None
    leak = [injection.LineGain(p, 0.1 if p > 3000.0 else 1.0, 0.0) for p in injection.PERIODS]
    assert injection.cutoff(leak) is None
