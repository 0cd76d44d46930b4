"""Which filters a recording goes through, what they believe of its sensors, and what they know of its start."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from testbed.document import Document
from testbed.errors import Problem, ScenarioError
from testbed.fusion.belief import SensorBelief
from testbed.fusion.belief_file import is_belief_file, read_belief
from testbed.inputs.plain import plain_tree
from testbed.scenario.fusion import Fusion
from testbed.scenario.intake import Intake
from testbed.scenario.resolved import dump

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from testbed.inputs.plugins import Plugins
    from testbed.scenario.model import FilterSpec

_WHAT = "fusion (filters by name, as in a scenario)"
# Paper 1's equation (39), as `testbed.estimate` has it.
_DEFAULT_BELIEF = "eq39"


def filter_specs(
    sensors: Iterable[str],
    names: Iterable[str],
    fusion: str | Path | Mapping[str, Any] | None,
    belief: str | Path | Mapping[str, Any] | None,
    start: str | None,
    plugins: Plugins,
) -> dict[str, FilterSpec]:
    """Return the filters by name.

    Parameters
    ----------
    sensors : iterable of str
        Channels that every filter reads.
    names : iterable of str
        Filters with their own parameters.
    fusion : str, Path or mapping, optional
        Filters with others, as under `fusion` in a scenario, or a file of them, such as a run's ``scenario.yaml``.
    belief : str, Path or mapping, optional
        What all filters believe, instead of what `fusion` says: the name of a shipped belief, a file or a mapping.
    start : {"unknown", "rest"}, optional
        What all filters know of the start, instead of what `fusion` says.
    plugins : Plugins
        Whose filters may be named.

    Raises
    ------
    ScenarioError
        With everything that is wrong.
    """
    document = _document(fusion)
    entries = _entries(document)
    for name in names:
        entries.setdefault(name, {})
    if not entries:
        raise ScenarioError([Problem("expected at least one filter, such as --filter kalman", "--filter")])
    said = _belief(belief)
    for entry in entries.values():
        if not isinstance(entry, dict):
            continue
        entry["belief"] = entry.get("belief") or _DEFAULT_BELIEF if said is None else said
        if start is not None:
            entry["start"] = start
    intake = Intake(document, Path(document.file).resolve().parent if document.file else Path(), plugins)
    specs = Fusion(intake, {}, {name: name for name in sensors}, {}, None, at_rest=False, simulated=False).read(entries)
    document.refuse()
    return specs


def _document(fusion: str | Path | Mapping[str, Any] | None) -> Document:
    if isinstance(fusion, str | Path):
        return Document(Path(fusion), _WHAT)
    return Document("", _WHAT, plain_tree(fusion or {}))


def _entries(document: Document) -> dict[str, Any]:
    """Return the entries of the filters, each to be changed freely."""
    found = document.data.get("fusion", document.data)
    if not isinstance(found, dict):
        document.find(("fusion",), "expected filters by name")
        document.refuse()
    return {name: dict(entry) if isinstance(entry, dict) else entry or {} for name, entry in found.items()}


def _belief(given: str | Path | Mapping[str, Any] | None) -> Any:
    """Return a belief as an entry has it: a name, or what is believed of each sensor."""
    if given is None or (isinstance(given, str) and not is_belief_file(given)):
        return given
    if not isinstance(given, str | Path):
        return {name: dump(one) if isinstance(one, SensorBelief) else one for name, one in given.items()}
    return {name: dump(one) for name, one in read_belief(Path(given)).items()}
