"""The Allan deviation by octaves is that of the means, whatever the blocks, and its band holds what it says."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from testbed.allan import AllanOctaves, allan_deviation

FS = 100.0


def by_blocks(record, lengths):
    octaves = AllanOctaves(FS)
    for block in np.split(record, np.cumsum(lengths)):
        octaves.process(block)
    return octaves.curve()


@pytest.mark.oracle
def test_each_octave_is_the_overlapping_deviation_of_the_means():
    """Twin: means of 2^k samples as a record of their own, at four of them, by the batch estimator."""
    record = np.random.default_rng(3).standard_normal(5000).cumsum() + 40.0
    curve = by_blocks(record, [1, 2, 700, 3, 1250])
    assert_allclose(curve.tau[:2], [1 / FS, 2 / FS], rtol=1e-15)
    assert_allclose(curve.deviation[:2], allan_deviation(record, FS, tau=[1 / FS, 2 / FS]).deviation, rtol=1e-9)
    for k, tau in enumerate(curve.tau[2:]):
        means = record[: record.size >> k << k].reshape(-1, 1 << k).mean(axis=1)
        wanted = allan_deviation(means, FS / (1 << k), tau=[tau])
        assert tau == pytest.approx(4 * (1 << k) / FS, rel=1e-15)
        # The batch estimator sums angles of the whole record, which leaves about 1e-12 of its largest one.
        assert_allclose(curve.deviation[k + 2], wanted.deviation[0], rtol=1e-8)
    # Up to a quarter of the record: 4 * 2^8 samples of 5000, and no more.
    assert curve.tau[-1] == 4 * 256 / FS


def test_blocks_make_no_difference():
    record = np.random.default_rng(4).standard_normal(3001)
    whole, parts = by_blocks(record, []), by_blocks(record, [1] * 50 + [999])
    assert_allclose(parts.deviation, whole.deviation, rtol=1e-12)
    assert_allclose(parts.upper, whole.upper, rtol=1e-12)


@pytest.mark.oracle
def test_the_band_of_white_noise_holds_as_often_as_it_says():
    """N / sqrt(tau) lies inside in 95 % of records: of 400, at each averaging time, at least 95 % - 5 sigma."""
    rng = np.random.default_rng(5)
    inside = []
    for _ in range(400):
        curve = by_blocks(rng.standard_normal(600), [])
        truth = (curve.tau * FS) ** -0.5
        inside.append((curve.lower <= truth) & (truth <= curve.upper))
    shares = np.mean(inside, axis=0)
    print("share of 400 records inside by averaging time:", shares)
    # The type of noise is told from the slope of a curve that scatters, which costs some at the longest.
    assert np.all(shares > 0.95 - 5.0 * np.sqrt(0.95 * 0.05 / 400))


def test_lost_samples_leave_out_the_means_that_they_are_in():
    record = np.random.default_rng(6).standard_normal(4000)
    record[1000:1200] = np.nan
    curve = by_blocks(record, [777])
    assert np.all(np.isfinite(curve.deviation))
    kept = np.diff(record)
    assert curve.deviation[0] == pytest.approx(np.sqrt(np.nanmean(kept**2) / 2.0), rel=1e-12)
    assert np.all(curve.used < 1.0)


@pytest.mark.oracle
def test_a_line_is_a_hump_near_0_37_of_its_period():
    """As the report says: A^2 sin^4(pi f tau) / (pi f tau)^2 is largest where tan(x) = 2 x, at x = 1.1656."""
    line = np.sin(2 * np.pi * np.arange(20_000) / 1000)
    tau = np.arange(300, 440, 5) / FS
    peak = tau[np.argmax(allan_deviation(line, FS, tau=tau).deviation)]
    assert peak * FS / 1000 == pytest.approx(1.1656 / np.pi, abs=0.005)
    assert by_blocks(line, []).tau[np.argmax(by_blocks(line, []).deviation)] == 256 / FS


def test_too_little_has_no_curve():
    assert by_blocks(np.arange(15.0), []) is None
    assert by_blocks(np.zeros(100), []) is None
    assert by_blocks(np.full(100, np.nan), []) is None
