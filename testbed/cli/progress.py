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

_PLAIN_EVERY = 5.0


@contextmanager
def progress(name: str, duration: float) -> Iterator[Callable[[float], None]]:
    """Show progress on standard error: a bar with rate and remaining time, or plain lines without a terminal."""
    if sys.stderr.isatty():
        with _bar() as bar:
            task = bar.add_task(name, total=duration, speed="")
            yield _advance(bar, task)
    else:
        yield _plain(name, duration)


def _bar() -> Progress:
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TaskProgressColumn(),
        TextColumn("{task.fields[speed]}"),
        TimeRemainingColumn(),
    )
    return Progress(*columns, console=Console(stderr=True))


def _advance(bar: Progress, task: TaskID) -> Callable[[float], None]:
    begin = time.monotonic()

    def tick(done: float) -> None:
        bar.update(task, completed=done, speed=f"{done / max(time.monotonic() - begin, 1e-9):.1f} x real time")

    return tick


def _plain(name: str, duration: float) -> Callable[[float], None]:
    begin = last = time.monotonic()

    def tick(done: float) -> None:
        nonlocal last
        now = time.monotonic()
        if now - last >= _PLAIN_EVERY or done >= duration:
            speed = done / max(now - begin, 1e-9)
            line = (
                f"{name}: {done:.0f} of {duration:g} s, {speed:.1f} x real time, "
                f"{(duration - done) / speed:.0f} s remaining"
            )
            print(line, file=sys.stderr, flush=True)  # noqa: T201 - this is the terminal
            last = now

    return tick
