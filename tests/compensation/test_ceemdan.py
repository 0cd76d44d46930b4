"""CEEMDAN: against the equations written out with the peer's sifting, the same bits for any thread count, and
Colominas' claim.
"""

from __future__ import annotations

import numpy as np
import pytest

from testbed.compensation.ceemdan import ceemdan
from testbed.compensation.emd import emd
from testbed.signals import random_stream
from tests.compensation.records import noisy_tone, peer_modes

VARIANTS = ("improved", "classic")


def mode(signal, k):
    """Return E_k by the peer, zero where the record has no such mode; E_0 is the record."""
    if k == 0:
        return signal
    modes = peer_modes(signal)
    # The last row is what no longer has three extrema.
    return modes[k - 1] if k < len(modes) else np.zeros(signal.size)


def written_out(signal, variant, trials, noise, stages):
    """Return the residuals r_1, r_2 ... of the equations as they stand in the docstring."""
    whites = [random_stream(0, "ceemdan", str(i)).standard_normal(signal.size) for i in range(trials)]
    residuals = [signal]
    for k in range(1, stages + 1):
        r, total = residuals[-1], np.zeros(signal.size)
        for white in whites:
            if variant == "improved":
                own = mode(white, k)
                noisy = r + noise * np.std(r) * own / (np.std(own) if k == 1 else 1.0)
                total += noisy - mode(noisy, 1)
            else:
                noisy = r + noise * np.std(r) * mode(white, k - 1)
                total += r - mode(noisy, 1)
        residuals.append(total / trials)
    return np.array(residuals)


@pytest.mark.oracle
@pytest.mark.parametrize("variant", VARIANTS)
def test_ceemdan_is_its_equations(variant):
    signal = noisy_tone(256, 1)
    modes = ceemdan(signal, variant=variant, trials=7, noise=0.3)
    residuals = written_out(signal, variant, trials=7, noise=0.3, stages=5)
    assert len(modes) > 5
    # Sums in another order: rounding, amplified by ten sifts per stage.
    assert np.allclose(modes[:5], -np.diff(residuals, axis=0), rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("variant", VARIANTS)
def test_the_bits_do_not_depend_on_the_threads(variant):
    signal = noisy_tone(1500, 2)
    one, two, three = (ceemdan(signal, variant=variant, trials=23, threads=threads) for threads in (1, 2, 3))
    assert np.array_equal(one, two)
    assert np.array_equal(one, three)


def test_the_seed_decides_the_noise():
    signal = noisy_tone(400, 3)
    first, again, other = (ceemdan(signal, trials=6, seed=seed) for seed in (5, 5, 6))
    assert np.array_equal(first, again)
    assert not np.array_equal(first[0], other[0])


@pytest.mark.parametrize("variant", VARIANTS)
def test_without_noise_it_is_plain_emd(variant):
    """Equal trials average to themselves within rounding."""
    signal = noisy_tone(600, 4)
    assert np.allclose(ceemdan(signal, variant=variant, trials=6, noise=0.0), emd(signal), rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("variant", VARIANTS)
def test_modes_add_up_to_the_signal(variant):
    """True by construction (each mode is a difference of residuals), so it proves little."""
    signal = noisy_tone(900, 5)
    modes = ceemdan(signal, variant=variant, trials=6)
    assert np.allclose(
        modes.sum(axis=0), signal, rtol=0.0, atol=len(modes) * 4.0 * np.finfo(float).eps * np.abs(signal).max()
    )


@pytest.mark.property
def test_the_improved_variant_leaves_less_noise_and_fewer_modes():
    """Colominas 2014: the classic variant averages modes of tone + noise, so that 1/sqrt(trials) of the noise stays in
    them.

    A tone alone: every mode but one is spurious. The noise is 0.2 of the tone and most of white noise is in its first
    mode, hence the bounds of the classic first mode; the improved one holds only what sifting of tone + noise leaves of
    the tone's local mean.
    """
    tone, trials = np.sin(2.0 * np.pi * np.arange(4000) / 100.0), 20
    for seed in range(3):
        found = {v: ceemdan(tone, variant=v, trials=trials, seed=seed).std(axis=1) for v in VARIANTS}
        expected = 0.2 * tone.std() / np.sqrt(trials)
        assert 0.6 * expected < found["classic"][0] < expected
        assert found["improved"][0] < 0.5 * found["classic"][0]
        spurious = {v: np.sqrt(np.sum(std**2) - std.max() ** 2) for v, std in found.items()}
        assert spurious["improved"] < 0.5 * spurious["classic"]
        assert found["improved"].size < found["classic"].size


@pytest.mark.property
def test_added_noise_keeps_an_intermittent_tone_in_one_mode():
    """Plain EMD gives the slow tone to the first mode where the fast one is off (mode mixing); CEEMDAN does so less."""
    t = np.arange(4000)
    slow, on = np.sin(2.0 * np.pi * t / 60.0), (t > 1500) & (t < 2500)
    signal = slow + np.where(on, 0.5 * np.sin(2.0 * np.pi * t / 8.0), 0.0)
    quiet = slice(200, 1300)

    def slow_in_fast(modes):
        """Share of the slow tone in modes that are fast where the fast tone is on, seen where it is off."""
        fast = [m for m in modes[:-1] if np.count_nonzero(np.diff(np.signbit(m[1600:2400]))) > 800 / 15]
        return np.std(sum(fast)[quiet]) / np.std(slow[quiet])

    assert slow_in_fast(emd(signal)) > 0.9
    assert slow_in_fast(ceemdan(signal, trials=20)) < 0.3


@pytest.mark.parametrize(
    "signal", [np.full(50, 3.0), np.arange(50.0), np.array([1.0, 2.0])], ids=["constant", "rising", "short"]
)
def test_a_record_without_three_extrema_is_all_residual(signal):
    assert np.array_equal(ceemdan(signal, trials=2), signal[None])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"variant": "best"}, "variant: expected one of improved, classic"),
        ({"trials": 0}, "trials: expected at least 1"),
        ({"threads": 0}, "threads: expected at least 1"),
        ({"sifts": 0}, "sifts: expected at least 1"),
        ({"noise": -0.1}, "noise: expected"),
        ({"noise": np.nan}, "noise: expected"),
        ({"signal": np.array([1.0, np.nan])}, "signal: expected finite"),
    ],
)
def test_bad_input_is_refused(options, message):
    with pytest.raises(ValueError, match=message):
        ceemdan(**{"signal": np.arange(9.0), **options})
