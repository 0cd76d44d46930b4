"""A chain for a requirement on pointing."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from testbed.cli.options import Output, PluginModules, expanded
from testbed.cli.status import FAILED, MISSED


@expanded
def design(
    requirement: Annotated[
        Path, typer.Argument(metavar="REQUIREMENT.yaml", help="What is asked, and the parts with their costs.")
    ],
    output: Output,
    prove: Annotated[bool, typer.Option("--prove", help="Sweep the chosen chain over several seeds.")] = False,
    seeds: Annotated[int, typer.Option(min=2, max=1000, help="Of the proof.")] = 10,
    workers: Annotated[int, typer.Option(min=1, max=1000, help="Processes of the proof.")] = 1,
    out: Annotated[
        Path | None, typer.Option(help="Folder for figure, scenario and proof; default runs/<name>.")
    ] = None,
    plugin: PluginModules = None,
) -> None:
    """Print the cheapest chain of listed parts that meets a requirement on pointing, by spectra."""
    from testbed.cli import designs
    from testbed.design.figure import pareto_figure
    from testbed.design.proof import write_chosen
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
            written.append(write_chosen(asked, chosen, folder))
    proof = None
    if prove and chosen is not None:
        proof = designs.prove(asked, chosen, folder, seeds=seeds, workers=workers, plugins=plugin or (), output=output)
        written.append(folder / "proof")
    document = {
        "candidates": designs.candidate_rows(found.candidates),
        "pareto": designs.candidate_rows(found.pareto(first.metric)),
        "chosen": None if chosen is None else designs.candidate_rows([chosen])[0],
        "refused": dict(found.refused),
        "proof": None if proof is None else {metric: row.to_dict() for metric, row in proof.items()},
        "written": [str(path) for path in written],
    }

    def tables() -> None:
        designs.print_design(asked, found)
        if proof is not None:
            designs.print_proof(proof)
        for path in written:
            typer.echo(f"wrote {path}")

    output.show(document, tables)
    if proof == {}:
        raise typer.Exit(FAILED)
    if chosen is None or (proof is not None and any(row.proven is False for row in proof.values())):
        raise typer.Exit(MISSED)
