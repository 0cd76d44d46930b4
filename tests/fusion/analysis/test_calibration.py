"""Gain and delay block after block: known ones come back within their claims, and small motion leaves the prior."""

from __future__ import annotations

import math

import numpy as np
import pytest

from testbed.fusion.analysis.calibration import Calibrated, Calibration
from tests.fusion.analysis.test_agreement import FAST, FS, LINES, SLOW, read

BLOCK = round(FS)
OPEN = 1e6  # a prior that says nothing


def calibrated(seed, *, gain=1.0, delay=0.0, lines=LINES, seconds=12, prior=(OPEN, OPEN), many=1, lost=()):
    """Return what is known after some seconds of a noisy sensor that is late and reads too much."""
    rng = np.random.default_rng(seed)
    t = np.arange(seconds * BLOCK) / FS
    noisy = gain * read(SLOW, t - delay, rng, lines)
    # The clean one is read many times in a step, of which the mean is given, with the noise of one reading over many.
    fine = (t[:, None] + np.arange(many) / (many * FS)).ravel()
    clean = read(FAST.model_copy(update={"output_noise": 0.0}), fine, rng, lines).reshape(-1, many).mean(axis=1)
    clean += FAST.output_noise * math.sqrt(FS) * rng.normal(size=t.size)
    noisy[list(lost)] = np.nan
    known = Calibration(SLOW, FAST, FS, (1, many), *prior)
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


def test_seconds_with_a_missing_reading_tell_nothing_and_break_nothing():
    whole, broken = calibrated(2), calibrated(2, lost=(5 * BLOCK + 7,))
    # Two windows of eleven are left out.
    assert 1.0 < broken.gain_std / whole.gain_std < 1.4
    assert abs(broken.gain - 1.0) < 4.0 * broken.gain_std
    assert abs(broken.delay) < 4.0 * broken.delay_std
