"""Channels of a recording as even series of one beginning."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from testbed.identification.spectrum import Series
from testbed.logs.channel import unwound
from testbed.logs.clock import NANO
from testbed.logs.inspection import remarks
from testbed.logs.options import refusal

if TYPE_CHECKING:
    from testbed.logs.channel import LogChannel
    from testbed.signals import FloatArray

# Of the samples: more lost ones would be bridges of what was not measured.
_MOST_LOST = 0.01


@dataclass(frozen=True)
class Prepared:
    """A channel as a series.

    Parameters
    ----------
    series : Series
        Its samples less their mean, or less a steady rotation.
    mean, rms : float
        Mean rate, and root mean square of the rest [rad/s].
    notes : tuple of str
        What was taken for granted, and what was done.
    """

    series: Series
    mean: float
    rms: float
    notes: tuple[str, ...]


def series_of(channel: LogChannel, reference: LogChannel) -> Prepared:
    """Return a channel as an even series in the time of the reference's first sample.

    Parameters
    ----------
    channel, reference : LogChannel
        Of one recording.

    Raises
    ------
    ScenarioError
        If it is no rotation, its samples are not even, or more than 1 % of them are lost.
    """
    notes = [f"{channel.name}: {note}" for note in (*channel.assumed, *remarks(channel))]
    kind = channel.kind
    if kind is None and channel.quantity == "angle":
        kind = "angle"
        notes.append(f"{channel.name}: in {channel.unit}, taken for an angle; increments need a map with their kind")
    if kind is None:
        channel.rate()  # which refuses it with the reason
    values, lost = _whole(channel)
    if lost:
        notes.append(f"{channel.name}: {lost} of {values.size} samples are missing, bridged by straight lines")
    start = 0.0
    if channel.stamps_ns is not None and reference.stamps_ns is not None:
        start = NANO * float(channel.stamps_ns[0] - reference.stamps_ns[0])
    elif channel is not reference:
        notes.append(f"{channel.name}: without stamps, its first sample is taken to be at the reference's first")
    if kind == "rate":
        mean = float(values.mean())
        return Prepared(Series(values - mean, start, channel.rate_hz), mean, float(values.std()), tuple(notes))
    angle = np.cumsum(values) if kind == "increment" else unwound(values)
    turn = np.linspace(angle[0], angle[-1], angle.size)
    mean = float((angle[-1] - angle[0]) / (angle.size - 1) * channel.rate_hz)
    rms = float(np.diff(angle - turn).std() * channel.rate_hz)
    return Prepared(Series(angle - turn, start, channel.rate_hz, is_angle=True), mean, rms, tuple(notes))


def _whole(channel: LogChannel) -> tuple[FloatArray, int]:
    """Return the values of a channel with lost ones bridged, and how many those are."""
    values = channel.even()
    known = np.isfinite(values)
    lost = int(values.size - np.count_nonzero(known))
    if lost > _MOST_LOST * values.size:
        message = f"{lost} of {values.size} samples of {channel.label} are missing, more than 1 %: cut the record"
        raise refusal(channel.table.path, message)
    if not lost:
        return values, 0
    places = np.arange(values.size)
    return np.interp(places, places[known], values[known]), lost


def of_one_clock(first: LogChannel, second: LogChannel) -> bool:
    """Return whether two channels stand in the same rows of a file, so that their samples are simultaneous."""
    if first.table is not second.table or first.values.size != second.values.size:
        return False
    if first.stamps_ns is None or second.stamps_ns is None:
        return first.stamps_ns is second.stamps_ns and first.rate_hz == second.rate_hz
    return bool(np.array_equal(first.stamps_ns, second.stamps_ns))
