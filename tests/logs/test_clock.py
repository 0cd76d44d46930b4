"""What stamps say: even logs stay even however their stamps are rounded, and what is wrong is told."""

from __future__ import annotations

import numpy as np
import pytest

from testbed.logs.clock import ClockScan, nanoseconds


def scan(stamps, parts=1, **options):
    look = ClockScan(**options)
    for part in np.array_split(np.asarray(stamps, dtype=np.int64), parts):
        look.add(part)
    return look.result()


@pytest.mark.parametrize(
    ("rate", "rounding", "start"),
    [(20_000.0, 1, 1_403_715_273_262_142_976), (8000.0, 1000, 0), (6664.0, 1000, 0), (3333.3, 1000, 7),
     (1000.0, 238, 0),
     (400.0, 1_000_000, 0), (48.47, 1_000_000, 0), (200.0, 1_000_000, 1_403_715_273_262_000_000)],
)  # fmt: skip
@pytest.mark.parametrize("parts", [1, 7])
def test_rounded_stamps_are_even_and_give_the_rate(rate, rounding, start, parts):
    t = start + np.rint(np.arange(20_000) * 1e9 / rate / rounding).astype(np.int64) * rounding
    clock = scan(t, parts)
    assert clock.even
    assert not clock.gaps.count
    low, high = clock.rate_limits_hz
    assert low <= rate <= high
    assert clock.rate_hz == pytest.approx(rate, rel=2.0 * rounding / (t[-1] - t[0]))


@pytest.mark.property
@pytest.mark.parametrize("kind", ["jitter of the stamps", "jitter of the steps"])
def test_the_interval_of_the_rate_covers_the_truth(kind):
    """Errors of single stamps, and of a clock that wanders: 95 % of 300 records."""
    inside = 0
    for seed in range(300):
        rng = np.random.default_rng(seed)
        steps = np.full(2000, 1e6) + (20_000.0 * rng.standard_normal(2000) if kind == "jitter of the steps" else 0.0)
        t = np.cumsum(steps) + (20_000.0 * rng.standard_normal(2000) if kind == "jitter of the stamps" else 0.0)
        low, high = scan(np.rint(t)).rate_limits_hz
        inside += low <= 1000.0 <= high
    # 99.9 % binomial band about 0.95 of 300.
    assert 272 <= inside <= 297


def test_gaps_doubled_backward_and_uneven_stamps_are_told_with_their_place():
    t = 1_000_000 * np.arange(1000)
    lost = np.delete(t, slice(400, 404))
    clock = scan(lost, 3)
    assert (clock.gaps.count, clock.gaps.missing, clock.gaps.first[0].row) == (1, 4, 400)
    assert clock.gaps.first[0].seconds == pytest.approx(0.399)
    assert clock.rate_hz == pytest.approx(1000.0)
    twice = t.copy()
    twice[500] = twice[499]
    assert (scan(twice).doubled.count, scan(twice).doubled.first[0].row) == (1, 500)
    back = t.copy()
    back[700:] -= 5_000_000
    assert (scan(back).backward.count, scan(back).backward.first[0].row) == (1, 700)
    early = t + np.where(np.arange(1000) == 300, 400_000, 0)
    assert (scan(early).uneven.count, scan(early).uneven.first[0].row) == (2, 300)
    assert not scan(early).even


def test_frames_left_out_by_a_pattern_are_gaps_and_give_both_rates():
    """Eleven of fourteen frames of 3332 Hz are kept: 2618 Hz in the mean."""
    kept = np.flatnonzero(np.isin(np.arange(14_000) % 14, [0, 1, 2, 3, 5, 6, 7, 9, 10, 12, 13]))
    clock = scan(np.rint(kept * 1e6 / 3332.0).astype(np.int64) * 1000)
    assert clock.rate_hz == pytest.approx(3332.0, rel=1e-5)
    assert clock.mean_rate_hz == pytest.approx(2618.0, rel=1e-3)
    assert clock.gaps.missing == 3 * 1000
    assert clock.even


def test_stamps_coarser_than_the_samples_are_told():
    clock = scan(np.repeat(np.arange(500) * 1_000_000, 8))
    assert clock.coarse
    assert clock.mean_rate_hz == pytest.approx(8000.0, rel=2e-3)


def test_a_counter_that_begins_anew_goes_on():
    turn = (1 << 32) * 1000
    t = (np.arange(4000) * 1_000_000 + turn - 2_000_000_000) % turn
    clock = scan(t, 5, wraps_ns=(turn,))
    assert (clock.wraps, clock.even, clock.gaps.count) == (1, True, 0)
    assert clock.rate_hz == pytest.approx(1000.0)


def test_integers_become_nanoseconds_exactly():
    stamps = np.array([1_403_715_273_262_142_976, 1_403_715_273_262_142_977])
    assert nanoseconds(stamps, 1e-9).tolist() == stamps.tolist()
    assert nanoseconds(np.array([3]), 1e-6).tolist() == [3000]
    assert nanoseconds(np.array([0.1 + 0.2]), 1.0).tolist() == [300_000_000]
    with pytest.raises(OverflowError, match="out of range"):
        nanoseconds(np.array([10**18]), 1.0)
