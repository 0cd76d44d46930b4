"""What the numbers of a channel are like, looked at block by block: size, word, repeats, saturation, an outline."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from testbed.signals import FloatArray

# Rows of the outline beyond which pairs are joined, and samples that the word is looked for in.
_ROWS, _SAMPLE = 8192, 200_000
# Ranges of the middle 98 % by which a number must stand off to be a stray one: 90 standard deviations of noise.
_FAR = 20.0
# A word is one if all differences are whole multiples of it to this part, up to so many words.
_WHOLE, _MOST_WORDS = 0.05, 1e9
# Share of equal neighbours, and word in steps, from which on values count as repeated; of a slower sensor no value
# stands more than so many times the usual number.
_REPEATED, _FINE, _UNUSUAL = 0.2, 0.2, 10.0
# Words that a record must reach over to be at an end of its range, and not of its noise.
_NOISE_WORDS = 8.0
# Share of samples at an end that counts as saturation, if three stand in a row or the words are a tenth of the noise:
# chance puts several samples on the same coarse word.
_AT_END, _IN_A_ROW, _FINE_WORD = 1e-3, 3, 0.1


@dataclass(frozen=True)
class Values:
    """What the numbers of a channel are like, in their own unit.

    Parameters
    ----------
    n_time, n_missing : int
        Numbers, and how many are missing.
    low, high, mean, std : float
        Of those that are there.
    step_std : float
        Standard deviation of a number about its neighbours: rms difference over the square root of two.
    word : float
        To what the numbers are rounded; 0 if they are not.
    equal : float
        Share of numbers that are equal to the one before.
    repeats : float
        How many times each value stands, where values are repeated rather than rounded; else 1.
    row_equal : int
        The most equal numbers in a row.
    at_low, at_high : int
        How many stand at an end.
    row_low, row_high : int
        The most in a row that do.
    outline : ndarray, shape (n_column, 2)
        Lowest and highest number of each stretch.
    usual : tuple of float
        Between what the middle 98 % of the numbers stand.
    """

    n_time: int
    n_missing: int
    low: float
    high: float
    mean: float
    std: float
    step_std: float
    word: float
    equal: float
    repeats: float
    row_equal: int
    at_low: int
    at_high: int
    row_low: int
    row_high: int
    outline: FloatArray
    usual: tuple[float, float]

    @property
    def stray(self) -> tuple[float, int] | None:
        """A value at an end that stands far from all others, and how often; None if there is none."""
        low, high = self.usual
        room = _FAR * (high - low)
        for value, count in ((self.low, self.at_low), (self.high, self.at_high)):
            if room > 0.0 and (value < low - room or value > high + room):
                return value, count
        return None

    @property
    def saturated(self) -> bool:
        """Whether the numbers stand still at an end, as those of a sensor out of its range do."""
        if self.rounded and self.high - self.low < _NOISE_WORDS * self.word:
            return False
        fine = self.word < _FINE_WORD * self.step_std
        still = (self.at_low, self.row_low), (self.at_high, self.row_high)
        many = max(_AT_END * self.n_time, _IN_A_ROW)
        return self.repeats == 1.0 and any(
            n > many and (fine or row >= _IN_A_ROW) for n, row in still if self.std > 0.0
        )

    @property
    def still(self) -> bool:
        """Whether repeated values are no slower sensor's: one stands far longer than they usually do."""
        return self.repeats > 1.0 and self.row_equal > _UNUSUAL * self.repeats

    @property
    def rounded(self) -> bool:
        """Whether the noise is less than half a word, so that the readings tell of the rounding, not of the noise."""
        return self.word > 0.0 and self.step_std**2 < (0.25 + 1.0 / 12.0) * self.word**2


