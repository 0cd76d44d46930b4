"""The standard campaign from its first case to the leaderboard."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from testbed.campaigns.regression.compare import Move, incomparable, moves
from testbed.campaigns.regression.history import HISTORY, append, check_reason, essence, latest, read_history
from testbed.campaigns.regression.leaderboard import Standing, costs_of, standings
from testbed.campaigns.regression.page import write_leaderboard
from testbed.campaigns.regression.standard import SHORT, STANDARD, Contenders, shipped, standard_study
from testbed.campaigns.renewal import code_sha256, make_way
from testbed.campaigns.rows import OK
from testbed.campaigns.store import read_cases
from testbed.campaigns.sweep import sweep
from testbed.errors import Problem, ScenarioError

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from testbed.campaigns.study import Study
    from testbed.campaigns.sweep import Progress


@dataclass(frozen=True)
class Outcome:
    """What came of a standard campaign.

    `moves` is what is no longer as in the baseline, `incomparable` what has none, `standings` the leaderboard,
    `failures` the rows of cases that failed, `seconds` how long this launch took, whatever its workers did at a time.
    """

    folder: Path
    moves: Sequence[Move]
    incomparable: Sequence[str]
    standings: Sequence[Standing]
    failures: Sequence[Mapping[str, Any]]
    seconds: float


def run_regression(
    entry: Contenders | None = None,
    *,
    short: bool = False,
    update: str | None = None,
    workers: int = 1,
    out: str | Path | None = None,
    begin: Callable[[Study, Path], None] | None = None,
    progress: Callable[[Progress], None] | None = None,
    history: Path = HISTORY,
) -> Outcome:
    """Play the standard campaign, compare it with its baseline and write ``leaderboard.html`` beside ``sweep.html``.

    What the same code has played already is not repeated, so that a result may be looked at before it is stored.

    Parameters
    ----------
    entry : Contenders, optional
        Filters to play, which join the leaderboard of the baseline; all that ship if not given.
    short : bool, optional
        The short form.
    update : str, optional
        Store the result as the baseline, for this reason.
    workers : int, optional
        Processes.
    out : str or Path, optional
        Folder; ``runs/regress_standard`` or ``runs/regress_short``, with the names of an entry, if not given.
    begin : callable, optional
        Gets what will be played, and its folder, before any of it is.
    progress : callable, optional
        As for `testbed.sweep`.
    history : Path, optional
        Where the baseline stands.

    Raises
    ------
    ScenarioError
        If a filter is refused, or an update is asked for of an entry or of a campaign with failures.
    """
    if update is not None and entry is not None:
        raise ScenarioError(
            [Problem("expected no --filter: the baseline is that of the filters that ship", "--update")]
        )
    if update is not None:
        check_reason(update)
    begun = time.monotonic()
    plugins = entry.plugins if entry else ()
    study = replace(standard_study(entry or shipped(), short=short), code=code_sha256(plugins))
    target = Path(out) if out else Path("runs") / "_".join([study.name, *(entry.fusion if entry else ())])
    make_way(target, study, plugins)
    if begin is not None:
        begin(study, target)
    folder = sweep(study, workers=workers, out=target, progress=progress)
    table = read_cases(folder).to_pylist()
    rows, failures = essence(table), [row for row in table if row["status"] != OK]
    stored = read_history(history)
    campaign = SHORT if short else STANDARD
    before, costs = latest(stored, campaign), costs_of(study.cases[0].scenario)
    mine = set(study.cases[0].scenario.fusion) | set(study.cases[0].scenario.sensors)
    same = [row for row in before if entry is None or row["source"] in mine]
    others = [row for row in before if entry is not None and row["source"] not in mine]
    costs = {row["source"]: row["cost"] for row in others if row["cost"] is not None} | costs
    order, took = standings([*others, *rows], costs), time.monotonic() - begun
    found = Outcome(folder, moves(rows, same), incomparable(rows, same), order, failures, took)
    if update is not None:
        if failures:
            raise ScenarioError([Problem(f"{len(failures)} runs failed, first: {failures[0]['reason']}", "--update")])
        append(rows, costs, campaign, update, history)
    write_leaderboard(folder, study, found.standings, found.moves, read_history(history), campaign)
    return found
