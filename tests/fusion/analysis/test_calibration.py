"""Gain and delay block after block: known ones come back within their claims, and small motion leaves the prior."""

from __future__ import annotations

import math

import numpy as np
import pytest

from testbed.fusion.analysis.calibration import Calibrated, Calibration
from tests.fusion.analysis.test_agreement import FAST, FS, LINES, SLOW, read

BLOCK = round(FS)
OPEN = 1e6  # a prior that says nothing


def calibrated(
    seed, *, gain=1.0, delay=0.0, lines=LINES, seconds=12, prior=(OPEN, OPEN), many=1, lost=(), at_rest=False
):
    """Return what is known after some seconds of a noisy sensor that is late and reads too much."""
    rng = np.random.default_rng(seed)
    t = np.arange(seconds * BLOCK) / FS
    noisy = gain * read(SLOW, t - delay, rng, lines)
    # The clean one is read many times in a step, of which the mean is given, with the noise of one reading over many.
    fine = (t[:, None] + np.arange(many) / (many * FS)).ravel()
    clean = read(FAST.model_copy(update={"output_noise": 0.0}), fine, rng, lines).reshape(-1, many).mean(axis=1)
    clean += FAST.output_noise * math.sqrt(FS) * rng.normal(size=t.size)
    noisy[list(lost)] = np.nan
    known = Calibration(SLOW, FAST, FS, (1, many), *prior, at_rest=at_rest)
    found = None
    for k in range(seconds):
        part = slice(k * BLOCK, (k + 1) * BLOCK)
        found = known.add(noisy[part], clean[part])
    return found


@pytest.mark.oracle
@pytest.mark.parametrize(("gain", "delay", "many"), [(1.0, 0.0, 1), (1.01, 5e-4, 1), (0.99, -2e-3, 10)])
def test_known_ones_come_back_within_their_claims(gain, delay, many):
    """Of 60 records the squares of the normed errors, 2 each, are chi-squared of 120: 99.9 % lie in (76, 175); half of
    the last and first second has half the weight, which the claim does not know: 7 %.
    """
    total = 0.0
    for seed in range(60):
        found = calibrated(seed, gain=gain, delay=delay, many=many)
        total += ((found.gain - gain) / found.gain_std) ** 2 + ((found.delay - delay) / found.delay_std) ** 2
    assert 76.0 < total / 1.07 < 175.0


def test_what_is_too_small_to_tell_leaves_the_prior():
    found = calibrated(1, lines=(), prior=(0.01, 5e-4))
    assert abs(found.gain - 1.0) < 1e-3
    assert found.gain_std == pytest.approx(0.01, rel=0.02)
    assert found.applied() == (1.0, 0.0)


def test_what_stands_out_is_applied_and_what_does_not_is_not():
    assert Calibrated(1.01, 5e-4, 0.005, 2.5e-4).applied() == (1.0, 0.0)
    gain, delay = Calibrated(1.01, -5e-4, 0.001, 5e-5).applied()
    # Ten standard deviations: 1 - (2 / 10)^2.
    assert gain - 1.0 == pytest.approx(0.96 * 0.01, rel=1e-12)
    assert delay == pytest.approx(-0.96 * 5e-4, rel=1e-12)
    assert Calibrated(1.0, 0.0, 0.01, 5e-4).applied() == (1.0, 0.0)


STRONG = tuple((freq, 40.0 * rate, phase) for freq, rate, phase in LINES)


def test_a_record_that_begins_in_mid_motion_is_learned_from_once_its_dynamics_have_settled():
    """SLOW settles to a thousandth in 0.35 s. Told of a rest that is none, the first second counts as the others and
    gain and delay are four of their standard deviations off.
    """
    squares = []
    for told in (False, True):
        found = [calibrated(seed, lines=STRONG, seconds=4, at_rest=told) for seed in range(10)]
        squares.append(sum(((one.gain - 1.0) / one.gain_std) ** 2 + (one.delay / one.delay_std) ** 2 for one in found))
    # Chi-squared of 20: 99.9 % lie below 45.3; the ends of three seconds have half the weight.
    assert squares[0] / 1.2 < 45.3
    assert squares[1] > 20 * 3.0**2


def test_single_readings_that_are_missing_cost_nothing():
    """One in two hundred of a rate of 200 Hz: a straight line over 10 ms is off by (pi f / fs)^2 / 2, 0.5 % at 6 Hz."""
    lost = range(100, 12 * BLOCK, 200)
    whole, broken = calibrated(2, lines=STRONG), calibrated(2, lines=STRONG, lost=lost)
    assert broken.gain_std == pytest.approx(whole.gain_std, rel=0.01)
    assert abs(broken.gain - whole.gain) < 1e-4 + whole.gain_std
    assert abs(broken.delay - whole.delay) < 1e-5 + whole.delay_std


@pytest.mark.parametrize("lost", [range(5 * BLOCK, 5 * BLOCK + 7), range(5 * BLOCK, 6 * BLOCK, 50)])
def test_seconds_with_more_missing_tell_nothing_and_break_nothing(lost):
    whole, broken = calibrated(2), calibrated(2, lost=lost)
    # That second and the one in which the dynamics settle: three windows of eleven are left out.
    assert broken.gain_std / whole.gain_std == pytest.approx(math.sqrt(10.0 / 7.0), rel=0.03)
    assert abs(broken.gain - 1.0) < 4.0 * broken.gain_std
    assert abs(broken.delay) < 4.0 * broken.delay_std
