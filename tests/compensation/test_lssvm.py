"""LSSVM against a dense solve, the primal problem, kernel ridge regression and brute-force refits."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize

from testbed.compensation.lssvm import Lssvm, kernel_residuals

GAMMA, WIDTH2 = 30.0, 2.0


@pytest.fixture
def rows(rng):
    X = rng.normal(size=(60, 3))
    return X, np.sin(X[:, 0]) + 0.3 * X[:, 1] ** 2 + 5.0 + 0.05 * rng.normal(size=60)


def kernel(A, B):
    return np.array([[np.exp(-np.sum((a - b) ** 2) / (2.0 * WIDTH2)) for b in B] for a in A])


def dense(X, y):
    """Solve equation (20) as it stands; return b and a."""
    n = y.size
    system = np.zeros((n + 1, n + 1))
    system[0, 1:] = system[1:, 0] = 1.0
    system[1:, 1:] = kernel(X, X) + np.eye(n) / GAMMA
    solution = np.linalg.solve(system, np.concatenate([[0.0], y]))
    return solution[0], solution[1:]


@pytest.mark.oracle
def test_fit_solves_the_bordered_system(rows, rng):
    X, y = rows
    bias, weights = dense(X, y)
    machine = Lssvm.fit(X, y, GAMMA, WIDTH2)
    new = rng.normal(size=(40, 3))
    # The condition number is below n gamma = 2e3: 1e-12 leaves three digits.
    assert machine.bias == pytest.approx(bias, rel=1e-12)
    assert np.allclose(machine.weights, weights, rtol=0.0, atol=1e-11)
    assert np.allclose(machine.predict(new), kernel(new, X) @ weights + bias, rtol=0.0, atol=1e-11)


@pytest.mark.oracle
def test_fit_is_the_minimum_of_the_primal_problem(rows):
    """Over f = K c + b, |w|^2 = c'Kc: a general minimiser of equation (11) finds the same bias and no lower value."""
    X, y = rows
    K = kernel(X, X)

    def cost(p):
        e = y - K @ p[1:] - p[0]
        return 0.5 * p[1:] @ K @ p[1:] + 0.5 * GAMMA * e @ e

    def slope(p):
        e = y - K @ p[1:] - p[0]
        return np.concatenate([[-GAMMA * e.sum()], K @ (p[1:] - GAMMA * e)])

    found = minimize(cost, np.zeros(y.size + 1), jac=slope, method="BFGS", options={"gtol": 1e-8, "maxiter": 2000})
    machine = Lssvm.fit(X, y, GAMMA, WIDTH2)
    ours = cost(np.concatenate([[machine.bias], machine.weights]))
    assert ours == pytest.approx(found.fun, rel=1e-6)
    assert machine.bias == pytest.approx(found.x[0], abs=1e-3)


@pytest.mark.oracle
def test_lssvm_is_kernel_ridge_regression_plus_a_free_bias(rows):
    """KernelRidge of y - b is the same machine; of y itself it is not: it pulls the mean of 5 towards zero."""
    kernel_ridge = pytest.importorskip("sklearn.kernel_ridge").KernelRidge
    X, y = rows
    machine = Lssvm.fit(X, y, GAMMA, WIDTH2)
    ridge = kernel_ridge(alpha=1.0 / GAMMA, kernel="rbf", gamma=1.0 / (2.0 * WIDTH2))
    assert np.allclose(ridge.fit(X, y - machine.bias).predict(X) + machine.bias, machine.predict(X), rtol=0, atol=1e-10)
    far = np.full((1, 3), 30.0)
    assert ridge.fit(X, y).predict(far)[0] == pytest.approx(0.0, abs=1e-12)
    assert machine.predict(far)[0] == pytest.approx(machine.bias, rel=1e-15)


@pytest.mark.oracle
def test_residuals_of_blocks_of_one_row_are_those_of_refits(rows):
    X, y = rows
    keep = [np.arange(y.size) != k for k in range(y.size)]
    refits = [y[k] - Lssvm.fit(X[rest], y[rest], GAMMA, WIDTH2).predict(X[[k]])[0] for k, rest in enumerate(keep)]
    single = [slice(k, k + 1) for k in range(y.size)]
    assert np.allclose(kernel_residuals(X, y, GAMMA, WIDTH2, single), refits, rtol=0.0, atol=1e-11)


@pytest.mark.oracle
def test_block_residuals_are_those_of_refits(rows):
    X, y = rows
    blocks = [slice(0, 7), slice(7, 31), slice(31, 60)]
    expected = np.empty(y.size)
    for block in blocks:
        rest = np.delete(np.arange(y.size), block)
        expected[block] = y[block] - Lssvm.fit(X[rest], y[rest], GAMMA, WIDTH2).predict(X[block])
    assert np.allclose(kernel_residuals(X, y, GAMMA, WIDTH2, blocks), expected, rtol=0.0, atol=1e-10)


@pytest.mark.property
def test_scale_and_offset_of_the_target_pass_through(rows):
    """Targets are rates of 1e-7 rad/s: nothing may depend on their size."""
    X, y = rows
    small = Lssvm.fit(X, 1e-9 * y + 3.0, GAMMA, WIDTH2)
    # 3 + 1e-9 keeps seven digits of the small part.
    assert np.allclose((small.predict(X) - 3.0) * 1e9, Lssvm.fit(X, y, GAMMA, WIDTH2).predict(X), rtol=0, atol=1e-5)


@pytest.mark.parametrize(
    ("gamma", "width2", "X", "y", "name"),
    [
        (0.0, 1.0, np.ones((3, 1)), np.ones(3), "gamma"),
        (1.0, np.nan, np.ones((3, 1)), np.ones(3), "width2"),
        (1.0, 1.0, np.ones((3, 1)), np.ones(4), "shapes"),
        (1.0, 1.0, np.full((3, 1), np.nan), np.ones(3), "finite"),
    ],
)
def test_bad_input_is_refused(gamma, width2, X, y, name):
    with pytest.raises(ValueError, match=name):
        Lssvm.fit(X, y, gamma, width2)
