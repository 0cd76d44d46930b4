"""The wavelet is that of two lifting steps, white noise goes, a jump stays."""

import numpy as np
import pytest
import pywt

from testbed.compensation.lifting import WAVELET, lifting_threshold


@pytest.mark.oracle
def test_the_filter_bank_has_the_coefficients_of_the_lifting_scheme():
    """Predict odd samples by the mean of their neighbours, update even ones by a quarter of both errors."""
    x = np.random.default_rng(1).standard_normal(200)
    even, odd = x[::2], x[1::2]
    detail = odd[:-1] - 0.5 * (even[:-1] + even[1:])
    smooth = even[1:-1] + 0.25 * (detail[:-1] + detail[1:])
    coarse, fine = pywt.dwt(x, WAVELET)
    # Normalised by sqrt(2) one way and the other; the borders are extended, and shift the index by one.
    n = detail.size
    offsets = [k for k in range(4) if np.allclose(np.abs(fine[k : k + n]), np.abs(detail) / np.sqrt(2.0), atol=1e-12)]
    assert len(offsets) == 1
    m = smooth.size
    assert any(np.allclose(coarse[k : k + m], np.sqrt(2.0) * smooth, atol=1e-12) for k in range(4))


def test_white_noise_goes():
    """Soft universal thresholds leave nothing of most levels: the coarse scale of n / 2^level samples stays."""
    x = np.random.default_rng(2).standard_normal(8192)
    assert lifting_threshold(x).std() < 0.1


def test_a_jump_stays_where_noise_goes():
    """Soft: what is kept is a threshold, sqrt(2 ln n) = 4, too small at each of the levels that see it."""
    level = np.where(np.arange(4096) < 2048, -10.0, 10.0)
    found = lifting_threshold(level + np.random.default_rng(3).standard_normal(4096))
    steps = np.diff(found)
    # The noise's own steps have a std of 1.4.
    assert np.std(np.delete(steps, slice(1900, 2200))) < 0.05
    assert found[2100:].mean() - found[:2000].mean() > 18.0


@pytest.mark.parametrize("n", [33, 34, 1001])
def test_the_length_stays(n):
    assert lifting_threshold(np.random.default_rng(n).standard_normal(n)).size == n
