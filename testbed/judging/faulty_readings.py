"""Readings of a record that are no noise of its sensor: stretches that stand still, and strays beside their neighbours.

An Allan curve hides both: a stretch that stands still takes its share off every coefficient, and a few strays are white
noise to it, so that the five terms describe the curve and the intervals hold what is none of the gyro's.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.ndimage import median_filter

from testbed.fusion.gate import most_repeats
from testbed.judging.rounding import is_rounding, sample_variance
from testbed.signals import NORMAL_MEDIAN

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from testbed.judging.allan_records import RateRecord
    from testbed.signals import FloatArray

# So many equal readings in a row are no stretch, nor so many times the usual run of a slower sensor, which is told by
# the reader.
_FEWEST_STILL = 10
# A record with so many strays has something else in it than strays.
_MOST_STRAYS = 1e-3
# Of how many readings the middle one is taken, and by how many standard deviations a stray stands off it: 1e-20 of
# normal noise.
_AMONG, _FAR = 5, 10.0


class Faulty(NamedTuple):
    """Readings that are no noise, shape (n_time,), and what they are."""

    which: NDArray[np.bool_]
    text: str


def without_faults(record: RateRecord) -> RateRecord:
    """Return a record without the readings that are no noise of its sensor, NaN in their place, as its notes tell.

    Parameters
    ----------
    record : RateRecord
        Of a sensor at rest, or of a smooth motion.
    """
    rate, notes = record.rate, list(record.notes)
    for one in faulty_readings(record):
        rate = np.where(one.which, math.nan, rate)
        notes.append(f"{one.text}: left out as missing")
    return replace(record, rate=rate, notes=tuple(notes))


def faulty_readings(record: RateRecord) -> Iterator[Faulty]:
    """Yield the readings that stand still, without the first of each stretch, and those far off their neighbours.

    Parameters
    ----------
    record : RateRecord
        As for `without_faults`; of one that is rounding, which stands still by itself, none.
    """
    if is_rounding(record):
        return
    still, strays = _still(record), _strays(record)
    for which, most, text in (
        (still, 1.0, "{n} readings stand still, from {at:.6g} s on, as the noise of the others never does"),
        (strays, _MOST_STRAYS, "{n} stand over ten standard deviations off their neighbours, first at {at:.6g} s"),
    ):
        n = int(np.count_nonzero(which))
        if 0 < n < max(most * which.size, 2.0):
            yield Faulty(which, text.format(n=n, at=int(np.argmax(which)) / record.sample_rate_hz))


def _still(record: RateRecord) -> NDArray[np.bool_]:
    """Return which readings repeat the one before, in runs too long for the noise beside the words."""
    variance = sample_variance(record) - record.word**2 / 12.0
    chance = most_repeats(math.sqrt(max(variance, 0.0)), record.word) if record.word else _FEWEST_STILL
    if not chance:
        return np.zeros(record.rate.size, dtype=bool)
    begins = np.flatnonzero(np.diff(record.rate, prepend=math.nan) != 0.0)
    lengths = np.diff(begins, append=record.rate.size)
    usual = float(np.median(lengths)) if lengths.size else 1.0
    still = np.repeat(lengths > usual * max(chance, _FEWEST_STILL), lengths)
    still[begins] = False
    return still


def _strays(record: RateRecord) -> NDArray[np.bool_]:
    """Return which readings stand far off the middle of their neighbours, for the usual distance from it."""
    known = np.isfinite(record.rate)
    z = record.rate[known]
    off: FloatArray = np.abs(z - median_filter(z, _AMONG, mode="nearest"))
    usual = float(np.median(off[off > 0.0])) if off.any() else 0.0
    strays = np.zeros(known.size, dtype=bool)
    strays[known] = off > _FAR * max(usual / NORMAL_MEDIAN, record.word)
    return strays
