"""The link's closed forms against a drawn beam."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from testbed.pointing.link import mean_loss, outage


@pytest.mark.oracle
@pytest.mark.parametrize("ratio", [0.1, 0.3, 0.7])
def test_mean_loss_and_outage_are_those_of_a_million_draws(ratio, rng):
    n, w, level = 1_000_000, 20e-6, 10.0**-0.3
    r2 = np.sum((ratio * w * rng.standard_normal((2, n))) ** 2, axis=0)
    power = np.exp(-2.0 * r2 / w**2)
    # Six standard errors of the mean.
    assert_allclose(mean_loss(ratio * w, w), power.mean(), atol=6.0 * power.std() / n**0.5)
    p = outage(ratio * w, w, level)
    assert_allclose(np.mean(power < level), p, atol=6.0 * (p * (1.0 - p) / n) ** 0.5 + 1e-9)


def test_without_jitter_nothing_is_lost():
    assert mean_loss(0.0, 1e-5) == 1.0
    assert outage(0.0, 1e-5, 0.5) == 0.0