class ValueScan:
    """Look at the numbers of a channel block by block."""

    def __init__(self) -> None:
        self._n_time, self._n_known, self._n_equal = 0, 0, 0
        self._origin, self._sum, self._square = 0.0, 0.0, 0.0
        self._n_pairs, self._pair_square = 0, 0.0
        self._low, self._high = np.inf, -np.inf
        self._ends = {-1: (0, 0), 1: (0, 0)}
        self._last, self._row_equal = np.nan, 0
        self._sample: list[FloatArray] = []
        self._outline, self._stride = np.empty((0, 2)), 1

    def add(self, values: FloatArray) -> None:
        """Take the next numbers, NaN where one is missing."""
        self._n_time += values.size
        known = values[np.isfinite(values)]
        if not known.size:
            return
        if not self._n_known:
            self._origin = float(known[0])
        # Of numbers that are none the squares are infinite, and so is what comes of them.
        with np.errstate(over="ignore", invalid="ignore"):
            rest = known - self._origin
            self._sum += float(rest.sum())
            self._square += float(rest @ rest)
            self._pairs(values)
        self._extremes(known)
        if sum(part.size for part in self._sample) < _SAMPLE:
            self._sample.append(known[:_SAMPLE])
        self._n_known += known.size
        self._draw(known)

    def result(self) -> Values:
        """Return what was found."""
        n = max(self._n_known, 1)
        mean = self._sum / n
        sample = np.concatenate(self._sample) if self._sample else np.empty(0)
        step_std = float(np.sqrt(self._pair_square / max(2 * self._n_pairs, 1)))
        word, equal = word_size(sample), self._n_equal / max(self._n_pairs, 1)
        moving = step_std * np.sqrt(2.0 / max(1.0 - equal, 1e-9))
        repeated = equal > _REPEATED and word < _FINE * moving
        nothing = not self._n_known
        return Values(
            n_time=self._n_time,
            n_missing=self._n_time - self._n_known,
            low=np.nan if nothing else float(self._low),
            high=np.nan if nothing else float(self._high),
            mean=np.nan if nothing else self._origin + mean,
            std=_std(self._square / n, mean),
            step_std=step_std,
            word=word,
            equal=equal,
            repeats=1.0 / (1.0 - equal) if repeated and equal < 1.0 else 1.0,
            row_equal=self._row_equal,
            at_low=self._ends[-1][0],
            at_high=self._ends[1][0],
            row_low=self._ends[-1][1],
            row_high=self._ends[1][1],
            outline=self._outline,
            usual=_middle(sample),
        )

    def _pairs(self, values: FloatArray) -> None:
        steps = np.diff(values, prepend=self._last)
        self._row_equal = max(self._row_equal, 1 + _longest_row(steps == 0.0))
        steps = steps[np.isfinite(steps)]
        self._n_pairs += steps.size
        self._n_equal += int(np.count_nonzero(steps == 0.0))
        self._pair_square += float(steps @ steps)
        self._last = float(values[-1])

    def _draw(self, known: FloatArray) -> None:
        """Add rows to the outline; when there are too many, join them in pairs."""
        starts = np.arange(0, known.size, self._stride)
        rows = np.stack([np.minimum.reduceat(known, starts), np.maximum.reduceat(known, starts)], axis=1)
        outline = np.concatenate([self._outline, rows])
        while len(outline) > _ROWS:
            even = outline[: len(outline) // 2 * 2].reshape(-1, 2, 2)
            outline = np.stack([even[:, :, 0].min(axis=1), even[:, :, 1].max(axis=1)], axis=1)
            self._stride *= 2
        self._outline = outline

    def _extremes(self, known: FloatArray) -> None:
        """Count the numbers at each end, and the most in a row; a run across two blocks counts as two."""
        low, high = min(self._low, float(known.min())), max(self._high, float(known.max()))
        for side, old, new in ((-1, self._low, low), (1, self._high, high)):
            count, row = self._ends[side] if old == new else (0, 0)
            here = known == new
            count, row = count + int(np.count_nonzero(here)), max(row, _longest_row(here))
            self._ends[side] = (count, row)
        self._low, self._high = low, high


def _longest_row(here: NDArray[np.bool_]) -> int:
    """Return the most that are true in a row."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], here, [False]]).astype(np.int8)))
    return int(np.diff(edges)[::2].max()) if edges.size else 0


def _middle(values: FloatArray) -> tuple[float, float]:
    """Return between what the middle 98 % of finite numbers stand; NaN for none."""
    if not values.size:
        return np.nan, np.nan
    low, high = np.quantile(values, [0.01, 0.99])
    return float(low), float(high)


def word_size(values: FloatArray) -> float:
    """Return the word that numbers are whole multiples of; 0 if there is none.

    Parameters
    ----------
    values : ndarray, shape (n_time,)
        Finite numbers.

    Returns
    -------
    float
        Greatest common divisor of their differences, as far as they have one.
    """
    steps = np.diff(np.unique(values))
    steps = steps[steps > 1e-12 * np.max(np.abs(values), initial=0.0)]
    if not steps.size:
        return 0.0
    word = float(steps.min())
    counts = np.rint(steps / word)
    if counts.sum() > _MOST_WORDS:
        return 0.0
    if np.any(np.abs(steps / word - counts) > _WHOLE * np.maximum(counts / 10.0, 1.0)):
        return 0.0
    return float(steps.sum() / counts.sum())


def _std(square: float, mean: float) -> float:
    """Return the standard deviation of what has this mean square and mean; infinite where the squares overflow."""
    if not np.isfinite(square):
        return np.inf
    return float(np.sqrt(max(square - mean**2, 0.0)))
