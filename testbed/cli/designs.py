"""What the command line prints of a design."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from testbed.cli.console import ruled, terminal
from testbed.runs.table import metric_text

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
    from pathlib import Path

    from testbed.cli.options import Output
    from testbed.design.proof import Proof
    from testbed.design.requirement import Requirement
    from testbed.design.search import Candidate, Design

# Whether a chain is enough, and whether something is doubtful about it.
_MET = {(True, False): "met", (True, True): "met, see below", (False, False): "", (False, True): ""}


def prove(
    requirement: Requirement,
    candidate: Candidate,
    folder: Path,
    *,
    seeds: int,
    workers: int,
    plugins: Iterable[str],
    output: Output,
) -> dict[str, Proof]:
    """Sweep a candidate over several seeds into ``proof`` of a folder, and return what came of it by metric.

    Parameters
    ----------
    requirement : Requirement
        What is asked.
    candidate : Candidate
        Which.
    folder : Path
        Where its scenario was written.
    seeds, workers : int
        Of the sweep.
    plugins : iterable of str
        As for `load_study`.
    output : Output
        Where the words go.
    """
    from testbed.campaigns.sweep import sweep
    from testbed.cli.campaign import playing, tell_size
    from testbed.design.proof import proof_study, read_proof

    study, place = proof_study(requirement, candidate, seeds, folder, list(plugins)), folder / "proof"
    tell_size(study, workers, output, place)
    with playing(study.name, output) as told:
        sweep(study, workers=workers, out=place, **told)
    return read_proof(requirement, candidate, place)


def print_design(requirement: Requirement, design: Design) -> None:
    """Print the candidates worth their cost, the chosen one and those that have no spectrum.

    Parameters
    ----------
    requirement : Requirement
        What is asked.
    design : Design
        What there is.
    """
    console = terminal()
    bounds = requirement.bounds
    asked = ", ".join(f"{metric_text(bound.metric)} {bound.relation} {bound.limit:g} urad" for bound in bounds)
    console.print(f"asked: {asked}; {len(design.candidates)} chains", soft_wrap=True, highlight=False)
    metrics = list(design.candidates[0].values)
    table = ruled("cost", *map(metric_text, metrics), "", "chain", title="none cheaper is as good [urad]")
    for one in design.pareto(bounds[0].metric):
        values = [f"{one.values[metric]:.3g}" for metric in metrics]
        table.add_row(f"{one.cost:g}", *values, _MET[one.met, bool(one.doubts)], one.name)
    console.print(table)
    chosen = design.chosen
    words = "no chain is enough" if chosen is None else f"chosen: {chosen.name}, cost {chosen.cost:g}"
    console.print(words, soft_wrap=True, highlight=False)
    seen = {one.name: one for one in (*design.pareto(bounds[0].metric), *([] if chosen is None else [chosen]))}
    for one in seen.values():
        for doubt in one.doubts:
            console.print(f"warning: {one.name}: {doubt}", soft_wrap=True, highlight=False)
    for name, reason in design.refused.items():
        console.print(f"left out: {name}: {reason}", soft_wrap=True, highlight=False)


def print_proof(proof: Mapping[str, Proof]) -> None:
    """Print what the runs made of the chosen chain beside its spectra.

    Parameters
    ----------
    proof : mapping of str to Proof
        By metric.
    """
    seeds = max((row.n_seed for row in proof.values()), default=0)
    heads = ("", "by spectra", "simulated", "95 %", "asked", "")
    table = ruled(*heads, title=f"proof: urad rms over {seeds} seeds of the sensors' noise")
    words = {None: "", True: "proven", False: "not proven"}
    for metric, row in proof.items():
        limits = f"{row.lower:.4g} to {row.upper:.4g}"
        numbers = f"{row.by_spectra:.4g}", f"{row.value:.4g}", limits
        table.add_row(metric_text(metric), *numbers, row.asked or "", words[row.proven])
    terminal().print(table)


def candidate_rows(candidates: Sequence[Candidate]) -> list[dict[str, Any]]:
    """Return candidates as rows: cost, values, whether enough, parts.

    Parameters
    ----------
    candidates : sequence of Candidate
        Which.
    """
    return [
        {
            "cost": one.cost,
            "met": one.met,
            "sensors": list(one.sensors),
            "blend": one.blend,
            "tracker": one.tracker,
            "mirror": one.mirror,
            "doubts": list(one.doubts),
            **one.values,
        }
        for one in candidates
    ]
