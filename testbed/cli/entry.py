"""From the shell to a command and back: every end is a line to read and an exit status, and no traceback.

Nothing is imported here that takes time: whoever stops the command while the libraries load gets that answer too.
"""

from __future__ import annotations

import atexit
import errno
import gc
import os
import signal
import sys
from typing import TYPE_CHECKING, NoReturn

from testbed.cli.interruption import interrupted_words
from testbed.cli.status import BAD_INPUT, FAILED, INTERNAL, INTERRUPTED, OK

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import FrameType

_GONE = 141  # whoever read the output has gone, as in `testbed list | head -1`: 128 + SIGPIPE, as the shell says it
_FULL = {errno.ENOSPC, errno.EDQUOT}
_COMPLETION = "_TESTBED_COMPLETE"
_SHOW_CURSOR = "\x1b[?25h"


def main() -> None:
    """Run the command line; errors become one clear message and the exit status of the contract."""
    stopped = _Stopped()
    # At its end the interpreter would look for garbage in all libraries: a fifth of the time of a short command.
    atexit.register(gc.freeze)
    try:
        from testbed.cli.speech import speak_any_encoding

        speak_any_encoding(sys.stdout, sys.stderr)
        status = _run()
        sys.stdout.flush()
    except KeyboardInterrupt:
        _end(interrupted_words(), INTERRUPTED)
    except (Exception, SystemExit) as error:  # noqa: BLE001 - each has its status
        _end_with(error, stopped)
    stopped.no_more()
    sys.exit(status)


def _run() -> int:
    from testbed.cli.app import app

    try:
        status = app(standalone_mode=False)
    except SystemExit as end:
        # What the shell asks in order to complete a line is answered with an exit of the command-line library.
        if _COMPLETION in os.environ:
            return int(end.code or OK)
        raise
    # The command-line library turns an interrupt into its own exit status.
    if status == INTERRUPTED:
        raise KeyboardInterrupt
    return status if isinstance(status, int) else OK


class _Stopped:
    """Ctrl-C and termination: the end at once while a library loads, which need not survive it, else KeyboardInterrupt.

    What a library makes of that exception is an interrupt too: `asked` remembers it.
    """

    def __init__(self) -> None:
        self.asked = False
        for number in (signal.SIGINT, signal.SIGTERM):
            if signal.getsignal(number) is not signal.SIG_IGN:
                signal.signal(number, self._stop)

    def no_more(self) -> None:
        """Let the interpreter come to its own end undisturbed."""
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, lambda *_: None)

    def _stop(self, _signal: int, frame: FrameType | None) -> NoReturn:
        self.asked = True
        if not _is_loading(frame):
            raise KeyboardInterrupt
        cursor = _SHOW_CURSOR if sys.stderr.isatty() else ""
        os.write(2, f"{cursor}{interrupted_words()}\n".encode())
        os._exit(INTERRUPTED)


def _is_loading(frame: FrameType | None) -> bool:
    while frame is not None:
        if frame.f_code.co_filename.startswith("<frozen importlib"):
            return True
        frame = frame.f_back
    return False


def _end_with(error: BaseException, stopped: _Stopped) -> NoReturn:
    from testbed.errors import RunError, ScenarioError

    if stopped.asked:
        _end(interrupted_words(), INTERRUPTED)
    if isinstance(error, ScenarioError):
        _end(f"error: {error}", BAD_INPUT)
    if isinstance(error, RunError):
        _end(f"error: {error}", FAILED)
    # The table's library makes its own exit of a broken pipe.
    if isinstance(error, BrokenPipeError) or isinstance(error.__context__, BrokenPipeError):
        _leave_without_output(_GONE)
    if isinstance(error, MemoryError):
        _end(f"error: there is not enough memory: {error}; shorten the run, or give it a folder with --out", FAILED)
    show: Callable[[], None] | None = getattr(error, "show", None)
    if show is not None:  # what is wrong with the call
        show()
        sys.exit(BAD_INPUT)
    if isinstance(error, OSError) and error.errno in _FULL:
        _end(f"error: could not be written: {error}", FAILED)
    from testbed.cli.fault import describe

    _end(f"internal error: {describe(error)}", INTERNAL)


def _end(message: str, status: int) -> NoReturn:
    try:
        print(message, file=sys.stderr, flush=True)  # noqa: T201 - this is the terminal
        sys.stdout.flush()
    except OSError:
        _leave_without_output(status)
    sys.exit(status)


def _leave_without_output(status: int) -> NoReturn:
    """End without the attempt to flush what nobody takes."""
    os._exit(status)
