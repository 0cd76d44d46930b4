"""Transforms of two clocks meet at the same true frequencies."""

from __future__ import annotations

import numpy as np
import pytest

from testbed.identification.spectrum import RecordGrid, Series, spectrum


@pytest.mark.oracle
@pytest.mark.parametrize("clock", [0.0, 1.5e-3, -2e-3])
def test_the_transform_is_the_sum_that_it_says(rng, clock):
    series, grid = Series(rng.standard_normal(500), 0.013, 100.0), RecordGrid(0.1, 4.0, 150)
    step = (1.0 + clock) / 100.0
    own = 0.013 + np.arange(500) / 100.0
    inside = np.flatnonzero((1.0 + clock) * own >= 0.1)[: round(4.0 / step)]
    t = (1.0 + clock) * own[inside]
    kernel = np.exp(-2j * np.pi * grid.freq_hz[:, None] * (t - 0.1))
    X, slope = spectrum(series, grid, clock)
    # Chirps of 500 samples turn by some thousand radians: eps times that.
    np.testing.assert_allclose(X, step * kernel @ series.values[inside], atol=1e-10)
    wanted = -2j * np.pi * grid.freq_hz * step * (kernel @ (own[inside] * series.values[inside]))
    np.testing.assert_allclose(slope, wanted, atol=1e-7)


@pytest.mark.oracle
def test_the_slope_is_the_derivative_by_the_clock(rng):
    series, grid, d = Series(rng.standard_normal(400), 0.0, 100.0), RecordGrid(0.0, 3.5, 100), 1e-7
    up, down = (spectrum(series, grid, 1e-4 + one)[0] / (1.0 + 1e-4 + one) for one in (d, -d))
    slope = spectrum(series, grid, 1e-4)[1] / (1.0 + 1e-4)
    # Second order in d: (2 pi f t)^3 d^2 / 6 is 1e-6 of it; rounding over d is 1e-7.
    np.testing.assert_allclose((up - down) / (2.0 * d), slope, rtol=1e-5, atol=1e-5 * np.abs(slope).max())


@pytest.mark.oracle
def test_the_rate_of_an_angle_is_its_derivative():
    t, freq = np.arange(4000) / 1000.0, 7.25
    rate = Series(np.cos(2.0 * np.pi * freq * t), 0.0, 1000.0)
    angle = Series(np.sin(2.0 * np.pi * freq * t) / (2.0 * np.pi * freq), 0.0, 1000.0, is_angle=True)
    grid = RecordGrid(0.0, 4.0, 100)
    first, second = (spectrum(one, grid)[0] for one in (rate, angle))
    # Whole periods: nothing at the ends.
    np.testing.assert_allclose(first[28], second[28], rtol=1e-9)
