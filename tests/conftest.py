"""What every test runs under."""

from __future__ import annotations

import atexit
import gc
import os
import signal

# Before numpy loads: the tests run side by side, one thread each.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import pytest

from testbed.cli.loading import loading

# What is left at the end is left to the system: nothing in it is searched for once more.
atexit.register(gc.freeze)

# Started in the background by a shell, this process ignores Ctrl-C, and so would every command that a test interrupts.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.hookimpl(wrapper=True)
def pytest_collection():
    """Thousands of tests and their libraries stay to the end, and so does much of what compiling kernels leaves: a full
    search for garbage takes half a second, so that one is made ten times as rarely.
    """
    with loading():
        found = yield
    gc.set_threshold(*gc.get_threshold()[:2], 100)
    return found


@pytest.fixture(autouse=True)
def _floating_point_errors():
    """Overflow, division by zero and invalid operations are errors; underflow to zero is physics."""
    with np.errstate(all="raise", under="ignore"):
        yield


@pytest.fixture
def rng():
    return np.random.default_rng(20240308)
