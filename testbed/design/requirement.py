"""What is asked of a line of sight, and the parts that it may be made of, each with its cost."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from testbed.document import Document
from testbed.errors import ScenarioError, quoted
from testbed.inputs.plugins import load_plugins
from testbed.inputs.tree import Tree, read_yaml
from testbed.pointing.parameters import Mirror, Tracker, Window, window_key
from testbed.scenario.entries import mapping
from testbed.scenario.intake import Intake
from testbed.scenario.loader import read_bound, read_document
from testbed.units import parse

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from testbed.parts import Part
    from testbed.scenario.model import Bound, Scenario

_WHAT = "requirement (name, duration, motion, sensors, fusion, trackers, mirrors, rpe_urad, ...)"
_WINDOWED = ("rpe_urad", "mpe_urad")
_ASKED = (*_WINDOWED, "residual_rms_urad")
_COST = "cost"
# Keys of a scenario that a requirement has not, and what is there instead.
_ELSEWHERE = {
    "pointing": "is chosen: 'trackers:' and 'mirrors:' have the parts, the bounds the windows",
    "expect": "is what is asked: give bounds beside 'motion:', such as rpe_urad: {100 ms: '< 0.5'}",
    "turntable": "is ideal here: leave it out, and give the chosen scenario another",
}


@dataclass(frozen=True)
class Requirement:
    """What is asked, and of what it may be made.

    Parameters
    ----------
    scenario : Scenario
        Disturbance, all sensors and all filters, on an ideal table.
    trackers, mirrors : mapping of str to Tracker, to Mirror
        By name.
    bounds : tuple of Bound
        What has to be met; the subject is empty.
    costs : mapping
        Of each part by its kind and name, such as ``("sensors", "mhd_ars")``.
    written : mapping
        The parts as they stand in the file, without costs.
    """

    scenario: Scenario
    trackers: Mapping[str, Tracker]
    mirrors: Mapping[str, Mirror]
    bounds: tuple[Bound, ...]
    costs: Mapping[tuple[str, str], float]
    written: Mapping[str, Any]

    @property
    def windows(self) -> tuple[Window, ...]:
        """Every window that is asked for."""
        lengths = {bound.metric.partition(".")[2] for bound in self.bounds} - {""}
        return tuple(Window(length=float(length)) for length in sorted(lengths, key=float))


def read_requirement(path: str | Path, *, plugins: Iterable[str] = ()) -> Requirement:
    """Read and validate a requirement.

    Parameters
    ----------
    path : str or Path
        A YAML file with the keys of a scenario, whose sensors and filters are those to choose from, each with its
        `cost`; `trackers` and `mirrors` likewise, and bounds such as ``rpe_urad: {100 ms: "< 0.5"}``.
    plugins : iterable of str, optional
        As for `load_scenario`.

    Raises
    ------
    ScenarioError
        With every finding at once.
    """
    tree = read_yaml(Path(path), "a requirement")
    document = Document(path, _WHAT, tree)
    data = dict(document.data)
    for key in _ELSEWHERE.keys() & data.keys():
        document.find((key,), _ELSEWHERE[key])
        del data[key]
    bounds = _bounds(document, {key: data.pop(key) for key in _ASKED if key in data})
    costs: dict[tuple[str, str], float] = {}
    written = {
        kind: _without_costs(document, kind, data.pop(kind, None), costs)
        for kind in ("sensors", "fusion", "trackers", "mirrors")
    }
    folder = Path(path).resolve().parent
    trackers = _parts(document, Tracker, "trackers", written["trackers"], folder)
    mirrors = _parts(document, Mirror, "mirrors", written["mirrors"], folder)
    for name, tracker in trackers.items():
        if tracker.fades:
            words = "expected none: a spectrum knows no moments; give them to the chosen scenario"
            document.find(("trackers", name, "fades"), words)
    written["frame"] = {"turntable": {"mode": "ideal"}, **data}
    whole = {**written["frame"], "sensors": written["sensors"], "fusion": written["fusion"]}
    scenario = _scenario(document, Tree(whole, tree.lines), folder, plugins)
    if scenario is not None:
        _check_windows(scenario, bounds, document)
    document.refuse()
    assert scenario is not None
    return Requirement(scenario, trackers, mirrors, bounds, costs, written)


def _scenario(document: Document, tree: Tree, folder: Path, plugins: Iterable[str]) -> Scenario | None:
    """Return the scenario in a requirement; None, with its findings among the others, if something is wrong."""
    try:
        return read_document(Intake(Document(document.file, _WHAT, tree), folder, load_plugins(plugins)))
    except ScenarioError as error:
        document.adopt(error)
        return None


def _check_windows(scenario: Scenario, bounds: tuple[Bound, ...], document: Document) -> None:
    """Note windows that do not fit into what is judged, at the bound that asks for them."""
    judged = scenario.frame.duration - scenario.frame.settle
    for bound in bounds:
        metric, _, length = bound.metric.partition(".")
        if length and float(length) > judged:
            document.find((metric,), f"expected windows within the {judged:g} s after settle, got {float(length):g} s")


def _bounds(document: Document, asked: Mapping[str, Any]) -> tuple[Bound, ...]:
    found = []
    windows = {
        metric: mapping(document, entry, (metric,)) if metric in _WINDOWED else {"": entry}
        for metric, entry in asked.items()
    }
    for metric, entries in windows.items():
        for window, text in entries.items():
            place = (metric, window) if window else (metric,)
            try:
                bound = read_bound("", _named(metric, str(window)), text)
                if not bound.relation.startswith("<"):
                    document.find(place, f"expected an upper bound such as '< 0.5', got {quoted(text)}")
                found.append(bound)
            except ValueError as error:
                document.find(place, str(error) or f"expected a bound such as '< 0.5', got {quoted(text)}")
    if not any(windows.values()):
        document.find((), f"nothing is asked: give a bound such as rpe_urad: {{100 ms: '< 0.5'}} ({', '.join(_ASKED)})")
    return tuple(found)


def _named(metric: str, window: str) -> str:
    """Return the name of a metric, with the window's length in seconds; ValueError if that is none."""
    return f"{metric}.{window_key(parse(window, 's', example='100 ms'))}" if window else metric


def _without_costs(document: Document, kind: str, given: Any, costs: dict[tuple[str, str], float]) -> dict[str, Any]:
    """Return the parts of a kind without their costs, which are noted; what is no mapping is for its own reader."""
    parts: dict[str, Any] = {}
    for name, entry in ((str(name), entry) for name, entry in mapping(document, given, (kind,)).items()):
        parts[name], cost = entry, 0.0
        if isinstance(entry, dict):
            parts[name] = {key: value for key, value in entry.items() if key != _COST}
            cost = entry.get(_COST, 0.0)
        if isinstance(cost, bool) or not isinstance(cost, int | float) or not cost >= 0.0:
            document.find((kind, name, _COST), f"expected a number of at least 0, got {quoted(cost)}")
            cost = 0.0
        costs[kind, name] = float(cost)
    if given is None or given == {}:
        document.find((kind,), f"there is nothing to choose from: name at least one of '{kind}:'")
    return parts


def _parts(document: Document, model: type[Part], kind: str, given: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    read = {
        name: document.validate(model, mapping(document, entry, (kind, name)), (kind, name), folder)
        for name, entry in given.items()
    }
    return {name: part for name, part in read.items() if part is not None}
