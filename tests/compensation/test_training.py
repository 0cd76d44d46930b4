"""TrainingRows, folds and the polynomial, against numpy and brute-force refits."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import block_diag, solve_triangular

from testbed.compensation.features import Features
from testbed.compensation.flicker import noise_root, whiten
from testbed.compensation.polynomial import Polynomial, likeliest_ridge, penalised, ridge_residuals
from testbed.compensation.record import GyroRecord
from testbed.compensation.training import block_means, fit_coloured, fit_polynomial, fit_process, gather
from tests.compensation.thermal_record import WHITE, flicker


def record(rng, n=30_000, sample_rate_hz=1.0, rate=1e-7):
    T = 293.15 + 20.0 * np.sin(np.arange(n) / 3000.0)
    return GyroRecord(rate + 1e-9 * rng.normal(size=n), T, sample_rate_hz)


@pytest.mark.oracle
def test_penalised_solves_the_normal_equations(rng):
    U, y, ridge = rng.normal(size=(80, 4)), rng.normal(size=80), np.array([0.0, 1.0, 2.0, 3.0])
    expected = np.linalg.solve(U.T @ U + np.diag(ridge), U.T @ y)
    assert np.allclose(penalised(U, y, ridge), expected, rtol=0.0, atol=1e-12)
    predicted = Polynomial(expected, 2.0).predict(U)
    assert np.allclose(predicted, U @ expected + 2.0, rtol=0.0, atol=1e-12)


@pytest.mark.oracle
def test_polynomial_block_residuals_are_those_of_refits(rng):
    U, y, ridge = rng.normal(size=(90, 4)), rng.normal(size=90) + 3.0, np.array([0.0, 0.9, 0.9, 0.9])
    blocks = [slice(0, 20), slice(20, 65), slice(65, 90)]
    expected = np.empty(90)
    for block in blocks:
        rest = np.delete(np.arange(90), block)
        expected[block] = y[block] - U[block] @ penalised(U[rest], y[rest], ridge)
    assert np.allclose(ridge_residuals(U, y, ridge, blocks), expected, rtol=0.0, atol=1e-11)


@pytest.mark.oracle
def test_whitened_least_squares_is_generalised_least_squares(rng):
    """(U'C^-1 U)^-1 U'C^-1 y with the covariance of both cycles in one matrix."""
    Z, y, cycles = rng.normal(size=(70, 2)), rng.normal(size=70), [slice(0, 30), slice(30, 70)]
    C = block_diag(*(L @ L.T for L in (noise_root(30, 1.7), noise_root(40, 1.7))))
    U = np.column_stack([np.arange(70) < 30, np.arange(70) >= 30, Z]).astype(float)
    expected = np.linalg.solve(U.T @ np.linalg.solve(C, U), U.T @ np.linalg.solve(C, y))
    assert np.allclose(penalised(*whiten(Z, y, cycles, 1.7), np.zeros(4)), expected, rtol=0.0, atol=1e-10)


@pytest.mark.oracle
def test_whitening_makes_the_noise_of_a_gyro_white(rng):
    """Flicker drawn in frequency by the tests' generator, means over 100 s; autocorrelations of n white values spread
    by 1/sqrt(n).
    """
    n = 85_200
    rows = block_means(WHITE * rng.normal(size=n) + flicker(n, rng), 100)
    white = solve_triangular(noise_root(rows.size, 1.7), rows - rows.mean(), lower=True)
    for lag in (1, 2, 5, 20, 100):
        assert abs(np.corrcoef(white[lag:], white[:-lag])[0, 1]) < 4.0 / np.sqrt(rows.size)
    assert np.corrcoef(rows[1:], rows[:-1])[0, 1] > 0.5


@pytest.mark.parametrize("noise", [1e-9, 0.0])
def test_features_that_determine_nothing_get_no_weight(rng, noise):
    """A chamber that never moved: only rounding is left of every feature, and the drift is zero; also of a rate that
    never moved.
    """
    still = GyroRecord(1e-7 + noise * rng.normal(size=30_000), np.full(30_000, 300.0), 1.0)
    rows = gather([still], Features(plays=(3.0,)), block=7200.0)
    for fit in (fit_polynomial, fit_coloured, fit_process):
        assert np.allclose(fit(rows)[0].weights, 0.0, rtol=0.0, atol=1e-15)


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


@pytest.mark.oracle
def test_the_likeliest_ridge_is_the_top_of_the_likelihood_of_a_gaussian_process(rng):
    """-2 ln L from the covariance of the target itself, rows by rows, noise variance at its best, no projection and no
    identity.
    """
    U, group = rng.normal(size=(60, 5)), np.array([-1, 0, 0, 1, 1])
    U[:, 0] = 1.0
    y = U @ np.array([7.0, 1.0, -2.0, 0.2, -0.1]) + rng.normal(size=60)

    def unlikelihood(ridge):
        # The constant's flat prior by an orthonormal complement: contrasts do not see it.
        contrasts = np.linalg.svd(U[:, :1])[0][:, 1:].T
        free = contrasts @ U[:, 1:]
        covariance = np.eye(59) + free / ridge[1:] @ free.T
        seen = contrasts @ y
        return 59 * np.log(seen @ np.linalg.solve(covariance, seen)) + np.linalg.slogdet(covariance)[1]

    found = likeliest_ridge(U, y, group)
    assert found[0] == 0.0
    assert found[1] == found[2] < found[3] == found[4]
    for other in (0, 1):
        for factor in (0.9, 1.1):
            assert unlikelihood(np.where(group == other, factor * found, found)) > unlikelihood(found)


def test_the_process_has_a_prior_for_hysteresis_alone(rng):
    """A drift by temperature without hysteresis; the groups from the names of the features. With one group the weights
    differ.
    """
    features = Features(lags=(), plays=(3.0, 10.0))
    still = record(rng)
    moved = GyroRecord(still.rate + 1e-9 * (still.temperature - 293.15), still.temperature, 1.0)
    rows = gather([moved, moved], features, block=7200.0)
    U, v = whiten(rows.Z, rows.y, rows.cycles, 1.7)
    group = np.array([-1, -1, *(int(name.startswith("play")) for name in features.names)])
    expected, alone = (penalised(U, v, likeliest_ridge(U, v, each))[2:] for each in (group, np.minimum(group, 0)))
    # Both searches stop near a flat top: a corner of 1.7 and of 100 x 0.017 differ by rounding, prior variances by some
    # 10 %.
    assert np.allclose(fit_process(rows)[0].weights, expected, rtol=0.0, atol=1e-4 * np.abs(expected).max())
    assert np.abs(expected[-2:]).max() < 0.5 * np.abs(alone[-2:]).max()
