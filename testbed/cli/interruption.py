"""What an interrupt leaves behind: words for the end of the command, wherever in a library Ctrl-C meets it."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

_NOTHING = "interrupted; nothing was left behind"
_RUNS = "interrupted; every run that was finished is kept: the same command again goes on from there"
# Of the process, since its signals are: neither the exception, of which libraries make their own, nor the end of a
# process that is loading one can carry words.
_now = [_NOTHING]


def interrupted_words() -> str:
    """Return what to say of an interrupt that comes, or came, now."""
    return _now[-1]


@contextmanager
def keeping_runs() -> Iterator[None]:
    """Say inside that finished runs are kept; and after it too, where an interrupt or an error left it."""
    _now.append(_RUNS)
    yield
    _now.pop()
