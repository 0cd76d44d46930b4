"""Local mean decomposition: complete, equivariant, and an amplitude-modulated tone comes out of a slower one."""

import numpy as np
import pytest

from testbed.compensation.local_mean import extrema, local_mean_decomposition, mean_and_amplitude
from tests.compensation.records import noisy_tone


def turns(x):
    """Return the extrema by looking at each sample: of a plateau its first one."""
    found, direction, begin = [0], 0, 0
    for k in range(1, x.size):
        move = np.sign(x[k] - x[k - 1])
        if move and direction and move != direction:
            found.append(begin)
        if move:
            direction, begin = move, k
    return [*found, x.size - 1]


@pytest.mark.property
@pytest.mark.parametrize("seed", range(5))
def test_extrema_are_those_of_a_walk_over_the_samples(seed):
    x = np.random.default_rng(seed).integers(0, 4, 200).astype(float)
    assert extrema(x).tolist() == turns(x)


@pytest.mark.property
@pytest.mark.parametrize("seed", range(3))
def test_the_functions_add_up_and_slow_down(seed):
    x = noisy_tone(3000, seed)
    rows = local_mean_decomposition(x)
    np.testing.assert_allclose(rows.sum(axis=0), x, atol=1e-12 * np.abs(x).max())
    crossings = [np.count_nonzero(np.diff(np.signbit(row - row.mean()))) for row in rows]
    assert crossings[0] == max(crossings)
    assert len(rows) >= 4


def test_a_modulated_tone_is_taken_out_of_a_slower_one_with_its_amplitude():
    """20 Hz modulated by 30 % at 0.5 Hz on 3 Hz of twice the amplitude: ends aside, what smoothing over three periods
    of the carrier makes of the modulation stays.
    """
    t = np.arange(4000) / 1000.0
    fast = (1.0 + 0.3 * np.cos(2 * np.pi * 0.5 * t)) * np.cos(2 * np.pi * 20.0 * t)
    slow = 2.0 * np.sin(2 * np.pi * 3.0 * t)
    found = local_mean_decomposition(fast + slow)[0]
    inner = slice(300, -300)
    assert np.corrcoef(found[inner], fast[inner])[0, 1] > 0.99
    assert found[inner].std() == pytest.approx(fast[inner].std(), rel=0.1, abs=0.0)


def test_a_pure_tone_has_its_own_mean_and_amplitude():
    t = np.arange(2000) / 100.0
    mean, amplitude = mean_and_amplitude(3.0 * np.cos(2 * np.pi * t))
    # Samples miss a peak by up to half a step: 1 - cos(pi / 100) = 5e-4 of the amplitude.
    np.testing.assert_allclose(mean[200:-200], 0.0, atol=2e-3)
    np.testing.assert_allclose(amplitude[200:-200], 3.0, rtol=1e-3)


def test_scale_goes_through():
    x = noisy_tone(1000, 3)
    # Powers of two scale without rounding.
    np.testing.assert_array_equal(local_mean_decomposition(2.0**-20 * x), 2.0**-20 * local_mean_decomposition(x))


def test_what_has_no_extrema_is_all_residual():
    ramp = np.linspace(-1.0, 5.0, 100)
    np.testing.assert_array_equal(local_mean_decomposition(ramp), [ramp])


def test_what_is_not_finite_is_refused():
    with pytest.raises(ValueError, match="signal"):
        local_mean_decomposition(np.array([1.0, np.nan, 2.0]))
