"""Sorting modes: by period, by sample entropy, and why permutation entropy cannot do what the paper says."""

from __future__ import annotations

import math

import numpy as np
import pytest

from testbed.compensation.emd import emd
from testbed.compensation.entropy import permutation_entropy
from testbed.compensation.grouping import group_modes, mean_period
from testbed.sensors.noise import GyroNoise


def tones(periods, n_time=85_200):
    """Return one tone per period [s] at 1 Hz, an eighth of a turn into it, and a zero residual."""
    t = np.arange(n_time)
    return np.array([np.cos(2.0 * np.pi * t / period + np.pi / 4.0) for period in periods] + [np.zeros(n_time)])


def test_mean_period_of_a_tone():
    """The number of crossings is off by one at most."""
    for period, rate in ((10.0, 1.0), (333.0, 1.0), (0.5, 100.0)):
        tone = np.sin(2.0 * np.pi * np.arange(20_000) / (period * rate) + 0.3)
        assert mean_period(tone, rate) == pytest.approx(period, rel=1.5 * period * rate / (2.0 * 20_000))
    assert mean_period(np.ones(10), 1.0) == math.inf


def test_groups_by_period_are_cut_where_told():
    groups = group_modes(tones([3.0, 10.0, 25.0, 400.0, 1000.0, 20_000.0]), 1.0)
    assert (groups.noise, groups.mixed, groups.drift) == (range(2), range(2, 4), range(4, 7))
    # The same samples taken at 0.1 Hz are ten times slower.
    slower = group_modes(tones([3.0, 10.0, 25.0, 400.0, 1000.0, 20_000.0]), 0.1)
    assert (slower.noise, slower.mixed, slower.drift) == (range(0), range(3), range(3, 7))


@pytest.mark.parametrize("method", ["period", "sample_entropy", "permutation_entropy"])
def test_groups_are_contiguous_and_complete(method):
    modes = emd(np.random.default_rng(1).standard_normal(20_000))
    groups = group_modes(modes, 1.0, method=method)
    assert [*groups.noise, *groups.mixed, *groups.drift] == list(range(len(modes)))
    assert len(modes) - 1 in groups.drift


def test_permutation_entropy_of_a_mode_is_a_gauge_of_its_period():
    """White noise and a random walk have nothing in common but the periods of their modes, and the same entropies at
    the same periods.

    From 0.98 at three samples per period it falls to that of long ups and downs, ln 2 / ln 24; so "below 0.5" holds for
    slow modes only.
    """
    rng, points = np.random.default_rng(2), []
    for signal in (rng.standard_normal(60_000), np.cumsum(rng.standard_normal(60_000))):
        modes = emd(signal)[:-1]
        found = [(mean_period(mode, 1.0), permutation_entropy(mode)) for mode in modes]
        # Slower than that a record of 60,000 samples has a dozen turns.
        found = [(period, entropy) for period, entropy in found if period < 5000.0]
        assert all(np.diff([entropy for _, entropy in found]) < 0.0)
        points.append(np.array(found))
    white, walk = points
    assert white[0, 1] == pytest.approx(0.98, abs=0.01)
    assert white[-1, 1] == pytest.approx(math.log(2.0) / math.log(24.0), abs=0.02)
    # The entropy falls by 0.2 an octave near the fastest mode and is bent there: a straight line between modes is off
    # by some 0.05.
    same_period = np.interp(np.log(walk[:, 0]), np.log(white[:, 0]), white[:, 1])
    off = np.abs(same_period - walk[:, 1])[walk[:, 0] > white[0, 0]]
    assert off[0] < 0.05
    assert off[1:].max() < 0.01


def test_groups_by_sample_entropy_are_cut_at_the_first_and_last_irregular_mode():
    """White noise held for a block keeps its size when averaged (-ln erf(0.1) = 2.2); what is faster averages out, what
    is slower repeats.
    """
    held = np.repeat(np.random.default_rng(4).standard_normal((2, 1500)), 55, axis=1)
    fast, slow, residual = tones([3.0, 50_000.0], held.shape[1])
    groups = group_modes(np.array([fast, *held, slow, residual]), 1.0, method="sample_entropy", scale=55)
    assert (groups.noise, groups.mixed, groups.drift) == (range(1), range(1, 3), range(3, 5))


def gyro_record(seed):
    """Return a day at 1 Hz: white and flicker noise that cross within a minute, and a slow drift four times as large
    [rad/s].
    """
    n = 85_200
    noise = GyroNoise(angle_random_walk=2.3e-7, bias_instability=2.2e-8).sample(n, 1.0, seed)
    t = np.arange(n) / n
    return noise + 1e-7 * np.sin(2.0 * np.pi * t) + 2e-7 * t**2


def test_sample_entropy_reproduces_the_papers_groups_and_permutation_entropy_does_not():
    """IMF1-4 noise, IMF5-10 mixed, the rest drift, at scale 50 to 60; modes of plain EMD halve in frequency like those
    of the paper.
    """
    for seed in (1, 2):
        modes = emd(gyro_record(seed))
        for scale in (50, 55, 60):
            groups = group_modes(modes, 1.0, method="sample_entropy", scale=scale)
            # Each mode has about half the frequency of the one before it: one more or less is chance.
            assert groups.noise.stop in {3, 4, 5}
            assert groups.drift.start in {9, 10, 11, 12}
        assert group_modes(modes, 1.0, method="permutation_entropy").noise == range(0)
        assert group_modes(modes, 1.0, method="permutation_entropy", scale=1).noise == range(0)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"method": "best"}, "method: expected period"),
        ({"periods": (900.0, 21.0)}, "periods: expected two rising"),
        ({"method": "sample_entropy", "threshold": 9.0}, "modes: expected one with sample_entropy of at least 9"),
        ({"sample_rate_hz": 0.0}, "sample_rate_hz: expected"),
        ({"modes": np.zeros(5)}, "modes: expected two axes"),
    ],
    ids=["method", "periods", "threshold", "rate", "shape"],
)
def test_bad_input_is_refused(options, message):
    with pytest.raises(ValueError, match=message):
        group_modes(**{"modes": tones([3.0, 30.0], 2000), "sample_rate_hz": 1.0, **options})
