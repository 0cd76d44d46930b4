"""A campaign: every case of a study under its seeds."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from testbed.cli.options import Output, PluginModules, expanded
from testbed.cli.status import FAILED

if TYPE_CHECKING:
    from testbed.campaigns.study import Study

_MOST_FAILURES = 20


@expanded
def sweep(
    study: Annotated[Path, typer.Argument(metavar="STUDY.yaml", help="Study file.")],
    output: Output,
    workers: Annotated[int, typer.Option(min=1, max=1000, help="Processes on this machine.")] = 1,
    scheduler: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="Address of a running Dask scheduler to use instead.")
    ] = None,
    only: Annotated[
        str | None, typer.Option(metavar="CASE:SEED", help="Repeat this one as a full run, with its report.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Folder to write or go on with; default runs/<study name>.")] = None,
    plugin: PluginModules = None,
) -> None:
    """Play every case of a study under its seeds: cases.parquet and sweep.html."""
    from testbed.campaigns.study import load_study

    loaded = load_study(study, plugins=plugin or ())
    if only is not None:
        from testbed.cli.repeat import repeat, which

        number, seed = which(only, len(loaded.cases), loaded.seeds[0])
        repeat(loaded.name, loaded.cases[number], seed, out, output)
        return
    from testbed.campaigns.sweep import folder_of
    from testbed.campaigns.sweep import sweep as play
    from testbed.cli.campaign import playing, tell_size

    folder = folder_of(loaded, out)
    tell_size(loaded, workers, output, folder)
    with playing(loaded.name, output) as told:
        play(loaded, workers=workers, scheduler=scheduler, out=folder, **told)
    document = _document(folder, loaded)
    output.show(document, lambda: _print(document))
    if document["failures"]:
        raise typer.Exit(FAILED)


def _document(folder: Path, study: Study) -> dict[str, Any]:
    from testbed.campaigns.curves import summarise
    from testbed.campaigns.store import read_cases

    found = summarise(read_cases(folder), study.axes)
    ranking = [
        {
            "name": one.name,
            "over_best": one.over_best,
            "lower": _number(one.lower),
            "upper": _number(one.upper),
            "p_value": one.p_value,
            "n_seed": one.n_seed,
        }
        for one in found.ranking
    ]
    return {
        "study": study.name,
        "cases": len(study.cases),
        "runs": max((sum(point.n_seed for point in points) for points in found.points.values()), default=0),
        "ranking": ranking,
        "failures": [{name: row[name] for name in ("case", "seed", "reason")} for row in found.failures],
        "written": str(folder),
    }


def _number(value: float) -> float | None:
    return value if value == value else None  # noqa: PLR0124 - not a number


def _print(document: dict[str, Any]) -> None:
    from testbed.cli.console import ruled, terminal

    console = terminal()
    if document["ranking"]:
        seeds = document["ranking"][0]["n_seed"]
        title = f"{document['study']}: error over the best filter's, {document['cases']} cases, {seeds} seeds"
        table = ruled("filter", "error over the best", "95 %", "p (Holm)", title=title)
        for one in document["ranking"]:
            limits = "-" if one["lower"] is None else f"{one['lower']:.4g} to {one['upper']:.4g}"
            table.add_row(one["name"], f"{one['over_best']:.4g}", limits, f"{one['p_value']:.2g}")
        console.print(table)
    for one in document["failures"][:_MOST_FAILURES]:
        console.print(f"failed: case {one['case']}, seed {one['seed']}: {one['reason']}")
    if len(document["failures"]) > _MOST_FAILURES:
        console.print(f"and {len(document['failures']) - _MOST_FAILURES} more failures, in cases.parquet")
    console.print(f"wrote {document['written']}: cases.parquet, sweep.html")
