"""What the parts of a recording share: the stream to the file, the timeline, and one plotted signal."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import rerun as rr

from testbed.pages.palette import rgb
from testbed.recording.detail import Detail

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from numpy.typing import NDArray

    from testbed.signals import FloatArray

TIMELINE = "sim_time"
INK = "#8a8f98"
ROWS = 16384  # rows of scalars sent at once; the viewer cuts chunks to 4096 rows anyway
FRAMES = 512  # rows of poses and profiles, which are larger


class Clock:
    """The base clock of a run in integer nanoseconds: k / fs is never accumulated and never a rounded float.

    Parameters
    ----------
    sample_rate_hz : float
        Base rate fs [Hz].
    n_time : int
        Number of base samples of the run.
    detail : tuple of float
        Start and end of the window recorded sample by sample [s].
    """

    def __init__(self, sample_rate_hz: float, n_time: int, detail: tuple[float, float]) -> None:
        self.sample_rate_hz, self.n_time, self.detail = sample_rate_hz, n_time, detail

    def nanoseconds(self, index: NDArray[np.int64]) -> NDArray[np.timedelta64]:
        """Return t = k / fs of the base samples k as timedelta64[ns], rounded to the nearest nanosecond."""
        rate = round(self.sample_rate_hz)
        if rate == self.sample_rate_hz:
            stamps = (index * 1_000_000_000 + rate // 2) // rate
        else:
            stamps = np.rint(index * (1e9 / self.sample_rate_hz)).astype(np.int64)
        return stamps.astype("timedelta64[ns]")

    def chooser(self, stride: int, *, detailed: bool, gaps: bool) -> Detail:
        """Return the chooser for a signal with a sample at every `stride`-th base sample; without detail, extremes
        only.
        """
        start, end = (round(t * self.sample_rate_hz) for t in self.detail)
        window = (-(-start // stride), end // stride + 1) if detailed else (0, 0)
        return Detail(-(-self.n_time // stride), window, gaps=gaps)

    def chooser_of(self, times_ns: NDArray[np.int64], *, detailed: bool, gaps: bool) -> Detail:
        """Return the chooser for a signal with its own stamps [ns], shape (n_sample,)."""
        first, last = (int(np.searchsorted(times_ns, round(1e9 * t))) for t in self.detail)
        return Detail(times_ns.size, (first, last + 1) if detailed else (0, 0), gaps=gaps)


class Recording:
    """A Rerun stream with the run's clock; every call is strict, so nothing is dropped with a warning.

    Parameters
    ----------
    stream : RecordingStream
        Where everything goes.
    clock : Clock
        Of the run.
    live : bool, optional
        Whether somebody looks on: what there is to see is drawn as soon as it is known, in the scale that fits so far.
    """

    def __init__(self, stream: rr.RecordingStream, clock: Clock, *, live: bool = False) -> None:
        self.stream, self.clock, self.live = stream, clock, live

    def batch(self, send: Callable[..., None], size: int) -> Batch:
        """Return what holds rows back until there are `size` of them; if somebody looks on, nothing is held back."""
        return Batch(send, 1 if self.live else size)

    def static(self, entity: str, *archetypes: rr.AsComponents) -> None:
        """Log what does not change in time."""
        self.stream.log(entity, *archetypes, static=True, strict=True)

    def columns(self, entity: str, index: NDArray[np.int64], columns: Iterable[rr.ComponentColumn]) -> None:
        """Log one row for each base sample of `index`."""
        self.rows(entity, self.clock.nanoseconds(index), columns)

    def rows(self, entity: str, stamps: NDArray[np.timedelta64], columns: Iterable[rr.ComponentColumn]) -> None:
        """Log one row for each of the stamps."""
        self.stream.send_columns(entity, [rr.TimeColumn(TIMELINE, duration=stamps)], columns, strict=True)

    def lines(self, entity: str, names: Sequence[str], colors: Sequence[str], width: float = 1.5) -> None:
        """Name and colour the series of an entity; the default policy would draw fast oscillations as their mean."""
        widths = [width] * len(names)
        rgbs = [rgb(color) for color in colors]
        style = rr.SeriesLines(names=names, colors=rgbs, widths=widths, aggregation_policy="MinMax")
        self.static(entity, style)

    def texts(self, entity: str, texts: Sequence[tuple[float, float, str]]) -> None:
        """Write words into a flat view, each at its place (x, y)."""
        places = [(x, y) for x, y, _ in texts]
        words = [text for _, _, text in texts]
        self.static(entity, rr.Points2D(places, labels=words, colors=rgb(INK), radii=0.01, show_labels=True))


class Batch:
    """Rows held back until there are enough of them: Rerun keeps an entry in memory for every chunk, so many small ones
    add up.

    Parameters
    ----------
    send : callable
        Takes the base samples and the values of all rows.
    size : int
        Rows sent at once [-].
    """

    def __init__(self, send: Callable[..., None], size: int) -> None:
        self._send, self._size = send, size
        self._waiting: list[tuple[NDArray[np.generic], ...]] = []
        self._n_waiting = 0

    def add(self, index: NDArray[np.int64], *values: FloatArray) -> None:
        """Add rows at the base samples `index`, shape (n_row,); each of `values` has shape (n_row, ...)."""
        if index.size:
            self._waiting.append((index, *values))
            self._n_waiting += index.size
        if self._n_waiting >= self._size:
            self.flush()

    def flush(self) -> None:
        """Send what is held back."""
        if self._n_waiting:
            self._send(*(np.concatenate(part) for part in zip(*self._waiting, strict=True)))
        self._waiting, self._n_waiting = [], 0


class Signal:
    """One scalar signal of the recording: its samples pass a `Detail` and are sent in large chunks.

    Parameters
    ----------
    recording : Recording
        Where it goes.
    entity : str
        Path of the entity.
    stride : int
        Base samples per sample of this signal.
    name, color : str
        Of the line; the name carries the unit.
    width : float
        Of the line, in points of the screen.
    detailed : bool
        Whether it has every sample inside the window of the clock.
    gaps : bool
        Whether what is not finite is lost and leaves a gap; otherwise it was not due.
    times_ns : ndarray, shape (n_sample,), optional
        Stamps of its samples [ns], of a signal that is not on the clock of the run.
    settle : float, optional
        Start of the part whose extremes are `settled` [s].

    Attributes
    ----------
    settled : tuple of float or None
        Least and largest finite value from then on, as far as it is sent.
    """

    def __init__(
        self,
        recording: Recording,
        entity: str,
        stride: int,
        *,
        name: str,
        color: str,
        width: float = 1.5,
        detailed: bool = True,
        gaps: bool = True,
        times_ns: NDArray[np.int64] | None = None,
        settle: float = 0.0,
    ) -> None:
        self.entity = entity
        self.settled: tuple[float, float] | None = None
        self._settle = np.timedelta64(round(1e9 * settle), "ns")
        self._recording, self._stride, self._times = recording, stride, times_ns
        clock = recording.clock
        self._chooser = (
            clock.chooser(stride, detailed=detailed, gaps=gaps)
            if times_ns is None
            else clock.chooser_of(times_ns, detailed=detailed, gaps=gaps)
        )
        self._batch = recording.batch(self._send, ROWS)
        recording.lines(entity, [name], [color], width)

    def write(self, values: FloatArray) -> None:
        """Add the next samples [unit of the entity]."""
        self._batch.add(*self._chooser.process(values))

    def finish(self) -> None:
        """Send what is still held back."""
        self._batch.add(*self._chooser.finish())
        self._batch.flush()

    def _send(self, index: NDArray[np.int64], values: FloatArray) -> None:
        clock = self._recording.clock
        own = clock.nanoseconds(index * self._stride) if self._times is None else self._times[index]
        stamps = own.astype("timedelta64[ns]")
        self._recording.rows(self.entity, stamps, rr.Scalars.columns(scalars=values))
        late = values[(stamps >= self._settle) & np.isfinite(values)]
        if late.size:
            low, high = float(late.min()), float(late.max())
            self.settled = (
                (low, high) if self.settled is None else (min(low, self.settled[0]), max(high, self.settled[1]))
            )
