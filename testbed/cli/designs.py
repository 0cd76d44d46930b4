"""What the command line prints of a design, and what it writes of it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from ruamel.yaml import YAML

from testbed.cli.console import ruled, terminal
from testbed.runs.table import metric_text

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from testbed.design.requirement import Requirement
    from testbed.design.search import Candidate, Design

# Student's t, two-sided 95 %, for 2 to 10 seeds.
_T95 = (12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262)


def prove(requirement: Requirement, candidate: Candidate, seeds: int) -> dict[str, dict[str, Any]]:
    """Return what a chain really leaves, by metric: values of each seed, mean and half its 95 % interval [urad].

    Parameters
    ----------
    requirement : Requirement
        Where its parts are from.
    candidate : Candidate
        Which.
    seeds : int
        Of the sensors' noise; 2 to 10.
    """
    from testbed.campaigns.evaluate import evaluate
    from testbed.design.search import chosen_scenario
    from testbed.judging.sights import pointing_value
    from testbed.scenario.model import Scenario

    frame = requirement.scenario.frame
    keys = {**chosen_scenario(requirement, candidate), "truth_seed": frame.seed}
    scenario = Scenario.from_dict(keys, requirement.scenario.folder)
    drawn = evaluate(scenario, range(frame.seed, frame.seed + seeds))
    rows = [metrics.pointing[candidate.blend] for metrics in drawn]
    found = {}
    for metric, expected in candidate.values.items():
        values = [float(pointing_value(row, metric) or math.nan) for row in rows]
        mean = math.fsum(values) / seeds
        spread = math.sqrt(math.fsum((value - mean) ** 2 for value in values) / (seeds - 1))
        half = _T95[seeds - 2] * spread / math.sqrt(seeds)
        found[metric] = {"values": values, "mean": mean, "ci95": half, "by_spectra": expected}
    return found


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
        table.add_row(f"{one.cost:g}", *values, "met" if one.met else "", one.name)
    console.print(table)
    chosen = design.chosen
    words = "no chain is enough" if chosen is None else f"chosen: {chosen.name}, cost {chosen.cost:g}"
    console.print(words, soft_wrap=True, highlight=False)
    for name, reason in design.refused.items():
        console.print(f"left out: {name}: {reason}", soft_wrap=True, highlight=False)


def print_proof(proof: dict[str, dict[str, Any]]) -> None:
    """Print what the runs made of the chosen chain beside its spectra.

    Parameters
    ----------
    proof : dict
        As `prove` has it.
    """
    table = ruled("", "by spectra", "simulated", "95 %", title="proof: urad over seeds")
    for metric, row in proof.items():
        cells = (f"{row[key]:.4g}" for key in ("by_spectra", "mean", "ci95"))
        table.add_row(metric_text(metric), *cells)
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
            **one.values,
        }
        for one in candidates
    ]


def write_chosen(requirement: Requirement, candidate: Candidate, path: Path) -> Path:
    """Write the scenario that plays a candidate.

    Parameters
    ----------
    requirement : Requirement
        Where its parts are from.
    candidate : Candidate
        Which.
    path : Path
        The file.
    """
    from testbed.design.search import chosen_scenario

    yaml = YAML(typ="safe", pure=True)
    yaml.default_flow_style = False
    yaml.sort_base_mapping_type_on_output = False
    with path.open("w", encoding="utf-8") as stream:
        stream.write(f"# chosen by `testbed design`: {candidate.name}, cost {candidate.cost:g}\n")
        yaml.dump(chosen_scenario(requirement, candidate), stream)
    return path
