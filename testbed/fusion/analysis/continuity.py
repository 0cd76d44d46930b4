"""What a sensor's readings show by themselves: gaps, readings that repeat, readings at the end of the range."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from testbed.fusion.analysis.finding import Finding
from testbed.fusion.gate import most_repeats, step_std

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from testbed.fusion.analysis.paths import Trace

# A gap is a finding from this length [s] and this many intervals on, and whatever their lengths from this share on.
_LONG_GAP, _INTERVALS, _LOST = 0.01, 5.0, 0.02
# Words are coarse from so many believed ones on, if all steps are whole ones to this part.
_COARSE, _WHOLE = 2.0, 0.05


def continuity_findings(name: str, trace: Trace, factor: float = 1.0) -> Iterator[Finding]:
    """Yield what stands against the readings of a sensor by themselves.

    Parameters
    ----------
    name : str
        Of the sensor.
    trace : Trace
        Its readings.
    factor : float, optional
        What they are too large by, if their unit is not the one that was said [-].
    """
    yield from _gaps(name, trace)
    limit = math.inf if trace.belief.range is None else trace.belief.range - 1.5 * (trace.belief.resolution or 0.0)
    at_end, count = np.abs(trace.z) >= factor * limit, trace.z.size
    # What stands at the end of the range repeats itself there.
    stuck = repeated(trace) & ~at_end
    if stuck.any():
        said = (
            f"{np.count_nonzero(stuck)} readings repeat each other, more than {_most(trace)} in a row, as none of the "
            "believed noise and resolution do"
        )
        word = _coarse_word(trace)
        remedy = f"{said}: mend what stuck, or take them for missing"
        if word:
            remedy = (
                f"{said}, and filters take them for missing: all are words of {math.degrees(word):.4g} deg/s, so "
                "believe that resolution"
            )
        yield Finding("repeats", name, np.count_nonzero(stuck) / count, math.nan, math.nan, "1", remedy)
    ends = np.count_nonzero(at_end)
    if ends:
        remedy = (
            f"{ends} readings are at the end of the range or beyond, and filters take them for missing: take a wider "
            "range, or correct that of the belief"
        )
        yield Finding("saturation", name, ends / count, math.nan, math.nan, "1", remedy)


def _coarse_word(trace: Trace) -> float:
    """Return the word of readings that are coarser than is believed, and repeat no longer than such words do [rad/s]; 0
    if they are not.
    """
    z = trace.z[np.isfinite(trace.z)]
    steps = np.diff(np.unique(z))
    word = float(steps.min(initial=math.inf))
    if not _COARSE * (trace.belief.resolution or math.inf) < word < math.inf:
        return 0.0
    if np.any(np.abs(steps / word - np.rint(steps / word)) > _WHOLE):
        return 0.0
    coarse = replace(trace, belief=trace.belief.model_copy(update={"resolution": word}))
    return 0.0 if repeated(coarse).any() else word


def repeated(trace: Trace) -> NDArray[np.bool_]:
    """Return which readings belong to a run of equal ones that is too long for the believed noise, shape (n_time,).

    Parameters
    ----------
    trace : Trace
        Readings and belief.
    """
    most, z = _most(trace), trace.z
    if not most:
        return np.zeros(z.size, dtype=bool)
    begins = np.flatnonzero(np.concatenate([[True], np.diff(z) != 0.0]))
    lengths = np.diff(begins, append=z.size)
    return np.repeat(lengths > most, lengths)


def _most(trace: Trace) -> int:
    return most_repeats(step_std(trace.belief, 1.0 / trace.interval), trace.belief.resolution)


def _gaps(name: str, trace: Trace) -> Iterator[Finding]:
    good = trace.t[np.isfinite(trace.z)]
    usual = trace.interval
    between = np.diff(good, prepend=trace.t[0] - usual, append=trace.t[-1] + usual)
    missing = float(np.sum(np.maximum(np.rint(between / usual) - 1.0, 0.0)))
    share, longest = missing / (missing + good.size), float(between.max())
    if longest > max(_LONG_GAP, _INTERVALS * usual) or share > _LOST:
        remedy = (
            f"{missing:.0f} readings are missing, for {longest:.3g} s at the longest: filters predict through a gap, "
            "and their std says how far"
        )
        yield Finding("gaps", name, share, math.nan, math.nan, "1", remedy)
