"""The clock of an instrument that is not the run's: when it reads, what it reads then, and what stamps say."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import numpy as np

from testbed.parts import Part
from testbed.signals import random_stream
from testbed.units import Duration, Quantity

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from testbed.signals import FloatArray

ClockError = Annotated[float, Quantity("", "20 ppm", above=-0.1, at_most=0.1)]
Offset = Annotated[float, Quantity("s", "1 ms", at_least=0.0, at_most=3600.0)]
# Ticks that are worked out at a time.
_CHUNK = 4096


class OwnClock(Part):
    r"""A clock of a sensor's own, as the logger sees it.

    .. math:: t_j = \frac{j}{f (1 + e)} + w_j, \quad \mathrm{stamp}_j = t_j + d,

    w a random walk with the given standard deviation after a second.

    Parameters
    ----------
    error : float
        e, by how much it is fast [-].
    walk : float
        Standard deviation of w after one second, growing as the root of time [s].
    offset : float
        d, by how much every stamp is late [s].
    """

    error: ClockError = 0.0
    walk: Duration = 0.0
    offset: Offset = 0.0


class Ticks:
    """When an instrument reads, in true time, in order; the same whatever they are asked for in.

    Parameters
    ----------
    clock : OwnClock
        Its clock.
    sample_rate_hz : float
        Rate of the readings by that clock [Hz].
    stream : numpy.random.Generator
        Of the random walk.
    """

    def __init__(self, clock: OwnClock, sample_rate_hz: float, stream: np.random.Generator) -> None:
        self._rate, self._step = sample_rate_hz * (1.0 + clock.error), clock.walk / sample_rate_hz**0.5
        self._stream, self._walked, self._made = stream, 0.0, 0
        self._waiting: FloatArray = np.empty(0)

    def until(self, end: float) -> FloatArray:
        """Return the instants before `end` that were not asked for yet [s].

        Parameters
        ----------
        end : float
            In true time [s].
        """
        while not self._waiting.size or self._waiting[-1] < end:
            self._waiting = np.concatenate([self._waiting, self._more()])
        n = int(np.searchsorted(self._waiting, end))
        found, self._waiting = self._waiting[:n], self._waiting[n:]
        return found

    def _more(self) -> FloatArray:
        number = np.arange(self._made, self._made + _CHUNK)
        steps = self._step * self._stream.standard_normal(_CHUNK) if self._step else np.zeros(_CHUNK)
        steps[: 1 if self._made == 0 else 0] = 0.0
        walk = self._walked + np.cumsum(steps)
        self._made, self._walked = self._made + _CHUNK, float(walk[-1])
        return number / self._rate + walk


class TickSampler:
    """Takes an input at the ticks of a clock, by a parabola through three samples around each.

    Its error is at most 0.064 h^3 times the third derivative, h the step of the input: 2e-5 of a sine of 200 Hz at
    20 kHz. Any division into blocks gives the same bits.

    Parameters
    ----------
    ticks : Ticks
        When.
    input_rate_hz : float
        Rate of the input, whose first sample is at t = 0 [Hz].
    """

    def __init__(self, ticks: Ticks, input_rate_hz: float) -> None:
        self._ticks, self._rate, self._done = ticks, input_rate_hz, 0
        self._past: FloatArray = np.empty(0)
        self.times: FloatArray = np.empty(0)

    def process(self, samples: FloatArray) -> FloatArray:
        """Return the input at the ticks that this block reaches, unit of `samples`; `times` holds these ticks [s].

        A tick belongs to the first block that has a sample after it.
        """
        if not samples.size:
            self.times = np.empty(0)
            return np.empty(0)
        if not self._past.size:
            # Before the record as at its first sample.
            self._past = np.full(3, samples[0])
        line, first = np.concatenate([self._past, samples]), self._done - 3
        self._done += samples.size
        self.times = self._ticks.until((self._done - 1) / self._rate)
        place = self.times * self._rate
        # Behind the middle one, and at most at the last: the same for any blocks.
        k = np.ceil(place).astype(np.int64) - 1
        u, at = place - k, k - first
        a, b, c = line[at - 1], line[at], line[at + 1]
        self._past = line[-3:]
        taken: FloatArray = b + 0.5 * u * (c - a) + 0.5 * u * u * (a - 2.0 * b + c)
        return taken


def ticks_of(clock: OwnClock | None, sample_rate_hz: float, seed: int, name: str) -> Ticks:
    """Return when an instrument reads.

    Parameters
    ----------
    clock : OwnClock, optional
        Its clock; the run's if not given.
    sample_rate_hz : float
        Rate of the readings [Hz].
    seed : int
        Of the run.
    name : str
        Of the instance, the owner of its random streams.
    """
    return Ticks(clock or OwnClock(), sample_rate_hz, random_stream(seed, name, "clock"))


def stamps_ns(clock: OwnClock | None, times: FloatArray) -> NDArray[np.int64]:
    """Return what the logger writes for readings taken at `times` [s], shape (n_time,), as whole nanoseconds."""
    late = 0.0 if clock is None else clock.offset
    return np.rint(1e9 * (times + late)).astype(np.int64)
