"""Entropies against antropy, brute force and closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest

from testbed.compensation.entropy import (
    coarse_grain,
    multiscale_permutation_entropy,
    multiscale_sample_entropy,
    permutation_entropy,
    sample_entropy,
)


def test_coarse_graining_averages_whole_blocks():
    assert np.array_equal(coarse_grain(np.arange(1.0, 9.0), 3), [2.0, 5.0])
    assert np.array_equal(coarse_grain(np.arange(4.0), 1), np.arange(4.0))


@pytest.mark.oracle
@pytest.mark.parametrize("order", [3, 4, 5, 6])
@pytest.mark.parametrize("delay", [1, 3])
def test_permutation_entropy_is_antropys(order, delay):
    import antropy  # compiles for seconds

    rng = np.random.default_rng(order)
    for signal in (
        rng.standard_normal(2000),
        np.cumsum(rng.standard_normal(2000)),
        rng.integers(0, 4, 2000).astype(float),
    ):
        expected = antropy.perm_entropy(signal, order=order, delay=delay, normalize=True)
        assert permutation_entropy(signal, order=order, delay=delay) == pytest.approx(expected, rel=1e-12)


def test_permutation_entropy_of_known_orders():
    assert permutation_entropy(np.arange(50.0)) == 0.0
    # Long ups and downs in equal parts: two patterns at one half each, the turns aside (two patterns of each kind in a
    # thousand samples).
    zigzag = np.abs((np.arange(100_000) % 2000) - 1000.0)
    assert permutation_entropy(zigzag, order=4) == pytest.approx(math.log(2.0) / math.log(24.0), rel=0.05)
    # White noise: 1 less (m! - 1)/(2 N ln m!), the bias of an entropy by counts; its scatter is of the same order (2e-4
    # here).
    white = np.random.default_rng(1).standard_normal(20_000)
    assert permutation_entropy(white, order=4) == pytest.approx(1.0, abs=6.0 * 23 / (2 * 20_000 * math.log(24.0)))


def test_multiscale_permutation_entropy_is_that_of_the_block_means():
    signal = np.random.default_rng(2).standard_normal(3000)
    expected = [permutation_entropy(coarse_grain(signal, s), order=3) for s in (1, 4, 10)]
    assert multiscale_permutation_entropy(signal, (1, 4, 10), order=3).tolist() == expected


def brute_force(x, order, tolerance):
    """Count pairs as the definition has it."""
    n = x.size - order
    apart = np.abs(x[:, None] - x[None, :])
    agree = [np.all([apart[k : n + k, k : n + k] < tolerance for k in range(m)], axis=0) for m in (order, order + 1)]
    B, A = ((np.count_nonzero(a) - n) // 2 for a in agree)
    return -math.log(A / B)


@pytest.mark.oracle
@pytest.mark.parametrize("order", [1, 2, 3])
def test_sample_entropy_is_antropys_and_brute_force(order):
    import antropy

    rng = np.random.default_rng(order)
    for signal in (
        rng.standard_normal(600),
        np.cumsum(rng.standard_normal(600)),
        rng.integers(0, 4, 600).astype(float),
    ):
        tolerance = 0.5 * float(np.std(signal))
        value = sample_entropy(signal, tolerance, order=order)
        assert value == pytest.approx(antropy.sample_entropy(signal, order=order, tolerance=tolerance), rel=1e-12)
        assert value == pytest.approx(brute_force(signal, order, tolerance), rel=1e-12)


def test_multiscale_sample_entropy_of_white_noise_is_its_closed_form():
    """Two independent normal means of s samples agree within r sigma with probability erf(r sqrt(s) / 2), whatever came
    before.
    """
    white = np.random.default_rng(3).standard_normal(60_000)
    found = multiscale_sample_entropy(white, (10, 20, 60), tolerance=0.2)
    for value, scale in zip(found, (10, 20, 60), strict=True):
        p, n = math.erf(0.2 * math.sqrt(scale) / 2.0), 60_000 // scale
        # Scatter of A/B: the n values' own frequency of agreeing, sqrt((E[P^2] - p^2)/n)/p < 1/sqrt(n); six of it.
        assert value == pytest.approx(-math.log(p), abs=6.0 / math.sqrt(n))


def test_sample_entropy_where_nothing_agrees():
    assert math.isnan(sample_entropy(np.arange(20.0), 0.5))
    # 0, 1 comes again, what follows does not.
    assert sample_entropy(np.array([0.0, 1.0, 5.0, 0.0, 1.0, 9.0, 20.0]), 0.5) == math.inf
    assert sample_entropy(np.zeros(20), 0.5) == 0.0


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: coarse_grain(np.arange(3.0), 4), "scale: expected 1 to 3"),
        (lambda: coarse_grain(np.arange(3.0), 0), "scale: expected 1 to 3"),
        (lambda: permutation_entropy(np.arange(3.0)), "signal: expected more than 3"),
        (lambda: permutation_entropy(np.arange(9.0), order=1), "order, delay: expected"),
        (lambda: permutation_entropy(np.arange(9.0), delay=0), "order, delay: expected"),
        (lambda: permutation_entropy(np.full(9, np.nan)), "signal: expected finite"),
        (lambda: sample_entropy(np.arange(9.0), 0.0), "tolerance: expected"),
        (lambda: sample_entropy(np.arange(9.0), math.nan), "tolerance: expected"),
        (lambda: sample_entropy(np.arange(2.0), 1.0), "signal: expected more than 2"),
        (lambda: sample_entropy(np.arange(9.0), 1.0, order=0), "order, delay: expected"),
        (lambda: sample_entropy(np.full(9, np.nan), 1.0), "signal: expected finite"),
        (lambda: multiscale_sample_entropy(np.full(99, 2.0), [3]), "tolerance: expected"),
    ],
    ids=map(str, range(12)),
)
def test_bad_input_is_refused(call, message):
    with pytest.raises(ValueError, match=message):
        call()
