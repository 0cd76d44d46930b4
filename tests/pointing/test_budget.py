"""The budget: shares that add up, what halving brings, and a knowledge whose parts are known."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.signal import lfilter

from testbed.pointing.budget import BudgetAccount
from testbed.pointing.knowledge import BELIEF_ERROR, LAG, BandSpectra
from testbed.pointing.line_of_sight import KNOWLEDGE, LATENCY, MIRROR, TRACKER, PointingBlock

FS = 2000.0
N = 200_000


def block(parts, inputs):
    whole = np.sum(list(parts.values()), axis=0)
    return PointingBlock(whole, whole, whole, whole, parts, inputs, np.zeros(whole.size, dtype=np.int64))


@pytest.fixture(scope="module")
def known():
    """Make a knowledge of two noises through known filters, what a belief misses, and a lag."""
    rng = np.random.default_rng(5)
    low, high = [0.3], [1.0, -0.7]
    truth = 1e-6 * lfilter(low, high, rng.standard_normal(N))
    first, second = 1e-8 * rng.standard_normal((2, N))
    unknown = 0.01 * truth
    parts = {
        "mhd": lfilter([0.5, 0.2], [1.0], first),
        "mems": lfilter([0.2], [1.0, -0.8], second),
        BELIEF_ERROR: lfilter([0.5, 0.2], [1.0], unknown),
        LAG: 0.05 * lfilter([1.0, -1.0], [1.0], truth),
    }
    inputs = {
        "truth": truth,
        "noise:mhd": first,
        "noise:mems": second,
        "unknown:mhd": unknown,
        "unknown:mems": np.zeros(N),
    }
    return parts, inputs


@pytest.mark.oracle
def test_the_knowledge_is_taken_apart_as_it_was_made(known):
    parts, inputs = known
    rng = np.random.default_rng(6)
    rest = {MIRROR: 2e-8 * rng.standard_normal(N), LATENCY: 0.02 * inputs["truth"], TRACKER: np.zeros(N)}
    knowledge = np.sum(list(parts.values()), axis=0)
    account = BudgetAccount(FS, N, {"mhd": {"a": np.ones_like, "b": lambda f: 3.0 * np.ones_like(f)}})
    whole = block({**rest, KNOWLEDGE: knowledge}, inputs)
    account.process(whole, 0)
    found = account.result()
    error = whole.residual
    for name, part in parts.items():
        expected = np.cov(part, error, ddof=0)[0, 1] / np.var(error)
        share = found["knowledge"][name]
        share = sum(share.values()) if isinstance(share, dict) else share
        # Covariances of a record scatter by 1/sqrt(n), and of the parts the rms of this one and of all count.
        scatter = 6.0 * np.std(part) / np.std(error) / math.sqrt(N) + 0.02 * abs(expected)
        assert_allclose(share, expected, atol=scatter, err_msg=name)
        # H is known to a few percent in each band.
        assert_allclose(found["knowledge_rms_urad"][name], 1e6 * np.std(part), rtol=0.05, err_msg=name)
    assert_allclose(found["knowledge"]["mhd"]["b"], 3.0 * found["knowledge"]["mhd"]["a"], rtol=1e-9)


@pytest.mark.property
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_shares_add_up_to_one_and_halving_is_what_it_says(seed, known):
    """Correlated parts: their squares do not add up, their covariances do."""
    rng = np.random.default_rng(seed)
    mix = rng.standard_normal((4, 3)) @ rng.standard_normal((3, N))
    parts = dict(zip((MIRROR, LATENCY, KNOWLEDGE, TRACKER), mix, strict=True))
    account = BudgetAccount(FS, N, {})
    whole = block(parts, known[1])
    account.process(whole, 17)
    found = account.result()
    within = sum(sum(one.values()) if isinstance(one, dict) else one for one in found["knowledge"].values())
    assert_allclose(sum(found["shares"].values()), 1.0, rtol=1e-12)
    assert_allclose(within, found["shares"][KNOWLEDGE], rtol=1e-9, atol=1e-12)
    for name, part in parts.items():
        assert_allclose(found["halved_urad"][name], 1e6 * np.std((whole.residual - part / 2.0)[17:]), rtol=1e-9)
    assert found["dominant"] == max(found["shares"], key=found["shares"].get)


def test_spectra_of_bands_add_up_to_covariances_in_any_blocks(rng):
    x = rng.standard_normal((2, 30_000))
    x[1] += 0.5 * x[0]
    spectra = BandSpectra(FS, 1000)
    for part in np.split(x, [7, 900, 901, 20_000], axis=1):
        spectra.process(part)
    C = spectra.spectra
    # Welch weighs the ends of the record less: 59 half-overlapping segments.
    assert_allclose(C.real.sum(axis=2), np.cov(x), atol=0.05)
    whole = BandSpectra(FS, 1000)
    whole.process(x)
    assert_allclose(whole.spectra, C, rtol=1e-12)


def test_a_record_too_short_has_shares_but_no_inside(rng):
    parts = dict(zip((MIRROR, LATENCY, KNOWLEDGE, TRACKER), rng.standard_normal((4, 100)), strict=True))
    account = BudgetAccount(FS, 100, {})
    account.process(block(parts, {"truth": np.zeros(100), "noise:a": np.zeros(100), "unknown:a": np.zeros(100)}), 0)
    found = account.result()
    assert set(found["knowledge"]) == {LAG}
    assert BudgetAccount(FS, 100, {}).result() is None
