"""The bank's own steps against the matrix equations."""

from __future__ import annotations

import numpy as np
import pytest

from testbed.fusion.filters.wideband import _columns
from testbed.fusion.kernels.bank import bank_kernel
from testbed.fusion.kernels.covariance import CONVENTIONAL, JOSEPH, LOST_VARIANCE, SQUARE_ROOT
from testbed.fusion.model import covariance_root
from testbed.fusion.transitions import even


@pytest.mark.oracle
@pytest.mark.parametrize("form", [JOSEPH, CONVENTIONAL, SQUARE_ROOT])
def test_a_rate_that_is_lost_goes_back_as_if_read_at_zero(form: int) -> None:
    """In each filter of the bank for itself, as in a single one: the Kalman update with z = 0 and R = V P / (P - V)."""
    n, steps, F, H = 2, 5, np.array([[1.0, 0.5], [0.0, 1.0]]), np.array([[1.0, 0.0]])
    noises = [np.diag([0.1, 0.2]), np.diag([1e-3, 1e-3])]
    start_P, start_x = np.array([[0.3, 0.1], [0.1, 0.1]]), np.array([0.3, 2.0])

    expected = []
    for Q in noises:
        x, P, lost = start_x.copy(), start_P.copy(), 0
        for _ in range(steps):
            x, P = F @ x, F @ P @ F.T + Q
            spread = P[0, 0]
            if spread > LOST_VARIANCE:
                lost += 1
                K = P[:, :1] / (spread + LOST_VARIANCE * spread / (spread - LOST_VARIANCE))
                x, P = x - K[:, 0] * x[0], P - K @ (H @ P)
        expected.append((x, P, lost))
    # The fast one sooner: each by its own variance.
    assert expected[0][2] > expected[1][2] > 0

    carry = covariance_root if form == SQUARE_ROOT else np.copy
    x, P = np.repeat(start_x[:, None], 2, axis=1), np.repeat(carry(start_P)[:, :, None], 2, axis=2)
    Q = np.ascontiguousarray(np.stack([carry(one) for one in noises], axis=2))
    mixing = np.zeros(2), np.zeros((1, 2)), np.array([1.0, 0.9, 10.0, 10.0, 20.0]), np.zeros(2)
    clocked, Z, out = even(F, Q, noises[0]), np.full((1, steps), np.nan), np.empty((6, steps))
    matrices = F, _columns(F), Q, noises[0], H, _columns(H), np.array([1.0])
    bank_kernel(n, 1, 2, form)(x, P, *matrices, Z, clocked, *mixing, out)
    for m, (state, covariance, _) in enumerate(expected):
        left = P[:, :, m]
        left = left @ left.T if form == SQUARE_ROOT else np.tril(left) + np.tril(left, -1).T
        np.testing.assert_allclose(left, covariance, rtol=1e-12)
        np.testing.assert_allclose(x[:, m], state, rtol=1e-12)
