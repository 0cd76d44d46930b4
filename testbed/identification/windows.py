"""The parts of a spectrum over which a response is fitted: around what the reference has most of."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from testbed.signals import FloatArray

# Half of a part: 6 % of its frequency, so that the response is nearly a parabola in it; enough bins for an estimate of
# the noise, and no more than needed.
_SHARE, _FEWEST, _MOST = 0.06, 8, 128
# Bins that leave some for the noise.
_LEAST = 11
# Bins below belong to the drift.
_FIRST = 2
# A line stands this far above the others of its part; so many bins on each side are its own.
_STANDS, _OWN = 30.0, 1
# A sine that lasts for a fiftieth of the record has skirts that fall off as (50 / pi m)^2 in power, m bins from it;
# what is weaker than that, and by this factor, has spilled over.
_SHORTEST, _WEAK = 50.0, 0.03


class SpectrumPart(NamedTuple):
    """A part of a spectrum.

    Parameters
    ----------
    bins : ndarray of int, shape (n_bin,)
        Its bins, without those of other lines.
    peak : int
        The strongest bin.
    is_line : bool
        Whether that is a line that stands alone.
    """

    bins: np.ndarray
    peak: int
    is_line: bool


def spectrum_parts(power: FloatArray) -> list[SpectrumPart]:
    """Return parts of a spectrum, each around its strongest bin, in the order of frequency.

    Lines that stand alone have a narrow part each, which may reach into a neighbour's; all else is divided into parts
    that do not overlap, from the strongest on. What spilled over from something stronger is left out.

    Parameters
    ----------
    power : ndarray, shape (n_freq,)
        Power of the reference at multiples of the inverse length of the record, the first one at 1.
    """
    low, high = _ends(power.size)
    free = (np.arange(power.size) >= _FIRST) & (high <= power.size) & (power > 0.0)
    lines = np.flatnonzero(free & _stands(power))
    found = {int(peak): _line(int(peak), lines) for peak in lines}
    for part in found.values():
        free &= (high <= part.bins[0]) | (low > part.bins[-1])
    left = np.where(free, power, 0.0)
    while left.any():
        peak = int(np.argmax(left))
        found[peak] = SpectrumPart(np.arange(low[peak], high[peak]), peak, is_line=False)
        left[(high > low[peak]) & (low < high[peak])] = 0.0
    peaks = np.array(list(found), dtype=int)
    return [found[peak] for peak in sorted(found) if not _spilled(peak, peaks, power)]


def quiet_parts(parts: Sequence[SpectrumPart], reference: FloatArray, output: FloatArray) -> list[SpectrumPart]:
    """Return parts of what a reference's parts leave of the spectrum, for the noise there; lines of the output alone,
    such as hum, are none.

    Parameters
    ----------
    parts : sequence of SpectrumPart
        Those of the reference.
    reference, output : ndarray, shape (n_freq,)
        Power at multiples of the inverse length of the record, the first one at 1.
    """
    free = reference > 0.0
    free[:_FIRST] = False
    for part in parts:
        free[part.bins] = False
    for line in np.flatnonzero(_stands(output)):
        free[max(line - _OWN, 0) : line + _OWN + 1] = False
    (low, high), begin, found = _ends(free.size), _FIRST, []
    while begin < free.size:
        end = begin + int(high[begin] - low[begin])
        bins = begin + np.flatnonzero(free[begin:end])
        if bins.size >= _LEAST:
            found.append(SpectrumPart(bins, int(bins[bins.size // 2]), is_line=False))
        begin = end
    return found


def _ends(n_freq: int) -> tuple[np.ndarray, np.ndarray]:
    """Return where the part around each bin begins, and the bin behind its last."""
    bins = np.arange(n_freq)
    half = np.clip(np.rint(_SHARE * bins), _FEWEST, _MOST).astype(int)
    low = np.maximum(bins - half, 0)
    return low, low + 2 * half + 1


def _line(peak: int, lines: np.ndarray) -> SpectrumPart:
    """Return the part around a line; what others have there says nothing of the response at this one."""
    low = max(peak - _FEWEST, 0)
    bins = np.arange(low, low + 2 * _FEWEST + 1)
    others = lines[lines != peak]
    apart = np.abs(bins[:, None] - others[None, :]).min(axis=1, initial=bins[-1] + 1)
    kept = bins[(apart > _OWN) | (np.abs(bins - peak) <= _OWN)]
    return SpectrumPart(kept if kept.size >= _LEAST else bins, peak, is_line=True)


def _stands(power: FloatArray) -> np.ndarray:
    """Return which bins are lines: above both neighbours, and far above most within their reach."""
    from scipy.ndimage import median_filter

    level = median_filter(power, 2 * _FEWEST + 1, mode="mirror")
    padded = np.concatenate([[0.0], power, [0.0]])
    return (power >= padded[:-2]) & (power > padded[2:]) & (power > _STANDS * level)


def _spilled(peak: int, peaks: np.ndarray, power: FloatArray) -> bool:
    away = np.maximum(np.abs(peaks - peak), 1)
    return bool(np.any(power[peak] < power[peaks] * np.minimum(_WEAK, (_SHORTEST / np.pi / away) ** 2)))
