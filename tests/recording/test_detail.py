from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from testbed.recording.detail import N_BINS, Detail


def choose(values, sizes, window=(0, 0), *, gaps=False):
    """Run a Detail over `values` in blocks of the given sizes, repeated until all is used."""
    detail = Detail(values.size, window, gaps=gaps)
    parts, start = [], 0
    while start < values.size:
        size = sizes[len(parts) % len(sizes)]
        parts.append(detail.process(values[start : start + size]))
        start += size
    parts.append(detail.finish())
    return tuple(np.concatenate(part) for part in zip(*parts, strict=True))


def by_definition(values, window, gaps):
    """Return the set of indices, sample by sample, with no block and no vector operation."""
    width = -(-values.size // N_BINS)
    wanted = {0, values.size - 1} | set(range(*window))
    for start in range(0, values.size, width):
        finite = [i for i in range(start, min(start + width, values.size)) if np.isfinite(values[i])]
        if finite:
            wanted |= {min(finite, key=lambda i: values[i]), max(finite, key=lambda i: values[i])}
        else:
            wanted.add(start)
    return sorted(i for i in wanted if gaps or np.isfinite(values[i]))


@pytest.mark.property
@settings(max_examples=30, deadline=None)
@given(
    n=st.integers(1, 21_000),
    sizes=st.lists(st.integers(1, 5000), min_size=1, max_size=4),
    window=st.tuples(st.integers(0, 21_000), st.integers(0, 500)),
    gaps=st.booleans(),
    seed=st.integers(0, 2**32 - 1),
)
def test_detail_equals_its_definition_for_any_blocks(n, sizes, window, gaps, seed):
    rng = np.random.default_rng(seed)
    values = np.round(rng.standard_normal(n), 1)  # rounded, so that there are ties
    values[rng.random(n) < 0.2] = np.nan
    values[rng.random(n) < 0.01] = np.inf
    values[rng.random(n) < 0.01] = -np.inf
    window = (min(window[0], n), min(sum(window), n))
    # One block of one sample after another is slow, so the smallest of the blocks are a hundredth of the stream.
    index, chosen = choose(values, [max(size, n // 100) for size in sizes], window, gaps=gaps)
    assert index.tolist() == by_definition(values, window, gaps)
    # Infinity is no value of a reading either: it is a gap like the rest.
    assert np.array_equal(chosen, np.where(np.isfinite(values), values, np.nan)[index], equal_nan=True)


def test_detail_keeps_a_spike_of_one_sample():
    values = np.zeros(1_200_000)
    values[777_777] = 1.0
    index, chosen = choose(values, [20_000])
    assert chosen[index == 777_777].tolist() == [1.0]


def test_detail_of_one_sample_per_block_is_that_of_the_whole():
    values = np.random.default_rng(3).standard_normal(9000)
    whole, pieces = choose(values, [values.size]), choose(values, [1])
    assert np.array_equal(whole[0], pieces[0])
    assert np.array_equal(whole[1], pieces[1])


def test_detail_size_does_not_grow_with_the_stream():
    for n in (10_000, 100_000, 1_000_000):
        index, _ = choose(np.random.default_rng(n).standard_normal(n), [20_000])
        assert index.size <= 2 * N_BINS + 2


def test_detail_marks_every_bin_of_a_gap_and_nothing_that_the_picture_shows_anyway():
    """40 000 samples in bins of ten: a gap of 1000 is a hundred bins; single losses elsewhere cut no line."""
    values = np.sin(np.arange(40_000) / 500.0)
    values[8000:9000] = np.nan
    values[20_000::50] = np.nan
    index, chosen = choose(values, [777], gaps=True)
    assert index[np.isnan(chosen)].tolist() == list(range(8000, 9000, 10))
    index, chosen = choose(values, [777], (20_000, 20_200), gaps=True)
    assert index[np.isnan(chosen)].tolist() == [*range(8000, 9000, 10), *range(20_000, 20_200, 50)]


def test_detail_without_a_finite_sample_is_empty():
    index, chosen = choose(np.full(10_000, np.nan), [300])
    assert index.size == chosen.size == 0
