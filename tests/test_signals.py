"""Difference equations against SciPy's, which is not loaded for them when a command starts."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from testbed.signals import Recursion

EPS = np.finfo(float).eps
# A low-pass of one pole with four taps, real and complex; a sum of samples without a pole; a fading mean.
CASES = {
    "real": ([0.1, 0.3, -0.2, 0.05], [1.0, -0.7]),
    "complex": ([0.1 + 0.2j, 0.3, -0.2j, 0.05], [1.0, -0.6 + 0.3j]),
    "taps": ([0.25, 0.5, 0.25], [1.0]),
    "fading": ([1.0, 0.0], [1.0, -0.75]),
    "pole": ([0.25], [1.0, -0.75]),
    "gain": ([2.0], [1.0]),
}


@pytest.mark.oracle
@pytest.mark.parametrize("name", CASES)
def test_a_recursion_is_scipys_whatever_the_blocks(name):
    b, a = map(np.array, CASES[name])
    u = np.random.default_rng(5).standard_normal(3000)
    at_once = Recursion(b, a)
    whole = at_once.process(u)
    in_blocks = Recursion(b, a)
    parts = [in_blocks.process(part) for part in np.split(u, [0, 1, 8, 1000])]
    assert np.array_equal(np.concatenate(parts), whole)
    assert np.array_equal(in_blocks.state, at_once.state)
    expected = lfilter(b, a, u)
    # Eight roundings a step at most, which the pole lets last four steps.
    np.testing.assert_allclose(whole, expected, rtol=0.0, atol=32 * EPS * np.max(np.abs(expected)))


def test_a_recursion_starts_from_the_state_that_is_set():
    """A mean over two samples that has seen ones for ever."""
    mean = Recursion(np.array([0.5, 0.5]), np.ones(1))
    mean.state[:] = 0.5
    assert mean.process(np.array([1.0, 3.0])).tolist() == [1.0, 2.0]
