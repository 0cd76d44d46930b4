"""Errors with one in common, made independent."""

from __future__ import annotations

import numpy as np
import pytest

from testbed.fusion.analysis.whitening import parts, whitened


@pytest.mark.oracle
def test_the_covariance_becomes_the_identity(rng):
    """W (I + u u') W' = I, with W from the whitening of the identity's columns."""
    u = 3.0 * rng.standard_normal(7)
    W = whitened(np.eye(7), u)
    np.testing.assert_allclose(W @ (np.eye(7) + np.outer(u, u)) @ W.T, np.eye(7), atol=1e-13)
    row = rng.standard_normal(7)
    np.testing.assert_allclose(whitened(row, u), W @ row, atol=1e-13)


def test_without_a_common_error_rows_stay():
    row = np.arange(3.0)
    assert whitened(row, np.zeros(3)) is row


def test_parts_of_complex_rows():
    np.testing.assert_array_equal(parts(np.array([1.0 + 2.0j, 3.0 - 4.0j])), [1.0, 3.0, 2.0, -4.0])
