"""Sensors of a recording against each other, beside what is believed of them."""

from __future__ import annotations

import numpy as np
import pytest

from testbed.fusion.belief import load_belief
from testbed.playback.cross import sensor_agreement
from testbed.playback.lineup import line_up
from testbed.playback.reel import Reel

LAG = 2.0 * np.pi * 30.0  # of a first-order low-pass at 30 Hz [rad/s]
BELIEF = load_belief(
    {
        "fast": {"numerator": [1.0], "denominator": [1e-5, 1.0], "output_noise": 1e-6},
        "slow": {"numerator": [LAG], "denominator": [1.0, LAG], "output_noise": 1e-6},
    }
)
FAST, SLOW = 2000.0, 500.0


def lines(t, gain=1.0):
    """Return tones of one rate, and of it behind the low-pass, in steady state."""
    freq = np.array([3.3, 7.7, 15.0, 33.0, 71.0, 130.0])
    phase = 2.0 * np.pi * freq * t[:, None] + np.arange(freq.size)
    answer = gain * LAG / (2j * np.pi * freq + LAG)
    return np.sin(phase).sum(axis=1), (abs(answer) * np.sin(phase + np.angle(answer))).sum(axis=1)


@pytest.mark.parametrize("start", [0, 777_000])
def test_a_gain_shows_over_the_belief_and_the_belief_s_own_lag_does_not(start):
    """On one grid and between its steps; a fast step of half a millisecond costs 0.5 % at 130 Hz, a window's skirt the
    change of the low-pass over two of its bins.
    """
    t, late = np.arange(40_000) / FAST, 1e-9 * start + np.arange(10_000) / SLOW
    fast, slow = Reel("fast", lines(t)[0], 0, FAST), Reel("slow", lines(late, 1.1)[1], start, SLOW)
    (pair,) = sensor_agreement(line_up([fast, slow], None, "x"), BELIEF, 1.0)
    assert (pair["first"], pair["second"]) == ("fast", "slow")
    assert [band["high_hz"] for band in pair["bands"]] == [1.0, 10.0, 100.0, 200.0]
    for band in pair["bands"][1:]:
        assert band["coherence"] > 0.99
        assert band["gain_over_belief"] == pytest.approx(1.1, rel=0.01)
        assert band["phase_off_belief_deg"] == pytest.approx(0.0, abs=1.0)


def test_what_is_not_shared_has_no_gain(rng):
    one, other = (1e-3 * rng.standard_normal(n) for n in (40_000, 10_000))
    (pair,) = sensor_agreement(
        line_up([Reel("fast", one, 0, FAST), Reel("slow", other, 0, SLOW)], None, "x"), BELIEF, 0.0
    )
    assert pair["bands"][-1]["coherence"] < 0.05
    assert pair["bands"][-1]["gain_over_belief"] is None
