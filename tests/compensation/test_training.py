"""Rows, folds and the polynomial, against numpy and brute-force refits."""

from __future__ import annotations

import numpy as np
import pytest

from testbed.compensation.features import Features
from testbed.compensation.polynomial import Polynomial, block_residuals
from testbed.compensation.record import Record
from testbed.compensation.training import block_means, fit_polynomial, gather


def record(rng, n=30_000, sample_rate_hz=1.0, rate=1e-7):
    T = 293.15 + 20.0 * np.sin(np.arange(n) / 3000.0)
    return Record(rate + 1e-9 * rng.normal(size=n), T, sample_rate_hz)


@pytest.mark.oracle
def test_polynomial_is_ordinary_least_squares(rng):
    Z, y = rng.normal(size=(80, 3)) + 1.0, rng.normal(size=80)
    fitted = Polynomial.fit(Z, y)
    expected = np.linalg.solve(*(lambda U: (U.T @ U, U.T @ y))(np.column_stack([np.ones(80), Z])))
    assert np.allclose([fitted.bias, *fitted.weights], expected, rtol=0.0, atol=1e-12)
    assert np.allclose(fitted.predict(Z), np.column_stack([np.ones(80), Z]) @ expected, rtol=0.0, atol=1e-12)


@pytest.mark.oracle
def test_polynomial_block_residuals_are_those_of_refits(rng):
    """Refits keep the penalty n lambda of all n rows."""
    Z, y, penalty = rng.normal(size=(90, 4)), rng.normal(size=90) + 3.0, 0.01
    blocks = [slice(0, 20), slice(20, 65), slice(65, 90)]
    expected = np.empty(90)
    for block in blocks:
        rest = np.delete(np.arange(90), block)
        refit = Polynomial.fit(Z[rest], y[rest], penalty * 90 / rest.size)
        expected[block] = y[block] - refit.predict(Z[block])
    assert np.allclose(block_residuals(Z, y, penalty, blocks), expected, rtol=0.0, atol=1e-11)


def test_features_that_determine_nothing_get_no_weight(rng):
    """A chamber that never moved: only rounding is left of every feature, and the drift is zero."""
    still = Record(1e-7 + 1e-9 * rng.normal(size=30_000), np.full(30_000, 300.0), 1.0)
    fitted, _ = fit_polynomial(gather([still], Features(), block=7200.0))
    assert np.allclose(fitted.weights, 0.0, rtol=0.0, atol=1e-15)


def test_rows_are_means_and_folds_stay_within_a_cycle(rng):
    cycles = [record(rng), record(rng, 45_050, rate=2e-7)]
    rows = gather(cycles, Features(), block=7200.0)
    assert rows.Z.shape == (300 + 450, len(Features().names))
    assert np.allclose(rows.y + rows.mean_rate, np.concatenate([block_means(c.rate, 100) for c in cycles]), atol=1e-20)
    # 30,000 s and 45,000 s in blocks of about two hours: four and six.
    assert [fold.stop - fold.start for fold in rows.folds] == [75] * 10
    assert [rows.folds[k].start for k in (0, 4)] == [0, 300]
    assert np.allclose(rows.Z.mean(axis=0), 0.0, rtol=0.0, atol=1e-9)


def test_a_limit_on_rows_makes_the_means_longer(rng):
    rows = gather([record(rng), record(rng)], Features(), block=7200.0, most=200)
    assert rows.y.size == 200


def test_cycles_that_cannot_be_blocked_are_refused(rng):
    for cycles in ([], [record(rng), record(rng, sample_rate_hz=2.0)], [record(rng, 14_000)]):
        with pytest.raises(ValueError, match="cycles"):
            gather(cycles, Features(), block=7200.0)
