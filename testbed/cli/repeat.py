"""One point of a campaign again, as a full run with its report."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from testbed.chain.runner import run
from testbed.cli.terminal import print_metrics
from testbed.errors import Problem, ScenarioError, quoted

if TYPE_CHECKING:
    from testbed.campaigns.study import Study
    from testbed.cli.options import Output

# More is no seed.
_MOST_DIGITS = 20


def repeat(study: Study, only: str, out: Path | None, output: Output) -> None:
    """Run one case of a study with one seed, as the sweep played it.

    Parameters
    ----------
    study : Study
        With the case.
    only : str
        As ``CASE:SEED``.
    out : Path or None
        Run folder; named after study, case and seed if not given.
    output : Output
        Where the words go.

    Raises
    ------
    ScenarioError
        If there is no such case.
    """
    number, _, seed = only.partition(":")
    whole = all(part.isdecimal() and len(part) <= _MOST_DIGITS for part in (number, seed))
    if not (whole and int(number) < len(study.cases)):
        last = len(study.cases) - 1
        msg = f"expected CASE:SEED, the case from 0 to {last}, such as {last}:{study.seeds[0]}, got {quoted(only)}"
        raise ScenarioError([Problem(msg, "--only")])
    case = study.cases[int(number)]
    target = out or Path("runs") / f"{study.name}_case{case.number}_seed{int(seed)}"
    output.note(f"case {case.number}: " + ", ".join(f"{key} {value}" for key, value in case.values.items()))
    with output.progress(case.scenario.name, case.scenario.frame.duration) as tick:
        result = run(case.scenario, out=target, seed=int(seed), progress=tick)
    output.show({**result.metrics.to_dict(), "written": str(target)}, lambda: print_metrics(result.metrics, target))
