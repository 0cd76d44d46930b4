"""The adaptive filter with random weights against a loop of plain Python, and against the Kalman filter it adapts."""

import numpy as np
import pytest

from testbed.compensation.fading import choose_ratio, fading_memory, steady_gain
from testbed.compensation.random_weighting import random_weighting
from testbed.signals import random_stream


def walk(n, seed, q=0.02):
    """Return a random walk of steps sqrt(q) in white noise of one."""
    rng = np.random.default_rng(seed)
    level = np.cumsum(np.sqrt(q) * rng.standard_normal(n))
    return level, level + rng.standard_normal(n)


def plain(z, window, short, limit, seed):
    """Return the estimate sample by sample, the window as a list, newest first."""
    q = choose_ratio(z)
    R = np.mean(fading_memory(z, 1.0, q)[1] ** 2) * (1.0 - steady_gain(1.0, q))
    weights = random_stream(seed, "random weighting").standard_exponential((997, window))
    weights /= weights.sum(axis=1, keepdims=True)
    squares, recent = [R] * window, [0.0] * short
    x, P, out = z[0], R, []
    for k, reading in enumerate(z):
        prior, e = P + q * R, reading - x
        squares, recent = [e * e, *squares[:-1]], [e, *recent[:-1]]
        C = float(np.dot(weights[k % 997], squares))
        moved = sum(recent) / short
        if k >= short and moved**2 * short > limit**2 * (prior + R):
            prior = max(prior, moved**2)
        K = min(prior / max(C, prior), 1.0)
        x, P = x + K * e, (1.0 - K) * prior
        out.append(x)
    return np.array(out)


@pytest.mark.oracle
@pytest.mark.parametrize(("window", "short", "limit"), [(50, 10, 4.0), (7, 3, 1.0)])
def test_the_kernel_is_the_loop(window, short, limit):
    z = walk(1500, 3)[1]
    found = random_weighting(z, window=window, short=short, limit=limit, seed=5)
    # Sums in another order.
    np.testing.assert_allclose(found, plain(z, window, short, limit, 5), rtol=0.0, atol=1e-10)


def test_on_what_it_believes_it_is_nearly_the_kalman_filter():
    """The window's covariance scatters by sqrt(2 * 2 / 50) = 28 %, and with it the gain by half of that: second order
    in the error.
    """
    level, z = walk(20_000, 4)
    error = np.std(random_weighting(z) - level)
    best = np.std(fading_memory(z, 1.0, 0.02)[0] - level)
    assert best <= error < 1.1 * best


def test_after_a_jump_it_catches_up_within_the_moving_average():
    rng = np.random.default_rng(6)
    level = np.where(np.arange(4000) < 2000, 0.0, 30.0)
    z = level + rng.standard_normal(4000)
    adapted = random_weighting(z, short=10)
    # Twenty samples after it: without the second factor, a gain of the slow filter would have most of it still to go.
    assert abs(adapted[2020:2060].mean() - 30.0) < 1.5
    deaf = random_weighting(z, short=10, limit=1e9)
    assert abs(deaf[2000:2020].mean() - 30.0) > abs(adapted[2000:2020].mean() - 30.0)


def test_a_seed_is_its_weights():
    z = walk(500, 8)[1]
    np.testing.assert_array_equal(random_weighting(z, seed=1), random_weighting(z, seed=1))
    assert np.any(random_weighting(z, seed=1) != random_weighting(z, seed=2))


@pytest.mark.parametrize("wrong", [{"window": 0}, {"short": 0}, {"limit": 0.0}, {"limit": np.inf}])
def test_numbers_that_are_none_are_refused(wrong):
    with pytest.raises(ValueError, match="expected positive numbers"):
        random_weighting(np.arange(20.0), **wrong)
