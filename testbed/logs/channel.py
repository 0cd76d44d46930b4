"""A channel of a recording, in SI, with its time base."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NoReturn

import numpy as np

from testbed.logs.clock import NANO, Event, Tally, TimeBase, grid_index
from testbed.logs.options import refusal

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from testbed.logs.table import Table
    from testbed.signals import FloatArray

# Places of the even grid that a recording may leave free, for each of its samples and at all.
_MOST_FREE, _FREE_AT_ALL = 4, 1_000_000
_TURN = 2.0 * np.pi
FEWEST = 4


@dataclass(frozen=True)
class LogChannel:
    """A channel of a recording, in SI.

    Parameters
    ----------
    name, label : str
        Of the channel, and of its column for the reader.
    values : ndarray, shape (n_time,)
        SI values, NaN where one is missing.
    unit, quantity : str
        As written in the file or map, and what it measures.
    kind : str, optional
        ``rate``, ``increment`` or ``angle``.
    stamps_ns : ndarray, shape (n_time,), optional
        Stamps [ns]; None if the sample rate is all that is known.
    clock : TimeBase, optional
        What they say.
    rate_hz : float
        Sample rate [Hz]: what was said, or what the stamps say.
    assumed : tuple of str
        What was taken for granted.
    notes : tuple of str
        What contradicts what was said, and what was left out.
    table : Table
        The file.
    largest : float, optional
        Range of the sensor [SI].
    factor : float
        SI value of a one in the file.
    start_ns : int
        When the first sample was taken, where there are no stamps [ns].
    """

    name: str
    label: str
    values: FloatArray
    unit: str
    quantity: str
    kind: str | None
    stamps_ns: NDArray[np.int64] | None
    clock: TimeBase | None
    rate_hz: float
    assumed: tuple[str, ...]
    notes: tuple[str, ...]
    table: Table
    largest: float | None = None
    factor: float = 1.0
    start_ns: int = 0

    def even(self) -> FloatArray:
        """Return the values on an even grid of `rate_hz`, NaN where samples are lost.

        Raises
        ------
        ScenarioError
            If there are fewer than 4 samples, no time at all, or the stamps are not even: with the first place and the
            option that takes them as even.
        """
        if self.values.size < FEWEST:
            raise refusal(self.table.path, f"expected at least {FEWEST} samples, got {self.values.size}")
        if self.stamps_ns is None or self.clock is None:
            if not np.isfinite(self.rate_hz):
                message = "expected either the sample rate (--rate) or the column of the time (--time)"
                raise refusal(self.table.path, message)
            return self.values
        refuse_uneven(self.table, self.clock)
        index = grid_index(self.stamps_ns, self.clock)
        n_grid = int(index[-1]) + 1
        if n_grid == self.values.size:
            return self.values
        if n_grid > _MOST_FREE * self.values.size + _FREE_AT_ALL:
            longest = max(self.clock.gaps.first, key=lambda gap: gap.length)
            message = (
                f"a gap of {longest.length:g} s leaves {n_grid} samples for {self.values.size}: cut the record in parts"
            )
            raise refusal(self.table.path, message, line=self.table.line(longest.row))
        values = np.full(n_grid, np.nan)
        values[index] = self.values
        return values

    def whole(self) -> FloatArray:
        """Return the values of even samples of which none is lost.

        Raises
        ------
        ScenarioError
            As `even`, or if a sample is lost: with the first place.
        """
        values = self.even()
        if self.clock is not None and self.stamps_ns is not None and self.clock.gaps.count:
            gap = self.clock.gaps.first[0]
            place = f"time goes from {gap.seconds:.9g} s to {gap.seconds + gap.length:.9g} s after the start"
            message = f"uneven or missing sample: {place} where the usual step is {NANO * self.clock.step_ns:g} s"
            raise refusal(self.table.path, f"{message}; fill the gap or cut the record", line=self.table.line(gap.row))
        lost = ~np.isfinite(values)
        if lost.any():
            row = int(np.argmax(lost))
            message = f"expected a finite number in {self.label}, got none; fill it or cut the record"
            raise refusal(self.table.path, message, line=self.table.line(row))
        return values

    def rate(self) -> LogChannel:
        """Return the channel as an angular rate: increments over the sample period, differences of angles.

        Raises
        ------
        ScenarioError
            If it is neither, or the kind of an angle is not said.
        """
        if self.kind is None:
            _refuse_kind(self)
        if self.kind == "rate":
            return self
        values = self.even()
        if self.kind == "angle":
            values = np.diff(unwound(values))
        values = values * self.rate_hz
        return replace(self, values=values, kind="rate", quantity="rate", stamps_ns=None)


@dataclass(frozen=True)
class Log:
    """A recording.

    Parameters
    ----------
    path : Path
        Its file, or the map's.
    channels : dict
        Channels by name.
    """

    path: Path
    channels: dict[str, LogChannel]


def refuse_uneven(table: Table, clock: TimeBase) -> None:
    """Refuse stamps that are not even, with the first place and the remedy.

    Raises
    ------
    ScenarioError
        If a stamp goes back or stands twice, or a step is no multiple of the usual one.
    """
    rate = f"--rate '{clock.mean_rate_hz:.6g} Hz'" if np.isfinite(clock.mean_rate_hz) else "--rate (the true one)"
    if clock.end_ns == clock.start_ns:
        raise refusal(table.path, f"the stamps stand still: {rate} without --time takes the samples as even", "--time")
    if clock.coarse:
        message = (
            f"the stamps are rounded to {NANO * clock.quantum_ns:g} s, which is coarser than the samples "
            f"({clock.doubled.count} stand twice or more): {rate} without --time takes them as even"
        )
        raise refusal(table.path, message, "--time")
    for tally, what in (
        (clock.backward, "stamps go back"),
        (clock.doubled, "stamps stand twice"),
        (clock.uneven, "steps are uneven"),
    ):
        if tally.count:
            _refuse_event(table, clock, tally, what, rate)


def _refuse_event(table: Table, clock: TimeBase, tally: Tally, what: str, rate: str) -> NoReturn:
    event: Event = tally.first[0]
    step = NANO * clock.step_ns
    place = f"{event.seconds:.9g} s from the start, where time goes on by {event.length:g} s, usually by {step:g} s"
    remedy = f"mend or remove the line, or take the samples as even with {rate} instead of --time"
    raise refusal(table.path, f"{tally.count} {what}; first {place}; {remedy}", "--time", table.line(event.row))


def _refuse_kind(channel: LogChannel) -> NoReturn:
    path = channel.table.path
    if channel.quantity == "angle":
        message = f"{channel.unit} of {channel.label} is a unit of angle: expected increment or angle"
        raise refusal(path, message, "--kind")
    if not channel.quantity:
        raise refusal(path, f"expected the unit of {channel.label}, such as deg/s, or --scale of a count", "--unit")
    message = f"expected a rate or an angle in {channel.label}, got {channel.quantity} in {channel.unit}"
    raise refusal(path, message, "--unit")


def unwound(angle: FloatArray) -> FloatArray:
    """Return an angle [rad], shape (n_time,), without the jumps of a whole turn that an encoder makes."""
    steps = np.diff(angle)
    if np.nanmax(np.abs(steps), initial=0.0) < 0.5 * _TURN:
        return angle
    known = np.isfinite(angle)
    whole = angle.copy()
    whole[known] = np.unwrap(angle[known])
    return whole
