"""A chain for a requirement on pointing."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from testbed.cli.options import Output, PluginModules, expanded
from testbed.cli.status import MISSED


@expanded
def design(
    requirement: Annotated[
        Path, typer.Argument(metavar="REQUIREMENT.yaml", help="What is asked, and the parts with their costs.")
    ],
    output: Output,
    prove: Annotated[bool, typer.Option("--prove", help="Run the chosen chain under several seeds.")] = False,
    seeds: Annotated[int, typer.Option(min=2, max=10, help="Of the proof.")] = 5,
    out: Annotated[Path | None, typer.Option(help="Folder for figure and scenario; default runs/<name>.")] = None,
    plugin: PluginModules = None,
) -> None:
    """Print the cheapest chain of listed parts that meets a requirement on pointing, by spectra."""
    from testbed.cli import designs
    from testbed.design.figure import pareto_figure
    from testbed.design.requirement import read_requirement
    from testbed.design.search import search
    from testbed.judging.allan_analysis import write_figure
    from testbed.runs.folder import failing_as_run_error
    from testbed.runs.table import metric_text

    asked = read_requirement(requirement, plugins=plugin or ())
    found = search(asked)
    chosen, first = found.chosen, asked.bounds[0]
    folder = out or Path("runs") / asked.scenario.name
    with failing_as_run_error(str(folder)):
        folder.mkdir(parents=True, exist_ok=True)
        written = [
            write_figure(
                pareto_figure(found, first.metric, first.limit, metric_text(first.metric)), folder / "pareto.svg"
            )
        ]
        if chosen is not None:
            written.append(designs.write_chosen(asked, chosen, folder / "chosen.yaml"))
    proof = designs.prove(asked, chosen, seeds) if prove and chosen is not None else None
    document = {
        "candidates": designs.candidate_rows(found.candidates),
        "pareto": designs.candidate_rows(found.pareto(first.metric)),
        "chosen": None if chosen is None else designs.candidate_rows([chosen])[0],
        "refused": dict(found.refused),
        "proof": proof,
        "written": [str(path) for path in written],
    }

    def tables() -> None:
        designs.print_design(asked, found)
        if proof is not None:
            designs.print_proof(proof)
        for path in written:
            typer.echo(f"wrote {path}")

    output.show(document, tables)
    if chosen is None:
        raise typer.Exit(MISSED)
