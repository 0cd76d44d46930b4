"""A channel of a recording as a rate on its own clock: sorted, without what stands twice, gaps filled with NaN."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from testbed.logs.clock import NANO, ClockScan, grid_index
from testbed.logs.options import refusal
from testbed.playback.grid import exact_rate, filled

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from testbed.logs.channel import LogChannel
    from testbed.logs.clock import TimeBase
    from testbed.signals import FloatArray

FEWEST = 4
# Places of the grid that a recording may leave free for each of its samples, and at all.
_MOST_FREE, _FREE_AT_ALL = 4, 1_000_000


@dataclass(frozen=True)
class Reel:
    """The rate of a channel on its own clock.

    Parameters
    ----------
    name : str
        Of the channel.
    rate : ndarray, shape (n_time,)
        Rates [rad/s], NaN where one is lost.
    start_ns : int
        Stamp of the first [ns].
    sample_rate_hz : float
        Exact where `stamps_ns` is None, else the mean [Hz].
    quantum_ns : float
        What the stamps were rounded to [ns].
    stamps_ns : ndarray, shape (n_time,), optional
        Of a clock that is no multiple of one step; None: sample k is at ``start_ns + k / sample_rate_hz``.
    doubled : int
        Samples that were left out since another has their stamp.
    notes : tuple of str
        What the reader has to say.
    stated : bool
        Whether the rate was said, and not found in the stamps.
    """

    name: str
    rate: FloatArray
    start_ns: int
    sample_rate_hz: float
    quantum_ns: float = 1.0
    stamps_ns: NDArray[np.int64] | None = None
    doubled: int = 0
    notes: tuple[str, ...] = ()
    stated: bool = False

    @property
    def missing(self) -> int:
        """Number of lost readings."""
        return int(np.count_nonzero(np.isnan(self.rate)))

    def times_ns(self) -> FloatArray:
        """Return when each sample was taken, after `start_ns`, shape (n_time,) [ns]."""
        if self.stamps_ns is None:
            return np.arange(self.rate.size) / (NANO * self.sample_rate_hz)
        return (self.stamps_ns - self.start_ns).astype(np.float64)

    def stamps(self) -> NDArray[np.int64]:
        """Return the stamp of each sample, shape (n_time,) [ns]."""
        if self.stamps_ns is not None:
            return self.stamps_ns
        return self.start_ns + np.rint(self.times_ns()).astype(np.int64)

    def put_right(self, rate: FloatArray, stamps_ns: NDArray[np.int64]) -> Reel:
        """Return the reel with other readings [rad/s] and stamps [ns], of which an even clock stays one."""
        moved = replace(self, rate=rate)
        if np.array_equal(stamps_ns, self.stamps()):
            return moved
        exact = exact_rate(stamps_ns, np.arange(stamps_ns.size), 1.0) if self.stamps_ns is None else None
        mean = (stamps_ns.size - 1) / (NANO * float(stamps_ns[-1] - stamps_ns[0]))
        return replace(
            moved,
            start_ns=int(stamps_ns[0]),
            sample_rate_hz=exact or mean,
            stamps_ns=None if exact is not None else stamps_ns,
            stated=False,
        )

    def from_place(self, first: int) -> Reel:
        """Return the reel without its first samples."""
        if not first:
            return self
        if self.stamps_ns is not None:
            stamps = self.stamps_ns[first:]
            return replace(self, rate=self.rate[first:], start_ns=int(stamps[0]), stamps_ns=stamps)
        start = self.start_ns + round(first / (NANO * self.sample_rate_hz))
        return replace(self, rate=self.rate[first:], start_ns=start)


def wind(channel: LogChannel, *, middle: bool = False) -> Reel:
    """Return a channel as a rate on its own clock.

    Parameters
    ----------
    channel : LogChannel
        Rate, increments or angle, with stamps or a sample rate.
    middle : bool, optional
        Place the mean rate that an increment or a difference of angles is in the middle of its interval, as a reference
        needs it; a reading is at the end.

    Raises
    ------
    ScenarioError
        If it is no rate, has no time, or its stamps stand still or are coarser than its samples.
    """
    if channel.kind is None:
        channel.rate()  # says why not
    if channel.values.size < FEWEST:
        raise refusal(channel.table.path, f"expected at least {FEWEST} samples of {channel.label}")
    if channel.stamps_ns is None or channel.clock is None:
        # Refuses a channel without any time.
        values, rate = channel.even(), channel.rate_hz
        reel = Reel(channel.name, values, channel.start_ns, rate, notes=channel.notes, stated=True)
    else:
        reel = _stamped(channel, channel.stamps_ns, channel.clock)
    return _as_rate(reel, channel.kind, middle=middle)


def _stamped(channel: LogChannel, stamps: NDArray[np.int64], clock: TimeBase) -> Reel:
    if clock.end_ns == clock.start_ns or clock.coarse:
        channel.even()  # says why not, with the remedy
    stamps, values, doubled = _sorted(stamps, channel.values)
    scan = ClockScan(float(clock.quantum_ns))
    scan.add(stamps)
    clock = scan.result()
    index = grid_index(stamps, clock)
    n_grid = int(index[-1]) + 1
    if n_grid > _MOST_FREE * stamps.size + _FREE_AT_ALL:
        message = f"gaps leave {n_grid} samples of {channel.label} for {stamps.size}: cut the record in parts"
        raise refusal(channel.table.path, message)
    rate = np.full(n_grid, np.nan)
    rate[index] = values
    exact, rounded = _even_rate(stamps, index, float(clock.quantum_ns))
    return Reel(
        channel.name,
        rate,
        int(stamps[0]),
        exact or clock.rate_hz,
        rounded,
        None if exact is not None else filled(stamps, index),
        doubled,
        channel.notes,
    )


def _even_rate(stamps: NDArray[np.int64], index: NDArray[np.int64], quantum_ns: float) -> tuple[float | None, float]:
    """Return the rate that explains stamps, None if there is none, and what they are rounded to [ns].

    Steps of an exact clock, too, are multiples of a power of ten: what they seem rounded to counts only if it has to.
    Nanoseconds of the epoch that went through a double are multiples of 256.
    """
    divisor = int(np.gcd.reduce(np.diff(stamps)))
    for rounded in (0.0, quantum_ns, float(divisor & -divisor)):
        exact = exact_rate(stamps, index, rounded)
        if exact is not None:
            return exact, max(rounded, 1.0)
    return None, quantum_ns


def _sorted(stamps: NDArray[np.int64], values: FloatArray) -> tuple[NDArray[np.int64], FloatArray, int]:
    """Return stamps and values in the order of time, the first of those with one stamp, and how many were left out."""
    steps = np.diff(stamps)
    if (steps > 0).all():
        return stamps, values, 0
    order = np.argsort(stamps, kind="stable")
    stamps, values = stamps[order], values[order]
    kept = np.concatenate([[True], np.diff(stamps) > 0])
    return stamps[kept], values[kept], int(np.count_nonzero(~kept))


def _as_rate(reel: Reel, kind: str | None, *, middle: bool) -> Reel:
    """Return increments and angles as the mean rates of their intervals."""
    if kind == "rate":
        return reel
    times = reel.times_ns()
    step = float(1.0 / (NANO * reel.sample_rate_hz))
    if kind == "angle":
        unwound = _unwound(reel.rate)
        turned, length, at = np.diff(unwound), np.diff(times), times[1:]
    else:
        turned, length, at = reel.rate, np.diff(times, prepend=-step), times
    rate = turned / (NANO * length) if reel.stamps_ns is not None else turned * reel.sample_rate_hz
    if middle:
        at = at - 0.5 * length
    start = reel.start_ns + round(float(at[0]))
    stamps = None if reel.stamps_ns is None else reel.start_ns + np.rint(at).astype(np.int64)
    return replace(reel, rate=rate, start_ns=start, stamps_ns=stamps)


def _unwound(angle: FloatArray) -> FloatArray:
    """Return an angle without the jumps of a whole turn that an encoder makes."""
    whole = angle.copy()
    known = np.isfinite(angle)
    if np.nanmax(np.abs(np.diff(angle[known])), initial=0.0) >= np.pi:
        whole[known] = np.unwrap(angle[known])
    return whole
