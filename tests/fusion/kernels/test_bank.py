"""The steps of the bank in root form against those of a single filter, and the filters that start again."""

from __future__ import annotations

import numpy as np
import pytest

from testbed.fusion.kernels.bank import innovate_root_bank, predict_root_bank, start_again, update_root_bank
from testbed.fusion.kernels.covariance import gain_root, predict_root, update_root
from testbed.signals import random_stream


@pytest.mark.oracle
def test_root_steps_of_the_bank_are_those_of_one_filter() -> None:
    rng, n, M, R = random_stream(9, "bank"), 4, 3, 0.3
    F, h, z = rng.standard_normal((n, n)), rng.standard_normal(n), 0.7
    F[0, 2], h[1] = 0.0, 0.0
    x, D, S = rng.standard_normal((n, M)), rng.standard_normal((n, n, M)), rng.standard_normal((n, n, M))
    S = S * np.tri(n)[:, :, None]
    # A filter that starts certain, and does not lose it: rows of zeros.
    D[:, :, 2] = S[:, :, 2] = 0.0
    D *= 0.1
    ones = [(x[:, m].copy(), D[:, :, m].copy(), np.ascontiguousarray(S[:, :, m])) for m in range(M)]
    nonzero, seen = np.zeros((n, n + 1), np.int64), np.zeros(n + 1, np.int64)
    for row, values in zip((*nonzero, seen), (*F, h), strict=True):
        (at,) = np.nonzero(values)
        row[: at.size], row[-1] = at, at.size
    total, spread, e, g = np.empty(M), np.empty(M), np.empty(M), np.empty((n, M))
    predict_root_bank(x, D, F, nonzero, S, np.empty((n, 2 * n, M)), np.empty((n, M)), np.empty(M), total, n, M)
    innovate_root_bank(x, D, h, seen, z, e, spread, g, n, M)
    update_root_bank(x, D, R, e, spread, g, total, n, M)
    for m, (x_one, D_one, S_one) in enumerate(ones):
        predict_root(x_one, D_one, F, S_one, np.empty((n, 2 * n)), np.empty(n), n)
        error, due, G, K = np.array([z - h @ x_one]), np.array([True]), np.empty((1, n)), np.empty((n, 1))
        assert e[m] == pytest.approx(error[0], abs=1e-14)
        assert spread[m] == pytest.approx(float(h @ D_one @ D_one.T @ h), abs=1e-14)
        gain_root(x_one, D_one, h[None], error, np.array([R]), due, G, np.empty((1, 1)), K, n, 1)
        update_root(D_one, G, K, np.array([R]), due, n, 1)
        np.testing.assert_allclose(x[:, m], x_one, rtol=0, atol=1e-13)
        np.testing.assert_allclose(D[:, :, m] @ D[:, :, m].T, D_one @ D_one.T, rtol=0, atol=1e-13)


def test_only_slower_and_far_less_likely_filters_start_again() -> None:
    n, M = 2, 4
    x, P = np.arange(8.0).reshape(n, M), np.arange(16.0).reshape(n, n, M)
    before = x.copy(), P.copy()
    start_again(x, P, np.array([-30.0, -19.0, 0.0, -50.0]), 20.0, n, M)
    for now, old in zip((x, P), before, strict=True):
        assert np.array_equal(now[..., 0], old[..., 2])
        assert np.array_equal(now[..., 1:], old[..., 1:])
