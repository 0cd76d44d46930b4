"""A grid is found from its stamps, whatever they are rounded to, and nothing else is taken for one."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from testbed.playback.grid import exact_rate, filled, lies_on_grid

EPOCH_NS = 1_700_000_000_000_000_000


def n_digits(rate):
    """Return how many significant digits a rate has: 100000 Hz has one."""
    return len(repr(rate).replace(".", "").strip("0"))


@pytest.mark.property
@example(rate=99_695.0, quantum=1000, start=0, n=50, cut=False)
@given(
    rate=st.one_of(st.integers(1, 100_000).map(float), st.sampled_from([2003.7, 6664.0, 48.47, 3333.3, 1e5 / 3.0])),
    quantum=st.sampled_from([1, 100, 1000]),
    start=st.sampled_from([0, 12_345_678_901, EPOCH_NS]),
    n=st.integers(50, 3000),
    cut=st.booleans(),
)
def test_rounded_multiples_of_a_step_give_a_rate_that_explains_them(rate, quantum, start, n, cut):
    """The rate that is found lies within what the rounding leaves open, q / (n step), and has no more digits."""
    index = np.arange(n)
    ticks = index * (1e9 / rate) / quantum
    stamps = start + quantum * np.asarray(np.floor(ticks) if cut else np.rint(ticks), dtype=np.int64)
    if np.any(np.diff(stamps) <= 0):
        return
    found = exact_rate(stamps, index, float(quantum))
    assert found is not None
    assert lies_on_grid(stamps, index, found, float(quantum))
    assert abs(found / rate - 1.0) <= 2.0 * (quantum + 1.0) * rate / (1e9 * (n - 1))
    assert n_digits(found) <= n_digits(rate)


@pytest.mark.parametrize("jitter_ns", [3.0, 200.0])
def test_a_jittering_clock_is_on_no_grid(jitter_ns, rng):
    index = np.arange(2000)
    stamps = np.rint(index * 50_000 + jitter_ns * rng.standard_normal(index.size)).astype(np.int64)
    assert exact_rate(stamps, index, 1.0) is None


def test_a_lost_sample_gets_the_stamp_between_its_neighbours():
    stamps = np.array([100, 201, 399, 500], dtype=np.int64)
    np.testing.assert_array_equal(filled(stamps, np.array([0, 1, 3, 4])), [100, 201, 300, 399, 500])
