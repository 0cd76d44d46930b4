"""Progress on standard error."""

from __future__ import annotations

import sys
import time
from contextlib import contextmanager
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TaskProgressColumn, TextColumn, TimeRemainingColumn

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from testbed.campaigns.sweep import Progress as Sweeping

_PLAIN_EVERY = 5.0


@contextmanager
def progress(name: str, duration: float) -> Iterator[Callable[[float], None]]:
    """Show progress on standard error: a bar with rate and remaining time, or plain lines without a terminal."""
    if sys.stderr.isatty():
        with _bar() as bar:
            task = bar.add_task(name, total=duration, speed="compiling")
            yield _advance(bar, task)
    else:
        yield _plain(name, duration)


@contextmanager
def sweeping(name: str) -> Iterator[Callable[[Sweeping], None]]:
    """Show how far a sweep is on standard error: a bar, or plain lines without a terminal."""
    if sys.stderr.isatty():
        columns = ("{task.description}", BarColumn(), "{task.completed} of {task.total}", TimeRemainingColumn())
        with Progress(*columns, TextColumn("{task.fields[words]}"), console=Console(stderr=True)) as bar:
            task = bar.add_task(name, total=None, words="")
            yield lambda told: bar.update(task, total=told.runs, completed=told.done, words=_found(told))
    else:
        yield _plain_sweep(name)


def _plain_sweep(name: str) -> Callable[[Sweeping], None]:
    begun, last = None, -_PLAIN_EVERY

    def tick(told: Sweeping) -> None:
        nonlocal begun, last
        now = time.monotonic()
        if begun is None:
            begun = now, told.done
        if told.done < told.runs and now - last < _PLAIN_EVERY:
            return
        words = [f"{name}: {told.done} of {told.runs} runs"]
        if told.done > begun[1]:
            rate = (told.done - begun[1]) / max(now - begun[0], 1e-9)
            words += [f"{rate:.3g} a second", f"{(told.runs - told.done) / rate:.0f} s remaining"]
        print(", ".join([*words, _found(told)]), file=sys.stderr, flush=True)  # noqa: T201 - this is the terminal
        last = now

    return tick


def _found(told: Sweeping) -> str:
    words = [f"{told.failed} failed"] if told.failed else []
    if told.best is not None and told.worst is not None:
        words += [f"best {told.best[0]:.3g} deg/s ({told.best[1]})", f"worst {told.worst[0]:.3g} ({told.worst[1]})"]
    return ", ".join(words)


class Pace:
    """How fast a run is after its first block: that one loads libraries and compiles, which says nothing of the rest.

    Parameters
    ----------
    clock : callable
        Seconds of any origin.
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._first: tuple[float, float] | None = None

    def note(self, done: float) -> float | None:
        """Return simulated seconds per second, None at the first call.

        Parameters
        ----------
        done : float
            Simulated time [s].
        """
        now = self._clock()
        if self._first is None:
            self._first = now, done
            return None
        began, before = self._first
        return (done - before) / max(now - began, 1e-9)


def _bar() -> Progress:
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TaskProgressColumn(),
        TextColumn("{task.fields[speed]}"),
        # It, too, counts from the first block on.
        TimeRemainingColumn(),
    )
    return Progress(*columns, console=Console(stderr=True))


def _advance(bar: Progress, task: TaskID) -> Callable[[float], None]:
    pace = Pace(time.monotonic)

    def tick(done: float) -> None:
        speed = pace.note(done)
        bar.update(task, completed=done, speed="" if speed is None else f"{speed:.1f} x real time")

    return tick


def _plain(name: str, duration: float) -> Callable[[float], None]:
    pace, last = Pace(time.monotonic), -_PLAIN_EVERY

    def tick(done: float) -> None:
        nonlocal last
        speed, now = pace.note(done), time.monotonic()
        if done < duration and (speed is None or now - last < _PLAIN_EVERY):
            return
        words = [f"{name}: {done:.0f} of {duration:g} s"]
        words += [] if speed is None else [f"{speed:.1f} x real time"]
        words.append("writing recording and report" if done >= duration else _remaining(duration - done, speed))
        print(", ".join(words), file=sys.stderr, flush=True)  # noqa: T201 - this is the terminal
        last = now

    return tick


def _remaining(simulated: float, speed: float | None) -> str:
    return "" if not speed else f"{simulated / speed:.0f} s of simulation remaining"
