from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from testbed.recording.thinning import N_BINS, Thinning


def choose(values, sizes, detail=(0, 0)):
    """Run a Thinning over `values` in blocks of the given sizes, repeated until all is used."""
    thinning = Thinning(values.size, detail)
    parts, start = [], 0
    while start < values.size:
        size = sizes[len(parts) % len(sizes)]
        parts.append(thinning.process(values[start : start + size]))
        start += size
    parts.append(thinning.finish())
    return tuple(np.concatenate(part) for part in zip(*parts, strict=True))


def by_definition(values, detail):
    """Return the set of indices, sample by sample, with no block and no vector operation."""
    width = -(-values.size // N_BINS)
    wanted = {0, values.size - 1} | set(range(*detail))
    for start in range(0, values.size, width):
        finite = [i for i in range(start, min(start + width, values.size)) if np.isfinite(values[i])]
        if finite:
            wanted |= {min(finite, key=lambda i: values[i]), max(finite, key=lambda i: values[i])}
    return sorted(i for i in wanted if np.isfinite(values[i]))


@pytest.mark.property
@settings(max_examples=30, deadline=None)
@given(
    n=st.integers(1, 21_000),
    sizes=st.lists(st.integers(1, 5000), min_size=1, max_size=4),
    window=st.tuples(st.integers(0, 21_000), st.integers(0, 500)),
    seed=st.integers(0, 2**32 - 1),
)
def test_envelope_equals_its_definition_for_any_blocks(n, sizes, window, seed):
    rng = np.random.default_rng(seed)
    values = np.round(rng.standard_normal(n), 1)  # rounded, so that there are ties
    values[rng.random(n) < 0.2] = np.nan
    values[rng.random(n) < 0.01] = np.inf
    values[rng.random(n) < 0.01] = -np.inf
    detail = (min(window[0], n), min(sum(window), n))
    # One block of one sample after another is slow, so the smallest of the blocks are a hundredth of the stream.
    index, chosen = choose(values, [max(size, n // 100) for size in sizes], detail)
    assert index.tolist() == by_definition(values, detail)
    assert np.array_equal(chosen, values[index])


def test_envelope_keeps_a_spike_of_one_sample():
    values = np.zeros(1_200_000)
    values[777_777] = 1.0
    index, chosen = choose(values, [20_000])
    assert chosen[index == 777_777].tolist() == [1.0]


def test_envelope_of_one_sample_per_block_is_that_of_the_whole():
    values = np.random.default_rng(3).standard_normal(9000)
    whole, pieces = choose(values, [values.size]), choose(values, [1])
    assert np.array_equal(whole[0], pieces[0])
    assert np.array_equal(whole[1], pieces[1])


def test_envelope_size_does_not_grow_with_the_stream():
    for n in (10_000, 100_000, 1_000_000):
        index, _ = choose(np.random.default_rng(n).standard_normal(n), [20_000])
        assert index.size <= 2 * N_BINS + 2


def test_envelope_without_a_finite_sample_is_empty():
    index, chosen = choose(np.full(10_000, np.nan), [300])
    assert index.size == chosen.size == 0
