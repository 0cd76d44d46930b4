"""The standard campaign against its baseline, and the leaderboard."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from testbed.cli.options import Output, PluginModules, expanded
from testbed.cli.status import FAILED, MISSED

if TYPE_CHECKING:
    from testbed.campaigns.regression.regress import Outcome

_MOST_LINES = 20


@expanded
def regress(
    output: Output,
    short: Annotated[bool, typer.Option("--short", help="The short form, which the tests run.")] = False,
    update: Annotated[
        str | None, typer.Option(metavar="REASON", help="Store the result as the baseline, and why it is another.")
    ] = None,
    filters: Annotated[
        list[str] | None,
        typer.Option("--filter", metavar="MODULE:CLASS", help="Play this filter alone. May be repeated."),
    ] = None,
    workers: Annotated[int, typer.Option(min=1, max=1000, help="Processes on this machine.")] = 1,
    only: Annotated[
        str | None, typer.Option(metavar="CASE:SEED", help="Repeat this one as a full run, with its report.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Folder to write; default runs/regress_standard.")] = None,
    plugin: PluginModules = None,
) -> None:
    """Play the standard campaign, compare it with the stored baseline, and write the leaderboard."""
    from testbed.campaigns.regression.regress import run_regression
    from testbed.campaigns.regression.standard import case_count, published, shipped, standard_study

    entry = published(filters, plugin or ()) if filters else None
    if only is not None:
        from testbed.cli.repeat import repeat, which

        number, seed = which(only, case_count(short=short), 1)
        study = standard_study(entry or shipped(), short=short, only=number)
        repeat(study.name, study.cases[0], seed, out, output)
        return
    from testbed.cli.campaign import playing, tell_size

    options: dict[str, Any] = {"short": short, "update": update, "workers": workers, "out": out}
    with playing("regress", output) as told:
        found = run_regression(
            entry, **options, **told, begin=lambda study, folder: tell_size(study, workers, output, folder)
        )
    document = _document(found)
    output.show(document, lambda: _print(found))
    if found.failures:
        raise typer.Exit(FAILED)
    if found.moves and update is None:
        raise typer.Exit(MISSED)


def _document(found: Outcome) -> dict[str, Any]:
    return {
        "standings": [_defined(asdict(one)) for one in found.standings],
        "moves": [_defined(asdict(one)) for one in found.moves],
        "without_baseline": list(found.incomparable),
        "failures": [{name: row[name] for name in ("case", "seed", "reason")} for row in found.failures],
        "seconds": found.seconds,
        "written": str(found.folder),
    }


def _defined(row: dict[str, Any]) -> dict[str, Any]:
    # A number that is none is not equal to itself.
    return {key: None if value != value else value for key, value in row.items()}  # noqa: PLR0124


def _print(found: Outcome) -> None:
    from testbed.cli.console import ruled, terminal

    console = terminal()
    table = ruled("filter", "error over optimum", "95 %", "worst", "where", "claims hold", "time over kalman's", "urad")
    for one in found.standings:
        cost = "-" if one.cost is None else f"{one.cost:.2g}"
        limits, claims = f"{one.lower:.3g} to {one.upper:.3g}", f"{100 * one.honest:.0f} %"
        error, worst, sight = (f"{value:.3g}" for value in (one.over_optimum, one.worst, one.residual))
        table.add_row(one.name, error, limits, worst, one.worst_case, claims, cost, sight)
    console.print(table)
    lines = [
        *(f"failed: case {row['case']}, seed {row['seed']}: {row['reason']}" for row in found.failures),
        *(f"moved: {one.words()}" for one in found.moves),
        *found.incomparable,
    ]
    for line in lines[:_MOST_LINES]:
        console.print(line, soft_wrap=True, highlight=False)
    if len(lines) > _MOST_LINES:
        console.print(f"and {len(lines) - _MOST_LINES} more, in leaderboard.html")
    if found.moves:
        console.print("If that is meant, store it: testbed regress --update 'what changed the numbers'")
    console.print(f"it took {found.seconds:.0f} s")
    console.print(f"wrote {found.folder}: cases.parquet, sweep.html, leaderboard.html")
