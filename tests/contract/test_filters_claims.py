"""The standard deviation that a filter claims is that of its error, or the filter says why not."""

from __future__ import annotations

import functools

import numpy as np
import pytest

from testbed.fusion.filters.kalman import Kalman
from tests.contract.records import BELIEF, METHODS, NAMES, RATES, readings_of, sines

SEEDS, LENGTH, SETTLE = 4, 3.0, 1.0
# Errors beyond twice the variance claimed are too confident: the factor that the reports allow. From a start at rest,
# as here, a filter that does not know it claims up to five times its error; more says nothing of it.
LOWEST, HIGHEST = 0.04, 2.0

pytestmark = pytest.mark.contract


@functools.cache
def records():
    """Return the rate, 1 deg/s at 10 Hz, and what sensors that are exactly as believed read of it, by seed."""
    rate = sines((10.0, 1.0), duration=LENGTH)
    return rate, [readings_of(rate, seed) for seed in range(SEEDS)]


def nees(method):
    """Return the normalised error squared of a filter [-]: the mean of e^2 / std^2 over time and seeds."""
    rate, all_readings = records()
    settled = slice(round(SETTLE * RATES["mhd_ars"]), None)
    blocks = [method(BELIEF, RATES, method.Parameters()).process(readings) for readings in all_readings]
    return float(np.mean([np.mean(((b.rate - rate)[settled] / b.std[settled]) ** 2) for b in blocks]))


def is_honest(method):
    return LOWEST <= nees(method) <= HIGHEST


@pytest.mark.parametrize("name", NAMES)
def test_the_claim_holds_or_the_filter_says_why_not(name):
    """An exemption that is no longer needed has to go."""
    assert is_honest(METHODS[name]) is not bool(METHODS[name].dishonest), f"NEES {nees(METHODS[name]):.3g}"


@pytest.mark.parametrize("factor", [0.2, 10.0])
def test_a_claim_that_is_not_the_error_is_seen(factor):
    class Boaster(Kalman):
        """A Kalman filter whose claim is off by a factor."""

        def _advance(self, Z, out):
            super()._advance(Z, out)
            out[1] *= factor

    assert is_honest(Kalman)
    assert not is_honest(Boaster)
