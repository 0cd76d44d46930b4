"""Stretches that stand still and strays are told and left out of an Allan analysis; a slower sensor's words are not."""

from __future__ import annotations

import numpy as np
import pytest

from testbed.errors import ScenarioError
from testbed.judging.allan_analysis import analyse
from testbed.judging.allan_records import RateRecord
from testbed.judging.density import estimate_density
from testbed.judging.faulty_readings import faulty_readings, without_faults
from testbed.signals import random_stream

FS, SIGMA = 100.0, 1e-3
N = SIGMA / np.sqrt(FS)


def white(n=10_000, seed=1):
    return SIGMA * random_stream(seed, "noise").standard_normal(n)


def record(rate, word=0.0):
    return RateRecord("record", rate, FS, "a record", word=word)


@pytest.mark.oracle
@pytest.mark.parametrize("spoil", ["still", "strays"])
def test_n_is_covered_with_a_fifth_that_stands_still_and_with_strays(spoil):
    """Without leaving them out N is 11 % low, or 9 % high, in every record, and its interval never holds it."""
    held = 0
    for seed in range(20):
        rate = white(seed=seed)
        if spoil == "still":
            rate[4000:6000] = rate[4000]
        else:
            rate[[100, 2500, 7000, 7003, 9000]] += 20.0 * SIGMA
        found = analyse(record(rate)).fit.angle_random_walk
        held += found.lower <= N <= found.upper
        assert found.value == pytest.approx(N, rel=0.05)
    # Of 20 at 95 % fewer than 16 have a chance of 3e-3; before none held.
    assert held >= 16


def test_what_is_left_out_is_told_with_its_place():
    rate = white()
    rate[4000:4200], rate[9000] = rate[4000], 0.5
    kept = without_faults(record(rate))
    assert np.flatnonzero(np.isnan(kept.rate)).tolist() == [*range(4001, 4200), 9000]
    assert kept.notes == (
        "199 readings stand still, from 40.01 s on, as the noise of the others never does: left out as missing",
        "1 stand over ten standard deviations off their neighbours, first at 90 s: left out as missing",
    )
    assert [note for note in estimate_density(record(rate)).notes if "the density is of them too" in note]


def test_too_little_that_moves_is_refused_with_the_reason():
    rate = white()
    rate[2000:8000] = rate[2000]
    with pytest.raises(ScenarioError, match=r"expected at least half of 10000 samples.*5999 readings stand still"):
        analyse(record(rate))


@pytest.mark.parametrize("times", [1, 2, 20])
def test_the_words_of_noise_and_a_slower_sensor_are_no_faults(times):
    """Noise of half a word repeats by chance up to 20 times, and a sensor 20 times slower always does."""
    for word in (0.0, 0.1 * SIGMA, 1.99 * SIGMA):
        rate = np.repeat(white(40_000, seed=3), times)
        rate = np.rint(rate / word) * word if word else rate
        assert list(faulty_readings(record(rate, word))) == []


def test_rounding_stands_still_by_itself():
    word = 5.0 * SIGMA
    assert list(faulty_readings(record(np.rint(white() / word) * word, word))) == []


def test_a_line_and_a_jump_have_no_strays():
    t = np.arange(10_000) / FS
    assert list(faulty_readings(record(white() + 50.0 * SIGMA * np.sin(2.0 * np.pi * 17.0 * t)))) == []
    assert list(faulty_readings(record(white() + 50.0 * SIGMA * (t > 30.0)))) == []
