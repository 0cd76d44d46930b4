"""What rounding to words does to a record of noise, and what can be said of the noise then.

Noise of half a word and more makes the error of rounding uniform and independent, w^2/12 in each sample, to a per cent
(Sheppard); below, the readings tell where in its word the rate stands, and not how large the noise is.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from testbed.pages.numbers import significant

if TYPE_CHECKING:
    from testbed.allan import AllanCurve
    from testbed.judging.allan_records import RateRecord

_UNIFORM = 1.0 / 12.0
# Noise of half a word, and its rounding, in words squared.
_LEAST = 0.25 + _UNIFORM
# Share of the variance below which rounding is not worth a word.
_NOTHING = 1e-3


def sample_variance(record: RateRecord) -> float:
    """Return half the mean square of the steps from sample to sample [rad^2/s^2], the variance of white noise."""
    steps = np.diff(record.rate)
    known = steps[np.isfinite(steps)]
    return float(known @ known) / (2.0 * max(known.size, 1))


def is_rounding(record: RateRecord) -> bool:
    """Return whether the noise of a record is less than half a word of its rounding."""
    return record.word > 0.0 and sample_variance(record) < _LEAST * record.word**2


def rounding_text(record: RateRecord) -> str:
    """Return what can be said of such a record: an upper limit of its white noise.

    The readings differ from the rate by half a word at most, so that the standard deviation of the rate is at most
    that of the readings and half a word.
    """
    spread = math.sqrt(sample_variance(record)) + record.word / 2.0
    limit = significant(60.0 * math.degrees(spread / math.sqrt(record.sample_rate_hz)), 3)
    word = significant(math.degrees(record.word), 4)
    return (
        f"The record is rounding: its words of {word} deg/s are more than twice the noise, so no coefficient is given; "
        f"the angle random walk is below {limit} deg/sqrt(h). Record with a finer range, or before rounding."
    )


def without_rounding(curve: AllanCurve, record: RateRecord) -> AllanCurve:
    """Return the curve less the variance w^2 / (12 m) of rounding, where that is something.

    Parameters
    ----------
    curve : AllanCurve
        Of the record.
    record : RateRecord
        With its word.
    """
    if not _matters(record):
        return curve
    rest = 1.0 - record.word**2 * _UNIFORM / np.round(curve.tau * curve.sample_rate_hz) / curve.deviation**2
    scale = np.sqrt(np.maximum(rest, _NOTHING))
    return replace(curve, deviation=curve.deviation * scale, lower=curve.lower * scale, upper=curve.upper * scale)


def taken_off(record: RateRecord) -> str:
    """Return what `without_rounding` did, as a sentence; empty if nothing."""
    if not _matters(record):
        return ""
    word, share = math.degrees(record.word), record.word**2 * _UNIFORM / sample_variance(record)
    return f"rounding to words of {word:.4g} deg/s, {100.0 * share:.2g} % of the variance of a sample, is taken off"


def _matters(record: RateRecord) -> bool:
    added = record.word**2 * _UNIFORM
    return added > 0.0 and not is_rounding(record) and added >= _NOTHING * sample_variance(record)
