"""Plays a case as its command would, and says what is wrong with the answer."""

from __future__ import annotations

import io
import json
import re
import resource
import signal
import time
import traceback
import warnings as python_warnings
from contextlib import chdir, contextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass
from unittest import mock

import numpy as np

from testbed.errors import MOST_QUOTED, RunError, ScenarioError
from tests.fuzz.models import MOST_DRIFT, TRIED
from tests.fuzz.texts import BASE, BELIEF, FUSION, LOG, MAP, REQUIREMENT, RESPONSE, STUDY

MOST_SECONDS, MOST_MEMORY = 5.0, 1 << 30
# Long enough to be no list of known names.
_LONGEST_MESSAGE = 2000


@dataclass(frozen=True)
class Result:
    """How a case ended: accepted or refused, in how much time, and what is wrong with that."""

    outcome: str
    seconds: float
    fault: str = ""
    late: bool = False


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


def beside(path):
    """Return the folder of a case, with what the documents name: recordings, a map, a scenario."""
    folder = path.parent
    for name, text in BESIDE.items():
        if not (folder / name).exists():
            (folder / name).write_text(text)
    return folder


def inspect(path):
    """Read the recording beside a map with it, and put what is a rate on an even grid."""
    from testbed.logs import read_log

    for channel in read_log(beside(path) / "log.csv", map=path).channels.values():
        if channel.quantity == "rate":
            channel.rate().even()


def replayed(path, **given):
    """Send the recording through the filters, as `testbed replay` does."""
    from testbed.playback.replay import play_back, prepare

    folder = beside(path)
    try:
        run = play_back(prepare(folder / "log.csv", map=folder / "map.yaml", **given))
    except RunError as error:
        raise ScenarioError(str(error)) from error
    json.dumps(run.metrics.to_dict(), allow_nan=False)


def believe(path):
    """Replay with a belief."""
    replayed(path, filters=["kalman", "wideband"], belief=path)


def fuse(path):
    """Replay through the filters of a file."""
    replayed(path, fusion=path)


def study(path):
    """Read a study, and say how much a sweep of it is."""
    from testbed.campaigns.size import size_of, sweep_words
    from testbed.campaigns.study import load_study

    beside(path)
    # A case takes 10 ms to check, and a sweep may have 20,000.
    with mock.patch("testbed.campaigns.study.MOST_CASES", 100):
        sweep_words(size_of(load_study(path), 2))


def design(path):
    """Read a requirement."""
    from testbed.design.requirement import read_requirement

    read_requirement(path)


def identify(path):
    """Tell a sensor from its reference, as `testbed identify` does, and write what filters may believe."""
    from testbed.identification.belief_text import belief_text
    from testbed.identification.session import identify_channels
    from testbed.logs.choice import select
    from testbed.logs.selection import Selection, TextOptions

    recording = path.with_suffix(".csv")
    recording.write_bytes(path.read_bytes())
    reference, *sensors = select(recording, Selection(column=["2", "3"]), TextOptions())
    belief_text(identify_channels(reference, sensors), path.name)


def command(path):
    """Say the words of a command line where its files lie."""
    from testbed.cli.app import app

    with chdir(beside(path)):
        try:
            app(json.loads(path.read_text(errors="surrogatepass")), standalone_mode=False)
        except RunError as error:
            raise ScenarioError(str(error)) from error
        except ScenarioError:
            raise
        except Exception as error:
            if hasattr(error, "show"):  # what is wrong with the call, said by the library of the command line
                msg = "usage"
                raise ScenarioError(msg) from error
            raise


BESIDE = {
    "log.csv": LOG,
    "map.yaml": MAP.replace("sign: -1, range: 10 deg/s, ", ""),
    "response.csv": RESPONSE,
    "base.yaml": BASE,
    "study.yaml": STUDY,
    "requirement.yaml": REQUIREMENT,
    "belief.yaml": BELIEF,
    "fusion.yaml": FUSION,
}
PLAYED = {
    "text": check,
    "tree": check,
    "yaml": check,
    "model": read,
    "map": inspect,
    "belief": believe,
    "fusion": fuse,
    "study": study,
    "requirement": design,
    "response": identify,
    "options": command,
}


def fairly(kind, text, path):
    """Play a case; one that takes too long is played again, for kernels are compiled when they are first used."""
    result = play(kind, text, path)
    if not result.late:
        return result
    play(kind, text, path, 120.0)
    return play(kind, text, path)


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
    late = outcome == "hung" or spent > MOST_SECONDS
    if not fault and late:
        fault = f"took {spent:.1f} s"
    if not fault and memory() - before > MOST_MEMORY:
        fault = f"took {(memory() - before) >> 20} MB"
    return Result(outcome, spent, fault, late)


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
