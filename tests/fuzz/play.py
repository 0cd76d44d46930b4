"""Plays a case as its command would (`check`, `compensate`, `allan --map`), and says what is wrong with the answer."""

from __future__ import annotations

import io
import json
import re
import resource
import signal
import time
import traceback
import warnings as python_warnings
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass

import numpy as np

from testbed.errors import MOST_QUOTED, RunError, ScenarioError
from tests.fuzz.cases import LOG
from tests.fuzz.models import MOST_DRIFT, TRIED

MOST_SECONDS, MOST_MEMORY = 5.0, 1 << 30
# Long enough to be no list of known names.
_LONGEST_MESSAGE = 2000


@dataclass(frozen=True)
class Result:
    """How a case ended: accepted or refused, in how much time, and what is wrong with that."""

    outcome: str
    seconds: float
    fault: str = ""


def memory():
    """Return the largest memory that this process ever had [byte]."""
    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


class TookTooLongError(BaseException):
    """Not to be caught by what is tested."""


@contextmanager
def within(seconds):
    """Give up after so much time of this process, or six times as much on the clock: others have the machine too."""

    def ring(_signal, _frame):
        raise TookTooLongError

    timers = {signal.SIGPROF: (signal.ITIMER_PROF, seconds), signal.SIGALRM: (signal.ITIMER_REAL, 6 * seconds)}
    before = {number: signal.signal(number, ring) for number in timers}
    for timer, length in timers.values():
        signal.setitimer(timer, length)
    try:
        yield
    finally:
        for number, (timer, _) in timers.items():
            signal.setitimer(timer, 0)
            signal.signal(number, before[number])


def check(path):
    """Do what `testbed check` does, both forms of its page and the document."""
    from testbed.chain.forecast import forecast
    from testbed.cli.check_page import print_page, size_document, warnings
    from testbed.cli.understood import print_scenario, scenario_document
    from testbed.judging.table_facts import table_facts
    from testbed.scenario.departures import departures
    from testbed.scenario.loader import load_scenario

    scenario = load_scenario(path)
    warnings(scenario)
    try:
        size = forecast(scenario)
    except RunError as error:
        raise ScenarioError(str(error)) from error
    facts = table_facts(scenario, size.step)
    document = {**scenario_document(scenario, facts), "differs": departures(scenario), "forecast": size_document(size)}
    json.dumps(document, allow_nan=False)
    print_scenario(scenario, facts)
    print_page(scenario, facts, size)


def read(path):
    """Read a drift model, and compensate a record with it."""
    from testbed.drift.session import read_model

    try:
        block = read_model(path).apply(TRIED)
    except ScenarioError:
        raise
    except ValueError as error:  # the commands show it as their own
        raise ScenarioError(str(error)) from error
    if not np.isfinite(block.rate).all() or not np.abs(block.drift).max() <= MOST_DRIFT:
        msg = f"an absurd drift of {np.abs(block.drift).max()} rad/s"
        raise AssertionError(msg)


def inspect(path):
    """Read the recording beside a map with it, and put what is a rate on an even grid."""
    from testbed.logs import read_log

    recording = path.parent / "log.csv"
    if not recording.exists():
        recording.write_text(LOG)
    for channel in read_log(recording, map=path).channels.values():
        if channel.quantity == "rate":
            channel.rate().even()


PLAYED = {"text": check, "tree": check, "yaml": check, "model": read, "map": inspect}


def play(kind, text, path, seconds=4 * MOST_SECONDS):
    """Write a case and do with it what users do.

    Parameters
    ----------
    kind : str
        What it is: see `PLAYED`.
    text : str
        The case.
    path : Path
        Where to.
    seconds : float
        After which it is given up [s].
    """
    path.write_text(text, encoding="utf-8", errors="surrogatepass", newline="")
    begin, cpu, fault, outcome = time.monotonic(), time.process_time(), "", "accepted"
    before = memory()
    try:
        with (
            within(seconds),
            redirect_stdout(io.StringIO()),
            redirect_stderr(io.StringIO()),
            python_warnings.catch_warnings(),
        ):
            python_warnings.simplefilter("ignore")
            PLAYED[kind](path)
    except ScenarioError as error:
        outcome, fault = "refused", message_fault(error)
    except TookTooLongError:
        outcome, fault = "hung", "".join(traceback.format_exc().splitlines(keepends=True)[-8:])
    except BaseException:  # noqa: BLE001 - whatever else comes out is what is looked for
        outcome, fault = "raised", traceback.format_exc()
    spent = min(time.process_time() - cpu, time.monotonic() - begin)
    if not fault and spent > MOST_SECONDS:
        fault = f"took {spent:.1f} s"
    if not fault and memory() - before > MOST_MEMORY:
        fault = f"took {(memory() - before) >> 20} MB"
    return Result(outcome, spent, fault)


def message_fault(error):
    """Return what is wrong with the findings: none, too long, or more of the input than is allowed."""
    for problem in error.problems:
        if not problem.message:
            return "a finding without words"
        if len(problem.message) > _LONGEST_MESSAGE:
            return f"a message of {len(problem.message)} characters: {problem.message[:200]}"
        if re.search(rf"(x|s|9|\[|\{{){{1}}\1{{{MOST_QUOTED},}}", problem.message):
            return f"repeats more than {MOST_QUOTED} characters: {problem.message[:300]}"
    return ""
