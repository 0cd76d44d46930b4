"""The tracker's correction: its kernels against a plain loop, its sensitivity, fades, and a mirror with an end."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

from testbed.pointing.blend import butterworth_gains
from testbed.pointing.tracking import Correction, LimitedCorrection, correction_steps

FS = 2000.0
GAINS = butterworth_gains(10.0)


def twin(u, seen):
    """x+ = Phi x + Gamma w + slope (w+ - w) with plain NumPy, one signal."""
    Phi, Gamma, slope = correction_steps(GAINS, FS)
    x, last, left = np.zeros(2), 0.0, np.empty_like(u)
    for k, w in enumerate(u):
        mode = int(seen[k])
        x = Phi[mode] @ x + Gamma[mode] * last + slope[mode] * (w - last)
        last = w
        left[k] = w - x[0]
    return left


@pytest.mark.oracle
def test_kernel_is_its_plain_twin_in_any_blocks(rng):
    u, seen = rng.standard_normal((2, 500)), rng.random(500) > 0.3
    stage = Correction(GAINS, FS, 2)
    found = np.concatenate([stage.process(u[:, a:b], seen[a:b]) for a, b in ((0, 3), (3, 3), (3, 500))], axis=1)
    assert_allclose(found, [twin(one, seen) for one in u], rtol=1e-12, atol=1e-14)


@pytest.mark.oracle
@pytest.mark.parametrize("frequency", [1.0, 10.0, 100.0])
def test_sensitivity_in_time_is_the_butterworth_high_pass(frequency):
    """Of the input as it is held, straight from sample to sample, sinc^2 of the sine is left."""
    n = 40_000
    t = np.arange(n) / FS
    turn = 2.0 * np.pi * frequency * t
    left = Correction(GAINS, FS, 1).process(np.sin(turn)[None], np.ones(n, dtype=bool))[0]
    ratio = 2.0 * np.mean(left[n // 2 :] * np.exp(-1j * turn[n // 2 :])) / -1j
    held = np.sinc(frequency / FS) ** 2
    expected = 1.0 - (1.0 - GAINS.sensitivity(np.array([frequency]))[0]) * held
    # What aliases back: the first image, passed by T as k_1 / s.
    image = (frequency / FS) ** 2 * GAINS.angle / (2.0 * np.pi * FS)
    assert_allclose(ratio, expected, atol=3.0 * image + 1e-7)


def test_through_a_fade_the_learnt_rate_goes_on():
    """A drift of constant rate is held while the tracker has no light; what moves otherwise is not."""
    n = 20_000
    t = np.arange(n) / FS
    seen = (t < 5.0) | (t > 7.0)
    drift = 3e-6 * t
    left = Correction(GAINS, FS, 1).process(drift[None], seen)[0]
    assert_allclose(left[t > 4.0], 0.0, atol=1e-12)
    bent = drift + np.where(t > 5.0, 1e-6 * (t - 5.0) ** 2, 0.0)
    left = Correction(GAINS, FS, 1).process(bent[None], seen)[0]
    assert_allclose(left[round(7.0 * FS)], 4e-6, rtol=1e-3)


def test_a_mirror_without_an_end_is_the_linear_one(rng):
    u, forward, noise = rng.standard_normal((3, 800)).cumsum(axis=1) * 1e-6
    seen = np.ones(800, dtype=bool)
    deflection, ends = LimitedCorrection(GAINS, FS, math.inf, math.inf).process(u, forward, noise, seen)
    linear = Correction(GAINS, FS, 2).process(np.stack([u - forward, noise]), seen)
    assert_allclose(u - deflection, linear[0] + linear[1] - noise, atol=1e-15)
    assert not ends.any()


def test_ends_are_kept_and_told_apart():
    n = 4000
    angle = 1e-3 * np.sin(2.0 * np.pi * 5.0 * np.arange(n) / FS)
    seen, still = np.ones(n, dtype=bool), np.zeros(n)
    deflection, ends = LimitedCorrection(GAINS, FS, 0.4e-3, math.inf).process(angle, angle, still, seen)
    assert np.max(np.abs(deflection)) == 0.4e-3
    assert set(np.unique(ends)) == {0, 1}
    # |sin| > 0.4 for 1 - 2 asin(0.4) / pi of the time.
    assert_allclose(np.mean(ends == 1), 1.0 - 2.0 * math.asin(0.4) / math.pi, atol=0.02)
    limit = 0.01
    deflection, ends = LimitedCorrection(GAINS, FS, math.inf, limit).process(angle, angle, still, seen)
    assert np.max(np.abs(np.diff(deflection))) <= limit / FS * (1.0 + 1e-9)
    assert set(np.unique(ends)) == {0, 2}
