"""Gain, phase and coherence from records: known systems, known noise, lines, any blocks."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import freqz, lfilter

from testbed.metrics.transfer import TransferSums

FS, N = 1000.0, 200_000


def found(x, y, block=N, **more):
    sums = TransferSums(FS, x.size, **more)
    for first in range(0, x.size, block):
        sums.process(x[first : first + block], y[first : first + block])
    return sums.result()


@pytest.mark.oracle
def test_a_digital_filter_has_its_own_response(rng):
    """By scipy.signal.freqz; noise of density 0.01 relative to the input scatters a point by 0.01/sqrt(2 n), n > 10."""
    x = rng.standard_normal(N)
    b, a = [0.2], [1.0, -0.8]
    y = lfilter(b, a, x) + 0.01 * rng.standard_normal(N)
    transfer = found(x, y)
    late = transfer.freq_hz > 5.0
    _, response = freqz(b, a, worN=transfer.freq_hz[late], fs=FS)
    # A bin is 6 % wide, over which this response changes by up to that; five sigma of 0.0022 beside it.
    np.testing.assert_allclose(transfer.response[late], response, rtol=0.07, atol=0.011)
    np.testing.assert_allclose(
        transfer.coherence[late], np.abs(response) ** 2 / (np.abs(response) ** 2 + 1e-4), atol=0.02
    )


@pytest.mark.oracle
def test_coherence_of_equal_signal_and_noise_is_a_half_and_of_noise_below_chance(rng):
    """One bin has eleven independent segments at least: a deviation of 0.5 sqrt(2/n) = 0.21 in the worst; the mean over
    the bins, which hold up to a thousand frequencies each, is far nearer.
    """
    x = rng.standard_normal(N)
    transfer = found(x, x + rng.standard_normal(N))
    assert np.mean(transfer.coherence[transfer.freq_hz > 20.0]) == pytest.approx(0.5, abs=0.02)
    alone = found(x, rng.standard_normal(N))
    # 95 % in each, or more where a point averages many frequencies.
    assert np.mean(alone.coherence < alone.chance) > 0.9


def test_a_record_of_lines_has_points_at_its_lines_only(rng):
    t = np.arange(N) / FS
    lines = (5.0, 40.0)
    x = np.sin(2 * np.pi * 5.0 * t) + 0.1 * np.sin(2 * np.pi * 40.0 * t)
    y = 0.5 * np.sin(2 * np.pi * 5.0 * t - 0.3) + 0.2 * np.sin(2 * np.pi * 40.0 * t + 1.0)
    transfer = found(x, y + 1e-3 * rng.standard_normal(N), lines_hz=lines)
    np.testing.assert_allclose(transfer.freq_hz, lines)
    np.testing.assert_allclose(transfer.response, [0.5 * np.exp(-0.3j), 2.0 * np.exp(1j)], rtol=1e-3)
    assert np.all(transfer.coherence > 0.999)


def test_blocks_do_not_matter_and_a_nan_costs_its_segments(rng):
    x = rng.standard_normal(N)
    y = lfilter([1.0, 0.5], [1.0], x)
    whole, parts = found(x, y), found(x, y, block=777)
    assert np.array_equal(whole.response, parts.response)
    y[1000] = np.nan
    assert np.all(np.isfinite(found(x, y).response))


@pytest.mark.parametrize("x", [np.zeros(5000), np.ones(50)])
def test_still_or_short_records_say_nothing(x):
    assert found(x, x).freq_hz.size == 0
