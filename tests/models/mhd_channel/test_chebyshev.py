"""Grid, second derivative and mean: exactness on polynomials, symmetry, known weights."""

from __future__ import annotations

import numpy as np
import pytest

from testbed.models.mhd_channel.chebyshev import (
    chebyshev_points,
    clenshaw_curtis,
    derivatives,
    even_operators,
    even_transport,
)

EPS = np.finfo(float).eps


@pytest.mark.parametrize("intervals", [8, 64, 160, 512])
def test_points_ascend_from_wall_to_wall_and_are_symmetric_to_the_bit(intervals: int) -> None:
    x = chebyshev_points(intervals)
    assert x.shape == (intervals + 1,)
    assert (x[0], x[intervals // 2], x[-1]) == (0.0, pytest.approx(0.5, abs=EPS), 1.0)
    assert np.all(np.diff(x) > 0.0)
    # 1 - x rounds once more, hence the last bit of 1.
    np.testing.assert_allclose(x + x[::-1], 1.0, rtol=0, atol=EPS)
    # Chebyshev points are the extrema of cos(n arccos(1 - 2x)).
    extrema = np.cos(intervals * np.arccos(1.0 - 2.0 * x[1:-1]))
    np.testing.assert_allclose(np.abs(extrema), 1.0, atol=1e-9)


@pytest.mark.oracle
@pytest.mark.parametrize("intervals", [8, 64, 160])
@pytest.mark.parametrize("degree", [0, 1, 2, 3, 5, 8])
def test_second_derivative_is_exact_on_polynomials(intervals: int, degree: int) -> None:
    x = chebyshev_points(intervals)
    expected = degree * (degree - 1) * x ** max(degree - 2, 0)
    matrix = derivatives(intervals)[1]
    # Entries and sums round to eps of the largest row sum; the values are at most 1.
    bound = 4 * EPS * np.abs(matrix).sum(axis=1).max()
    np.testing.assert_allclose(matrix @ x**degree, expected, rtol=0, atol=bound)
    assert bound < 1e-5


@pytest.mark.oracle
def test_second_derivative_converges_spectrally_on_a_boundary_layer() -> None:
    layer = 0.05
    errors = []
    for intervals in (8, 16, 32):
        x = chebyshev_points(intervals)
        u = np.exp(-x / layer)
        errors.append(np.max(np.abs(layer**2 * (derivatives(intervals)[1] @ u) - u)))
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    # No algebraic order describes it: each doubling gains more digits than the one before.
    assert orders[1] > 2 * orders[0] > 10.0


@pytest.mark.oracle
@pytest.mark.parametrize("intervals", [8, 64, 160, 512])
def test_mean_is_exact_on_polynomials_of_the_grids_degree(intervals: int) -> None:
    w, x = clenshaw_curtis(intervals), chebyshev_points(intervals)
    assert np.all(w > 0.0)
    for degree in (0, 1, 2, 7, intervals):
        # Sum of n + 1 positive terms of at most weight 1.
        assert w @ x**degree == pytest.approx(1.0 / (degree + 1), abs=4 * intervals * EPS)
    assert w[0] == pytest.approx(0.5 / (intervals**2 - 1), abs=4 * EPS)


@pytest.mark.oracle
def test_clenshaw_curtis_of_four_intervals_has_the_textbook_weights() -> None:
    np.testing.assert_allclose(clenshaw_curtis(4), np.array([1.0, 8.0, 12.0, 8.0, 1.0]) / 30.0, rtol=0, atol=4 * EPS)


@pytest.mark.oracle
@pytest.mark.parametrize("intervals", [8, 64, 160])
def test_even_operators_act_as_the_full_ones_on_even_flow(intervals: int) -> None:
    second, mean = even_operators(intervals)
    assert second.shape == (intervals // 2, intervals // 2)
    h = chebyshev_points(intervals)[1 : intervals // 2 + 1]
    # Poiseuille profile: second derivative -2, mean 1/6.
    flow = h * (1.0 - h)
    np.testing.assert_allclose(second @ flow, -2.0, rtol=0, atol=EPS * intervals**4)
    assert mean @ flow == pytest.approx(1.0 / 6.0, abs=4 * intervals * EPS)


@pytest.mark.oracle
def test_even_operators_have_the_eigenvalues_of_the_heat_equation() -> None:
    second, _ = even_operators(160)
    values = np.sort(-np.linalg.eigvals(second))
    odd = np.arange(1, 40, 2)
    # Up to about 2n/pi points per half-wave the spectrum is the true one; rounding is eps times the largest eigenvalue.
    np.testing.assert_allclose(values[:20], (np.pi * odd) ** 2, rtol=0, atol=EPS * values[-1] * 10)


@pytest.mark.oracle
@pytest.mark.parametrize("intervals", [8, 64, 160])
def test_slope_and_integral_are_exact_on_an_even_polynomial(intervals: int) -> None:
    half = intervals // 2
    x = chebyshev_points(intervals)[1 : half + 1]
    slope, integral = even_transport(intervals)
    # f = x (1 - x) is even about the centre and zero at the walls.
    bound = 4 * EPS * np.abs(slope).sum(axis=1).max()
    np.testing.assert_allclose(slope @ (x * (1 - x)), 1 - 2 * x, rtol=0, atol=bound)
    np.testing.assert_allclose(integral @ (x * (1 - x)), x**2 / 2 - x**3 / 3, rtol=0, atol=1e3 * EPS)
    assert bound < 1e-9
