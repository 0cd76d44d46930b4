"""The scale of an axis: its ends, where a value stands, and the marks with their texts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from testbed.pages.numbers import decade, plain

if TYPE_CHECKING:
    from testbed.signals import FloatArray

# Of the span on either side of the values [-].
_MARGIN = 0.04
# What differs by less than this share is one value: its digits would be the same on the axis.
_ALIKE = 1e-3
# A linear axis has at least this many steps; their lengths are these times a power of ten.
_STEPS, _LENGTHS = 4.0, (5.0, 2.0, 1.0)
# Powers of ten of a logarithmic axis beyond which not all of them are called by name, or marked between.
_MOST_POWERS = 10
# Of cells.
_TEXTS = 5


@dataclass(frozen=True)
class Scale:
    """An axis from `low` to `high`, both above zero where it is logarithmic, between two places on the page."""

    low: float
    high: float
    begin: float
    end: float
    log: bool

    def place(self, values: FloatArray) -> FloatArray:
        """Return where values stand; NaN for what a logarithmic axis cannot show.

        Parameters
        ----------
        values : ndarray, shape (n,)
            In the units of the axis.
        """
        low, high, found = self.low, self.high, np.asarray(values, dtype=float)
        if self.log:
            low, high, found = np.log10(low), np.log10(high), np.log10(np.where(found > 0.0, found, np.nan))
        return self.begin + (found - low) / (high - low) * (self.end - self.begin)

    def marks(self) -> list[tuple[float, str]]:
        """Return the values that have a text, with it."""
        if not self.log:
            return [(value, plain(value).replace("-", "−")) for value in self._even()]
        powers = self._powers(1.0)
        if len(powers) < 2:
            powers = sorted([*powers, *self._powers(2.0), *self._powers(5.0)])
        if len(powers) < 2:  # less than from 2 to 5
            return [(value, plain(value)) for value in self._even()]
        powers = powers[:: 1 + (len(powers) - 1) // _MOST_POWERS]
        return [(value, decade(value, (powers[0], powers[-1]))) for value in powers]

    def between(self) -> list[float]:
        """Return the values that have a mark without a text: the multiples of the powers of ten."""
        many = not self.log or len(self._powers(1.0)) > _MOST_POWERS
        return [] if many else sorted(value for k in range(1, 10) for value in self._powers(float(k)))

    def _powers(self, times: float) -> list[float]:
        low, high = np.log10(self.low / times), np.log10(self.high / times)
        return [times * 10.0 ** int(k) for k in range(int(np.ceil(low - 1e-9)), int(np.floor(high + 1e-9)) + 1)]

    def _even(self) -> list[float]:
        power = 10.0 ** np.floor(np.log10((self.high - self.low) / _STEPS))
        step = next((n * power for n in _LENGTHS if n * power * _STEPS <= self.high - self.low), power)
        first, last = np.ceil(self.low / step - 1e-9), np.floor(self.high / step + 1e-9)
        return [float(k * step) + 0.0 for k in np.arange(first, last + 1.0)]  # no zero with a sign


@dataclass(frozen=True)
class Cells:
    """An axis of cells side by side, each with a value: the first one from `begin` on, the last one up to `end`."""

    values: FloatArray
    begin: float
    end: float

    def place(self, numbers: FloatArray) -> FloatArray:
        """Return the middle of cells.

        Parameters
        ----------
        numbers : ndarray, shape (n,)
            Of the cells, from 0 on.
        """
        return self.begin + (np.asarray(numbers, dtype=float) + 0.5) * self.width

    @property
    def width(self) -> float:
        """Of a cell, below zero where the axis begins below."""
        return (self.end - self.begin) / len(self.values)

    def marks(self) -> list[tuple[float, str]]:
        """Return the numbers of cells that have a text, with it."""
        last = len(self.values) - 1
        chosen = np.unique(np.linspace(0, last, min(last + 1, _TEXTS)).round().astype(int))
        return [(float(k), f"{self.values[k]:.3g}".replace("-", "−")) for k in chosen]

    def between(self) -> list[float]:
        """Return nothing: no mark stands without a text."""
        return []


def scale_over(values: FloatArray, begin: float, end: float, *, log: bool) -> Scale:
    """Return the scale that shows all finite values, on a logarithmic one those above zero.

    Parameters
    ----------
    values : ndarray, shape (n,)
        In any units; without one that can be shown it goes from 0 (log: 1) to 1 (log: 10).
    begin, end : float
        Where it stands on the page.
    log : bool
        Whether it is logarithmic.
    """
    known = np.asarray(values, dtype=float)
    known = known[np.isfinite(known) & ((known > 0.0) if log else True)]
    if not known.size:
        return Scale(1.0 if log else 0.0, 10.0 if log else 1.0, begin, end, log)
    low, high = float(known.min()), float(known.max())
    alike = high - low <= _ALIKE * max(abs(low), abs(high))
    if log:
        share = 1.2 if alike else max(high / low, 1.5) ** _MARGIN
        low, high = low / share, high * share
    else:
        room = (0.5 * abs(high) or 0.5) if alike else _MARGIN * (high - low)
        low, high = low - room, high + room
    return Scale(low, high, begin, end, log)
