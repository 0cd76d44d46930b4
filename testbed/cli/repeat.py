"""One point of a campaign again, as a full run with its report."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from testbed.chain.runner import run
from testbed.cli.terminal import print_metrics
from testbed.errors import Problem, ScenarioError, quoted
from testbed.scenario.frame import MOST_SEED

if TYPE_CHECKING:
    from testbed.campaigns.study import Variation
    from testbed.cli.options import Output

# More is no seed.
_MOST_DIGITS = 20


def which(only: str, n_cases: int, seed: int) -> tuple[int, int]:
    """Return the numbers of the case and of the seed that a word on the command line names.

    Parameters
    ----------
    only : str
        As ``CASE:SEED``.
    n_cases : int
        Cases of the study.
    seed : int
        One of its seeds, for the message.

    Raises
    ------
    ScenarioError
        If there is no such case, or that is no seed.
    """
    number, _, given = only.partition(":")
    whole = all(part.isdecimal() and len(part) <= _MOST_DIGITS for part in (number, given))
    if not (whole and int(number) < n_cases and int(given) <= MOST_SEED):
        last = n_cases - 1
        msg = f"expected CASE:SEED, the case from 0 to {last}, such as {last}:{seed}, got {quoted(only)}"
        raise ScenarioError([Problem(msg, "--only")])
    return int(number), int(given)


def repeat(name: str, case: Variation, seed: int, out: Path | None, output: Output) -> None:
    """Run one case of a study with one seed, as the sweep played it.

    Parameters
    ----------
    name : str
        Of the study.
    case : Variation
        Which.
    seed : int
        Of its random streams.
    out : Path or None
        Run folder; named after study, case and seed if not given.
    output : Output
        Where the words go.
    """
    target = out or Path("runs") / f"{name}_case{case.number}_seed{seed}"
    output.note(f"case {case.number}: " + ", ".join(f"{key} {value}" for key, value in case.values.items()))
    with output.progress(case.scenario.name, case.scenario.frame.duration) as tick:
        result = run(case.scenario, out=target, seed=seed, progress=tick)
    output.show({**result.metrics.to_dict(), "written": str(target)}, lambda: print_metrics(result.metrics, target))
