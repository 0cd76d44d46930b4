"""The time base of a recording: what its stamps say about the rate, and everything that is wrong with them.

Stamps are int64 nanoseconds. A step is compared with whole multiples of the usual one, so that rounded stamps, a clock
that drifts and lost samples are told apart: an even log stays even whatever its stamps are rounded to, as long as that
is less than a step.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from testbed.signals import FloatArray

    Stamps = NDArray[np.int64]

NANO = 1e-9
# Of a step: a sample that is missing is off by a whole one, jitter of the stamps by less.
TOLERANCE = 0.25
# Steps up to this many lost samples count for the rate: beyond, the sensor may have been started anew.
_ON_GRID = 20
# 95 % of a normal distribution.
_QUANTILE = 1.96
_KEPT = 1000
# Stamps looked at in one go: as many as stay in the processor's cache.
_CHUNK = 1 << 15
# Share of doubled stamps from which on the stamps are coarser than the samples.
_COARSE = 0.05


@dataclass(frozen=True)
class Event:
    """A place where time goes wrong: row of the sample after it, seconds from the start, length [s], samples lost."""

    row: int
    seconds: float
    length: float
    missing: int = 0


@dataclass
class Tally:
    """Events of a kind: how many, the first ones, and how many samples are lost in all."""

    count: int = 0
    missing: int = 0
    first: list[Event] = field(default_factory=list)

    def add(self, rows: NDArray[np.intp], seconds: FloatArray, length: FloatArray, missing: NDArray[Any]) -> None:
        """Count events, of which the first thousand are kept."""
        self.count += rows.size
        self.missing += int(missing.sum())
        for i in range(min(rows.size, _KEPT - len(self.first))):
            self.first.append(Event(int(rows[i]), float(seconds[i]), float(length[i]), int(missing[i])))


@dataclass(frozen=True)
class TimeBase:
    """What the stamps of a recording say.

    Parameters
    ----------
    n_time : int
        Number of samples.
    start_ns, end_ns : int
        First and last stamp [ns].
    step_ns : float
        Usual step [ns].
    rate_std_hz : float
        Standard deviation of the sample rate [Hz].
    step_std_ns : float
        Standard deviation of a step from sample to sample [ns].
    quantum_ns : int
        To what the stamps are rounded [ns].
    gaps, uneven, doubled, backward : Tally
        Lost samples, steps that are no multiple of the usual one, stamps twice, stamps that go back.
    wraps : int
        How often a counter began anew.
    """

    n_time: int
    start_ns: int
    end_ns: int
    step_ns: float
    rate_std_hz: float
    step_std_ns: float
    quantum_ns: int
    gaps: Tally
    uneven: Tally
    doubled: Tally
    backward: Tally
    wraps: int

    @property
    def rate_hz(self) -> float:
        """Sample rate [Hz] between lost samples."""
        return 1.0 / (NANO * self.step_ns) if self.step_ns > 0.0 else float("nan")

    @property
    def rate_limits_hz(self) -> tuple[float, float]:
        """95 % interval of the sample rate [Hz]."""
        return self.rate_hz - _QUANTILE * self.rate_std_hz, self.rate_hz + _QUANTILE * self.rate_std_hz

    @property
    def mean_rate_hz(self) -> float:
        """Samples per second of the whole record [Hz], lost ones not counted."""
        span = NANO * (self.end_ns - self.start_ns)
        return (self.n_time - 1) / span if span > 0.0 else float("nan")

    @property
    def coarse(self) -> bool:
        """Whether the stamps are rounded to more than a step."""
        return self.doubled.count > _COARSE * self.n_time

    @property
    def even(self) -> bool:
        """Whether the samples lie on an even grid, lost ones aside."""
        return not (self.uneven.count or self.doubled.count or self.backward.count)

    def said(self) -> str:
        """Return the sample rate with its interval, for the reader."""
        low, high = self.rate_limits_hz
        return f"{self.rate_hz:.6g} Hz ({low:.9g} to {high:.9g})"

    def agrees_with(self, rate_hz: float) -> bool:
        """Return whether a nominal rate [Hz] may be the true one: to a tenth of a per cent, or within the interval."""
        return abs(rate_hz - self.rate_hz) <= max(1e-3 * self.rate_hz, 2.0 * _QUANTILE * self.rate_std_hz)


class ClockScan:
    """Look at the stamps of a recording block by block.

    Parameters
    ----------
    resolution_ns : float
        What a number of the file's type can tell apart [ns].
    wraps_ns : tuple of int
        Lengths that the counter's turn may have [ns], the longest last; empty: none.
    """

    def __init__(self, resolution_ns: float = 0.0, wraps_ns: tuple[int, ...] = ()) -> None:
        self._resolution, self._wraps_ns = resolution_ns, wraps_ns
        self._n_time, self._start, self._last, self._usual = 0, 0, 0, 0.0
        self._quantum, self._wraps, self._turned = 0, 0, 0
        self._gaps, self._uneven, self._doubled, self._backward = Tally(), Tally(), Tally(), Tally()
        # Of the steps on the grid: their number, samples, length, and first and second moments of what is over.
        self._n_steps, self._n_samples, self._length = 0, 0, 0
        self._sum, self._square, self._lagged, self._previous = 0.0, 0.0, 0.0, 0.0

    def add(self, stamps: Stamps) -> Stamps:
        """Take the next stamps [ns], and return them with the counter's turns added.

        Parameters
        ----------
        stamps : ndarray, shape (n_time,)
            As in the file.

        Returns
        -------
        ndarray, shape (n_time,)
            Increasing where a counter began anew.
        """
        if not stamps.size:
            return stamps
        stamps = self._unwrapped(stamps)
        for start in range(0, stamps.size, _CHUNK):
            self._add(stamps[start : start + _CHUNK])
        return stamps

    def _add(self, stamps: Stamps) -> None:
        if not self._n_time:
            self._start = self._last = int(stamps[0])
        steps = np.diff(stamps, prepend=np.int64(self._last))
        rows = np.arange(self._n_time, self._n_time + stamps.size)
        if not self._n_time:
            steps, rows = steps[1:], rows[1:]
        if self._usual <= 0.0:
            self._usual = usual_step(steps)
        if steps.size:
            self._tell(rows, steps, stamps[-steps.size :])
        self._n_time += stamps.size
        self._last = int(stamps[-1])

    def result(self) -> TimeBase:
        """Return what was found."""
        step = self._length / self._n_samples if self._n_samples else self._usual
        variance = covariance = 0.0
        if self._n_steps > 2:
            mean = self._sum / self._n_steps
            variance = max(self._square / self._n_steps - mean**2, 0.0)
            covariance = self._lagged / (self._n_steps - 1) - mean**2
        # Steps of a clock that wanders add up; errors of the stamps alone show at both ends only.
        wander = (
            self._n_steps * max(variance + 2.0 * covariance, 0.0) if self._n_steps > 100 else self._n_steps * variance
        )
        ends = 2.0 * max(-covariance, 0.0) * (1 + self._gaps.count + self._uneven.count)
        quantum = max(_rounding(self._quantum), round(self._resolution), 1)
        spread = np.sqrt(wander + ends + (quantum if quantum > 1 else 0) ** 2 / 6.0) / max(self._n_samples, 1)
        rate_std = float(spread / step / (NANO * step)) if step > 0.0 else float("nan")
        return TimeBase(
            n_time=self._n_time,
            start_ns=self._start,
            end_ns=self._last,
            step_ns=step,
            rate_std_hz=rate_std,
            step_std_ns=float(np.sqrt(variance)),
            quantum_ns=quantum,
            gaps=self._gaps,
            uneven=self._uneven,
            doubled=self._doubled,
            backward=self._backward,
            wraps=self._wraps,
        )

    def _unwrapped(self, stamps: Stamps) -> Stamps:
        """Add a turn of the counter wherever it begins anew.

        The longest turn is taken for any step back by more than half of it, a shorter one where it leaves a step of a
        few samples.
        """
        if not self._wraps_ns:
            return stamps
        stamps = stamps + self._turned
        steps = np.diff(stamps, prepend=stamps[:1] if not self._n_time else np.int64(self._last))
        if not (steps < 0).any():
            return stamps
        usual = self._usual or usual_step(steps)
        turns = np.where(steps < -self._wraps_ns[-1] // 2, self._wraps_ns[-1], 0)
        for wrap in reversed(self._wraps_ns):
            turns[(steps < 0) & (steps + wrap > 0) & (steps + wrap <= _ON_GRID * usual)] = wrap
        self._wraps += int(np.count_nonzero(turns))
        self._turned += int(turns.sum())
        whole: Stamps = stamps + np.cumsum(turns)
        return whole

    def _tell(self, rows: NDArray[np.intp], steps: Stamps, stamps: Stamps) -> None:
        """Sort the steps: back, none, one or several samples, or none of these."""
        first = int(steps[0])
        if first > 0 and int(steps.min()) == int(steps.max()) and abs(first - self._usual) < TOLERANCE * self._usual:
            self._weigh_alike(first, steps.size)
            return
        if self._quantum != 1 and steps.any():
            self._quantum = int(np.gcd(self._quantum, np.gcd.reduce(np.abs(steps))))
        usual = self._usual if self._usual > 0.0 else 1.0
        count = np.rint(steps / usual).astype(np.int64)
        over: FloatArray = steps - count * usual
        tolerance = TOLERANCE * usual + max(_rounding(self._quantum), self._resolution)
        far = np.abs(over) > tolerance
        seconds: FloatArray = (stamps - steps - self._start).astype(np.float64) * NANO
        kinds = (
            (self._backward, steps < 0),
            (self._doubled, steps == 0),
            (self._gaps, count >= 2),
            (self._uneven, (steps > 0) & (count <= 1) & (far | (count == 0))),
        )
        for tally, chosen in kinds:
            if chosen.any():
                found = np.flatnonzero(chosen)
                tally.add(
                    rows[found], seconds[found], steps[found].astype(np.float64) * NANO, np.maximum(count[found] - 1, 0)
                )
        self._weigh(steps, count, over, (steps > 0) & ~far & (count >= 1) & (count <= _ON_GRID))

    def _weigh_alike(self, step: int, n_steps: int) -> None:
        """Weigh steps that are all the same, as those of a good logger are."""
        self._quantum = int(np.gcd(self._quantum, step))
        self._n_steps += n_steps
        self._n_samples += n_steps
        self._length += n_steps * step
        over = step - self._usual
        self._sum += n_steps * over
        self._square += n_steps * over**2
        self._lagged += (n_steps - 1) * over**2 + self._previous * over
        self._previous = over

    def _weigh(self, steps: Stamps, count: Stamps, over: FloatArray, good: NDArray[np.bool_]) -> None:
        self._n_steps += int(good.sum())
        self._n_samples += int(count[good].sum())
        self._length += int(steps[good].sum())
        rest = over[good]
        if rest.size:
            self._sum += float(rest.sum())
            self._square += float(rest @ rest)
            self._lagged += float(rest[1:] @ rest[:-1]) + self._previous * float(rest[0])
            self._previous = float(rest[-1])


def _rounding(divisor: int) -> int:
    """Return the power of ten that stamps with this common divisor are written to [ns]."""
    power = 1
    while divisor and divisor % (10 * power) == 0:
        power *= 10
    return power


def usual_step(steps: Stamps) -> float:
    """Return the usual step [ns]: the mean of those within half of the median; 0 where none is positive."""
    forward = steps[steps > 0]
    if not forward.size:
        return 0.0
    median = float(np.median(forward))
    return float(forward[(forward >= 0.5 * median) & (forward <= 1.5 * median)].mean())


def grid_index(stamps: Stamps, clock: TimeBase) -> NDArray[np.int64]:
    """Return the place of each sample on the even grid, shape (n_time,), from 0; lost samples leave places free."""
    counts = np.maximum(np.rint(np.diff(stamps) / clock.step_ns), 1).astype(np.int64)
    index: NDArray[np.int64] = np.concatenate([np.zeros(1, np.int64), np.cumsum(counts)])
    return index


def nanoseconds(values: NDArray[Any], unit_s: float) -> Stamps:
    """Return stamps in nanoseconds.

    Parameters
    ----------
    values : ndarray, shape (n_time,)
        Integers, floats or datetime64[ns] as in the file.
    unit_s : float
        Their unit [s]; not used for dates.

    Returns
    -------
    ndarray, shape (n_time,)
        Exact where the values are integers and the unit a whole number of nanoseconds.

    Raises
    ------
    OverflowError
        If a stamp does not fit: later than the year 2262 in nanoseconds of the epoch.
    """
    if values.dtype.kind == "M":
        return values.astype("datetime64[ns]").view(np.int64)
    whole = Fraction(unit_s / NANO).limit_denominator(1000)
    largest = max(abs(float(values.min())), abs(float(values.max()))) if values.size else 0.0
    if not largest * unit_s / NANO < float(np.iinfo(np.int64).max):
        msg = f"a stamp of {largest:g} with a unit of {unit_s:g} s is out of range"
        raise OverflowError(msg)
    if values.dtype.kind in "iu" and whole.denominator == 1:
        return values.astype(np.int64, copy=False) * np.int64(whole.numerator)
    ticks = whole.numerator if whole.denominator == 1 else unit_s / NANO
    scaled = values.astype(np.promote_types(values.dtype, np.float64)) * ticks
    return np.rint(scaled, out=scaled).astype(np.int64)


def resolution_ns(values: NDArray[Any], unit_s: float) -> float:
    """Return what numbers of this type and size can tell apart [ns], 0 for integers."""
    if values.dtype.kind != "f" or not values.size:
        return 0.0
    return float(np.spacing(np.nanmax(np.abs(values)))) * unit_s / NANO
