"""The standard deviation that a filter claims is that of its error, or the filter says why not."""

from __future__ import annotations

import functools

import numpy as np
import pytest

from testbed.fusion.filters.kalman import Kalman
from tests.contract.records import BELIEF, METHODS, NAMES, RATES, readings_of, sines

SEEDS, LENGTH, SETTLE = 4, 3.0, 1.0
# Errors beyond twice the variance claimed are too confident: the factor that the reports allow. Who knows that the
# record begins at rest, as here, claims at most twice the error; who does not may claim what it cannot know.
LOWEST, HIGHEST = 0.25, 2.0

pytestmark = pytest.mark.contract


@functools.cache
def records():
    """Return the rate, 1 deg/s at 10 Hz, and what sensors that are exactly as believed read of it, by seed."""
    rate = sines((10.0, 1.0), duration=LENGTH)
    return rate, [readings_of(rate, seed) for seed in range(SEEDS)]


def nees(method, **parameters):
    """Return the normalised error squared of a filter [-]: the mean of e^2 / std^2 over time and seeds."""
    rate, all_readings = records()
    settled = slice(round(SETTLE * RATES["mhd_ars"]), None)
    blocks = [method(BELIEF, RATES, method.Parameters(**parameters)).process(z) for z in all_readings]
    return float(np.mean([np.mean(((b.rate - rate)[settled] / b.std[settled]) ** 2) for b in blocks]))


def verdict(method):
    """Return NEES from a known and from an unknown start, and whether the claim holds from both."""
    known = {"start": "rest"} if "start" in method.Parameters.model_fields else {}
    rest, unknown = nees(method, **known), nees(method)
    return rest, unknown, rest >= LOWEST and max(rest, unknown) <= HIGHEST


@pytest.mark.parametrize("name", NAMES)
def test_the_claim_holds_or_the_filter_says_why_not(name):
    """An exemption that is no longer needed has to go."""
    rest, unknown, honest = verdict(METHODS[name])
    assert honest is not bool(METHODS[name].dishonest), f"NEES {rest:.3g} from rest, {unknown:.3g} else"


@pytest.mark.parametrize("factor", [0.2, 10.0])
def test_a_claim_that_is_not_the_error_is_seen(factor):
    class Boaster(Kalman):
        """A Kalman filter whose claim is off by a factor."""

        def _advance(self, Z, out):
            super()._advance(Z, out)
            out[1] *= factor

    assert verdict(Kalman)[-1]
    assert not verdict(Boaster)[-1]
