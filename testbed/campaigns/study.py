"""A study: a base scenario, what varies in it, and the seeds under which each case is repeated."""

from __future__ import annotations

import hashlib
import itertools
import json
import shlex
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Self

from pydantic import Field, model_validator

from testbed.campaigns.axes import Axis, jointly_drawn, values_of
from testbed.document import Document
from testbed.errors import Problem, ScenarioError, shortened
from testbed.parts import Part
from testbed.scenario.frame import Seed
from testbed.scenario.loader import load_scenario
from testbed.units import Quantity

if TYPE_CHECKING:
    from collections.abc import Iterable

    from testbed.scenario.model import Scenario

# A case is checked in about 20 ms before any of them runs.
MOST_CASES = 20_000
_MOST_FINDINGS = 20
_WHAT = "study (name, base, vary, seeds)"


class Precision(Part):
    """How well each error shall be known.

    Parameters
    ----------
    rmse : float
        Half the width of the 95 % interval of the RMSE of every filter over itself [-].
    """

    rmse: Annotated[float, Quantity("", "5 %", above=0.0, at_most=1.0)]


class Seeds(Part):
    """How many seeds a case gets: a number, or as many as its errors need.

    Parameters
    ----------
    number : int, optional
        Of all cases; a bare number means this.
    until : Precision, optional
        When a case is done.
    most : int, optional
        Seeds of a case at the most, beside `until`.
    """

    number: Annotated[int, Field(ge=1, le=100_000, strict=True)] | None = None
    until: Precision | None = None
    most: Annotated[int, Field(ge=2, le=100_000, strict=True)] | None = None

    @model_validator(mode="before")
    @classmethod
    def _bare_number(cls, data: Any) -> Any:
        return data if isinstance(data, Mapping) else {"number": data}

    @model_validator(mode="after")
    def _one_of_both(self) -> Self:
        if (self.number is None) == (self.until is None) or (self.until is None) != (self.most is None):
            msg = "expected a number, or until: {rmse: 5 %} with most: 100"
            raise ValueError(msg)
        return self


class StudyFrame(Part):
    """The keys of a study.

    Parameters
    ----------
    name : str
        Names the folder.
    description : str, optional
        What it asks.
    base : Path
        Scenario of which the cases are variations, relative to the study.
    vary : dict of str to Axis
        Dotted keys of the scenario, and what they take.
    seeds : Seeds
        How many: the scenario's own and those that follow it.
    draws : int, optional
        Seed of random axes.
    """

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]*$", max_length=100)]
    description: str = ""
    base: Annotated[str, Field(min_length=1, max_length=1000)]
    vary: dict[str, Axis] = Field(default_factory=dict)
    seeds: Seeds = Seeds(number=1)
    draws: Seed = 0


@dataclass(frozen=True)
class Variation:
    """One variation: its number, what stands at the varied keys as written, and the scenario that it makes."""

    number: int
    values: Mapping[str, Any]
    scenario: Scenario

    @property
    def sha256(self) -> str:
        """Hash of the resolved scenario, whatever its seed."""
        resolved = {**self.scenario.resolved(), "seed": 0}
        return hashlib.sha256(json.dumps(resolved, sort_keys=True).encode()).hexdigest()


@dataclass(frozen=True)
class Study:
    """A validated study: `cases` in order, and `seeds`, of which a case with `precision` may need only the first;
    `command` is what plays it, `code` a hash of that where it matters which code began the folder.
    """

    name: str
    description: str
    file: str
    axes: tuple[str, ...]
    cases: tuple[Variation, ...]
    seeds: tuple[int, ...]
    precision: float | None = None
    command: str = ""
    code: str = ""

    def document(self) -> dict[str, Any]:
        """Return what the study is, as its folder keeps it: two that differ in it do not continue each other."""
        return {
            "name": self.name,
            "axes": list(self.axes),
            "cases": [{"values": dict(case.values), "scenario_sha256": case.sha256} for case in self.cases],
            "seeds": list(self.seeds),
            "precision": self.precision,
            "code": self.code,
        }


def load_study(path: str | Path, *, plugins: Iterable[str] = ()) -> Study:
    """Read a study and check every case of it.

    Parameters
    ----------
    path : str or Path
        A YAML file.
    plugins : iterable of str, optional
        As for `load_scenario`.

    Raises
    ------
    ScenarioError
        With every finding at once: file, line, key and what was expected.
    """
    document = Document(Path(path), _WHAT)
    frame = document.validate(StudyFrame, document.data, (), Path(path).parent)
    document.refuse()
    assert frame is not None
    base = load_scenario(Path(path).parent / frame.base, plugins=plugins)
    variations = _variations(frame, document)
    document.refuse()
    cases = _cases(_prepared(base), variations, document)
    document.refuse()
    first, count = base.frame.seed, frame.seeds.number or frame.seeds.most or 1
    precision = None if frame.seeds.until is None else frame.seeds.until.rmse
    return Study(
        frame.name,
        frame.description,
        str(path),
        tuple(frame.vary),
        tuple(cases),
        tuple(range(first, first + count)),
        precision,
        f"testbed sweep {shlex.quote(str(path))}",
    )


def _prepared(base: Scenario) -> Scenario:
    """Return the base as a sweep plays it: not judged by its own expectations, by modes where they hold."""
    changes: dict[str, Any] = {"expect": None} if base.expect else {}
    table = base.source.get("turntable") or {}
    if "engine" not in table:
        changes["turntable.engine"] = "auto"
    return base.with_(**changes) if changes else base


def _variations(frame: StudyFrame, document: Document) -> list[dict[str, Any]]:
    """Return what each case changes: the product of the axes that are swept, times the points that are drawn."""
    swept: dict[str, list[Any]] = {}
    if "seed" in frame.vary:
        document.find(("vary", "seed"), "expected no axis of seeds: 'seeds' says how many each case gets")
    for key, axis in frame.vary.items():
        try:
            if not axis.drawn:
                swept[key] = values_of(axis)
        except ValueError as error:
            document.find(("vary", key), str(error))
    try:
        drawn = jointly_drawn({key: axis for key, axis in frame.vary.items() if axis.drawn}, frame.draws)
    except ValueError as error:
        document.find(("vary",), str(error))
        return []
    if document.problems:
        return []
    count = len(drawn)
    for values in swept.values():
        count *= len(values)
    if count > MOST_CASES:
        document.find(("vary",), f"expected at most {MOST_CASES} cases, got {count}; use fewer points, or drawn axes")
        return []
    return [
        {key: ({**dict(zip(swept, point, strict=True)), **extra})[key] for key in frame.vary}
        for point in itertools.product(*swept.values())
        for extra in drawn
    ]


def _cases(base: Scenario, variations: list[dict[str, Any]], document: Document) -> list[Variation]:
    cases = []
    for number, values in enumerate(variations):
        try:
            cases.append(Variation(number, values, base.with_(**values) if values else base))
        except ScenarioError as error:
            for problem in error.problems:
                _find(document, number, values, problem)
            if len(document.problems) >= _MOST_FINDINGS:
                break
    return cases


def _find(document: Document, number: int, values: Mapping[str, Any], problem: Problem) -> None:
    """Note at the axis that brings it what is wrong with a case."""
    at = [key for key in values if problem.key == key or problem.key.startswith(f"{key}.") or key in problem.key]
    key: tuple[str, ...] = ("vary", at[0]) if at else ("vary",)
    written = ", ".join(shortened(f"{name} {value}") for name, value in values.items())
    document.find(key, f"case {number} ({written}): {problem.key}: {problem.message}")
