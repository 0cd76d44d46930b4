"""The fading-memory filter against filterpy, its closed forms and a plain loop."""

from __future__ import annotations

import numpy as np
import pytest
from filterpy.kalman import FadingKalmanFilter

from testbed.compensation.fading import choose_factor, choose_ratio, equivalent_ratio, fading_memory, steady_gain


def walk(rng, q, n=4000):
    return np.cumsum(np.sqrt(q) * rng.normal(size=n)) + rng.normal(size=n)


def plain(z, s, q):
    """Return the level and innovation by equation (22) and the textbook update."""
    level, P, estimate, innovation = z[0], 1.0, [], []
    for reading in z:
        prior = s * P + q
        K = prior / (prior + 1.0)
        innovation.append(reading - level)
        level = level + K * (reading - level)
        P = (1.0 - K) * prior
        estimate.append(level)
    return np.array(estimate), np.array(innovation)


@pytest.mark.oracle
@pytest.mark.parametrize("s", [0.583, 1.0, 1.2])
def test_agrees_with_a_plain_loop_and_with_filterpy(rng, s):
    z = 1e-7 * walk(rng, 0.02, 300)
    with pytest.warns(DeprecationWarning, match="alpha"):
        peer = FadingKalmanFilter(alpha=1.0, dim_x=1, dim_z=1)
    # Its constructor insists on alpha of at least 1.
    peer.alpha_sq = s
    peer.x, peer.P, peer.F, peer.H = np.array([[z[0]]]), np.eye(1), np.eye(1), np.eye(1)
    peer.Q, peer.R = 0.02 * np.eye(1), np.eye(1)
    theirs = []
    for reading in z:
        peer.predict()
        peer.update(np.array([[reading]]))
        theirs.append(peer.x[0, 0])
    estimate, innovation = fading_memory(z, s, 0.02)
    assert np.allclose(estimate, theirs, rtol=0.0, atol=1e-12 * np.abs(z).max())
    for ours, loop in zip((estimate, innovation), plain(z, s, 0.02), strict=True):
        assert np.allclose(ours, loop, rtol=0.0, atol=1e-13 * np.abs(z).max())


@pytest.mark.oracle
@pytest.mark.parametrize("s", [0.3, 0.583, 1.0, 1.5])
@pytest.mark.parametrize("q", [1e-9, 1e-4, 0.3, 20.0])
def test_settles_to_the_closed_form(s, q):
    """A step of one after 20,000 zeros: the first answer is the gain. Slowest: (1 - K) sqrt(s), K = 3e-5 at s = 1, q =
    1e-9.
    """
    n = 400_000 if s == 1.0 and q < 1e-6 else 20_000
    z = np.zeros(n)
    z[-1] = 1.0
    assert fading_memory(z, s, q)[0][-1] == pytest.approx(steady_gain(s, q), rel=1e-6)


@pytest.mark.oracle
def test_fading_is_another_ratio(rng):
    """In steady state s = 0.583 is s = 1 with a smaller q: the same filter once the start is forgotten."""
    q = equivalent_ratio(0.583, 1e-2)
    assert steady_gain(1.0, q) == pytest.approx(steady_gain(0.583, 1e-2), rel=1e-12)
    z = walk(rng, 1e-2)
    faded, plain_ = fading_memory(z, 0.583, 1e-2)[0], fading_memory(z, 1.0, q)[0]
    # 3000 samples on, the start has decayed by (1 - K)^3000, K = 0.023.
    assert np.allclose(faded[3000:], plain_[3000:], rtol=0.0, atol=1e-12 * np.abs(z).max())


def test_factor_of_the_paper_divides_the_ratio_by_19_to_1740():
    """For small q it is (1 - s)^2 / q: p = q / (1 - s), K = p, and q of s = 1 is K^2."""
    assert 1e-4 / equivalent_ratio(0.583, 1e-4) == pytest.approx(1740.0, rel=0.01)
    assert 1e-2 / equivalent_ratio(0.583, 1e-2) == pytest.approx(19.0, rel=0.02)
    assert 1e-7 / equivalent_ratio(0.583, 1e-7) == pytest.approx((1.0 - 0.583) ** 2 / 1e-7, rel=1e-5)


@pytest.mark.oracle
@pytest.mark.parametrize("q", [1e-3, 0.1])
def test_ratio_of_a_random_walk_is_found(rng, q):
    """About n K independent values in n samples, K = sqrt(q): ln q spreads by sqrt(2 / n K), 0.056; grid 0.19."""
    assert np.log(choose_ratio(walk(rng, q, 20_000)) / q) == pytest.approx(0.0, abs=4.0 * 0.056 + 0.19)


def test_whiteness_undoes_a_wrong_ratio(rng):
    """With q ten times too large whiteness chooses the s whose gain is that of the true ratio, within a quarter."""
    z = walk(rng, 0.01, 20_000)
    s = choose_factor(z, 0.1)
    assert s < 1.0
    assert steady_gain(s, 0.1) == pytest.approx(steady_gain(1.0, 0.01), rel=0.25)
    assert choose_factor(z, 0.01) == pytest.approx(1.0, abs=0.15)


@pytest.mark.parametrize(("s", "q"), [(0.0, 1.0), (1.0, -1.0), (np.nan, 1.0), (1.0, np.inf)])
def test_bad_parameters_are_refused(s, q):
    with pytest.raises(ValueError, match="s, q"):
        fading_memory(np.zeros(3), s, q)


def test_nan_is_refused():
    with pytest.raises(ValueError, match="sample 1"):
        fading_memory(np.array([0.0, np.nan]), 1.0, 1.0)
