"""The chosen chain as a scenario and as a study of it, and what the study's rows say of the requirement."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any

from ruamel.yaml import YAML

from testbed.campaigns.curves import summarise
from testbed.campaigns.renewal import code_sha256, make_way
from testbed.campaigns.store import read_cases
from testbed.campaigns.study import load_study
from testbed.design.search import chosen_scenario
from testbed.fusion.belief_file import is_belief_file
from testbed.runs.table import metric_text
from testbed.scenario.resolved import dump, resolved_fusion

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from testbed.campaigns.study import Study
    from testbed.design.requirement import Requirement
    from testbed.design.search import Candidate

CHOSEN, STUDY = "chosen.yaml", "proof.yaml"


@dataclass(frozen=True)
class Proof:
    """A metric of the chosen chain, simulated.

    Parameters
    ----------
    by_spectra : float
        What the design expects [urad].
    value, lower, upper : float
        Rms over the seeds with its 95 % interval [urad].
    n_seed : int
        Seeds that came to their end.
    asked : str or None
        The bound, if this is asked for.
    proven : bool or None
        Whether the interval as a whole keeps the bound.
    """

    by_spectra: float
    value: float
    lower: float
    upper: float
    n_seed: int
    asked: str | None
    proven: bool | None

    def to_dict(self) -> dict[str, Any]:
        """Return it as the document has it."""
        return {key: None if value != value else value for key, value in asdict(self).items()}  # noqa: PLR0124


def write_chosen(requirement: Requirement, candidate: Candidate, folder: Path) -> Path:
    """Write the scenario that plays a candidate, and return its file.

    Parameters
    ----------
    requirement : Requirement
        Where its parts are from.
    candidate : Candidate
        Which.
    folder : Path
        Where to.
    """
    head = f"chosen by `testbed design`: {candidate.name}, cost {candidate.cost:g}"
    chosen = chosen_scenario(requirement, candidate)
    return _write(folder / CHOSEN, head, {**chosen, **_without_files(requirement, candidate, chosen, folder.resolve())})


def proof_study(
    requirement: Requirement, candidate: Candidate, seeds: int, folder: Path, plugins: Sequence[str] = ()
) -> Study:
    """Write the study that plays the chosen scenario under several seeds of the sensors' noise, and make way for it.

    Parameters
    ----------
    requirement : Requirement
        What is asked.
    candidate : Candidate
        What was chosen; `write_chosen` has written it there.
    seeds : int
        How many.
    folder : Path
        Where to.
    plugins : sequence of str, optional
        As for `load_study`.

    Returns
    -------
    Study
        The proof of another choice, or by other code, is gone from the folder; one that was stopped goes on.
    """
    asked = ", ".join(f"{metric_text(one.metric)} {one.relation} {one.limit:g} urad" for one in requirement.bounds)
    expected = ", ".join(f"{metric_text(metric)} {value:.4g} urad" for metric, value in candidate.values.items())
    study = {
        "name": f"{requirement.scenario.name}_proof",
        "description": f"{candidate.name}. Asked: {asked}. By spectra: {expected}.",
        "base": CHOSEN,
        "seeds": seeds,
    }
    path = _write(folder / STUDY, "the chosen chain under several seeds", study)
    loaded = load_study(path, plugins=plugins)
    code = f"{code_sha256(plugins)} {loaded.cases[0].sha256} {seeds}"
    found = replace(loaded, code=code)
    make_way(folder / "proof", found, plugins)
    return found


def read_proof(requirement: Requirement, candidate: Candidate, folder: Path) -> dict[str, Proof]:
    """Return what the runs made of the candidate, by metric; nothing if all of them failed.

    Parameters
    ----------
    requirement : Requirement
        What is asked.
    candidate : Candidate
        What was played.
    folder : Path
        Of the sweep.
    """
    points = summarise(read_cases(folder), ()).points.get(("filter", candidate.blend), ())
    found = {}
    for point in points:
        for metric, expected in candidate.values.items():
            bounds = [one for one in requirement.bounds if one.metric == metric]
            lower, value, upper = point.sight[metric]
            asked = ", ".join(f"{one.relation} {one.limit:g}" for one in bounds) or None
            proven = all(one.met(end) for one in bounds for end in (lower, upper)) if bounds else None
            found[metric] = Proof(expected, value, lower, upper, point.n_seed, asked, proven)
    return found


def _without_files(
    requirement: Requirement, candidate: Candidate, chosen: Mapping[str, Any], folder: Path
) -> dict[str, Any]:
    """Return those keys of the chosen scenario that name files beside the requirement, for a scenario elsewhere.

    A recorded motion is copied to the folder; a measured mirror and the file of a belief are written out.
    """
    scenario, mirror = requirement.scenario, requirement.mirrors[candidate.mirror]
    pointing, fusion = dict(chosen["pointing"]), {key: dict(entry) for key, entry in chosen["fusion"].items()}
    if "response" in pointing["mirror"]:
        others = {key: value for key, value in pointing["mirror"].items() if key != "response"}
        measured = {key: dump(mirror)[key] for key in ("numerator", "denominator")}
        pointing["mirror"] = {**others, **measured}
    belief = fusion[candidate.blend].get("belief")
    if isinstance(belief, str) and is_belief_file(belief):
        spec = scenario.fusion[candidate.blend]
        beliefs = resolved_fusion({candidate.blend: spec})[candidate.blend]["belief"]
        fusion[candidate.blend]["belief"] = {name: beliefs[name] for name in candidate.sensors}
    kept = scenario.kept_in(folder).motion
    motion = [
        {kind: dump(term, folder)} if "file" in type(term).model_fields else written
        for written, (kind, term) in zip(chosen["motion"], kept, strict=True)
    ]
    return {"pointing": pointing, "fusion": fusion, "motion": motion}


def _write(path: Path, head: str, content: dict[str, Any]) -> Path:
    yaml = YAML(typ="safe", pure=True)
    yaml.default_flow_style = False
    yaml.sort_base_mapping_type_on_output = False
    with path.open("w", encoding="utf-8") as stream:
        stream.write(f"# {head}\n")
        yaml.dump(content, stream)
    return path
