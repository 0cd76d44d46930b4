"""What the command line prints of a replay: what stands against the recording, and what the filters made of it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.text import Text

from testbed.cli.console import terminal
from testbed.cli.terminal import print_metrics

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from testbed.fusion.analysis.finding import Verdict
    from testbed.runs.metrics import ReplayMetrics, RunMetrics


def replay_words(name: str, duration: float, facts: ReplayMetrics) -> Iterator[str]:
    """Yield what was understood of a recording, a line each.

    Parameters
    ----------
    name : str
        Of the recording.
    duration : float
        Of the time that its sensors have in common [s].
    facts : ReplayMetrics
        What was read.
    """
    reference = "with a reference" if facts.reference else "without a reference"
    yield f"{name}: {facts.format}, {duration:.6g} s at {facts.clock}, {reference}"
    for channel, found in facts.channels.items():
        lost = f"{found.missing} readings lost" if found.missing else ""
        unused = f"{found.dropped} readings not used, outside of the common time" if found.dropped else ""
        yield from (f"{channel}: {words}" for words in (lost, unused, *found.notes) if words)
    yield from facts.notes


def print_replay(metrics: RunMetrics, verdict: Verdict, folder: Path) -> None:
    """Print what stands against a recording, then the table of its replay.

    Parameters
    ----------
    metrics : RunMetrics
        Of the replay.
    verdict : Verdict
        On the recording.
    folder : Path
        What was written.
    """
    console = terminal()
    for finding in verdict.findings:
        word = Text("finding: ", "green" if finding.fixed else "red")
        console.print(word + Text(str(finding)), soft_wrap=True)
    if not verdict.findings:
        console.print("verdict: nothing stands against this recording, as far as it can tell", soft_wrap=True)
    for text in verdict.undecided:
        console.print(f"not decided: {text}", soft_wrap=True)
    print_metrics(metrics, folder)
    if verdict.unfixed:
        names = ", ".join(f"{one.kind} of {one.sensor}" for one in verdict.unfixed)
        words = f"STANDS AGAINST IT: {names}; read the numbers above in that light"
        console.print(Text(words, "red"), soft_wrap=True)
