"""A YAML 1.2 document whose findings know their line."""

from __future__ import annotations

import difflib
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn, TypeVar

from pydantic import BaseModel, ValidationError

from testbed.errors import Problem, ScenarioError, quoted, shortened
from testbed.inputs.tree import Tree, read_yaml

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    Key = tuple[str | int, ...]

Model = TypeVar("Model", bound=BaseModel)

_MOST_FINDINGS = 100
_COUNTED = {"too_short", "too_long"}


class Document:
    """The content of a YAML file, or of a mapping built in Python, and what was found wrong with it.

    Parameters
    ----------
    path : Path or str
        The file; of a mapping, the one that it came from, or nothing.
    what : str
        What it should hold, with its first keys, for the message about an empty or wrong one.
    tree : Tree, optional
        The content, if it is not to be read.

    Raises
    ------
    ScenarioError
        If it cannot be read, is empty, binary, no mapping, breaks YAML 1.2 (a repeated key does) or a limit of
        `testbed.inputs`.
    """

    def __init__(
        self, path: Path | str, what: str = "scenario (name, duration, motion, sensors, ...)", tree: Tree | None = None
    ) -> None:
        self.file, self._what = str(path), what
        self.problems: list[Problem] = []
        self._tree = read_yaml(Path(path), f"a {what.split(maxsplit=1)[0]}") if tree is None else tree
        self.data = self._mapping(self._tree.data)

    def find(self, key: Key, message: str) -> None:
        """Note a problem at `key`, a path of mapping keys and list indices."""
        place = ".".join(shortened(str(step)) for step in key)
        self.problems.append(Problem(message, place, self.file, self._tree.line(key)))

    def adopt(self, error: ScenarioError) -> None:
        """Take over the findings about another file, such as a recorded motion."""
        self.problems.extend(error.problems)

    def refuse(self) -> None:
        """Raise ScenarioError with everything found so far, in the order of the lines, if anything was."""
        found = sorted(self.problems, key=lambda problem: (problem.file != self.file, problem.line or 0))
        if len(found) > _MOST_FINDINGS:
            more = Problem(f"and {len(found) - _MOST_FINDINGS} more findings", file=self.file)
            found = [*found[:_MOST_FINDINGS], more]
        if found:
            raise ScenarioError(found)

    def validate(self, model: type[Model], data: Any, key: Key, folder: Path, **context: Any) -> Model | None:
        """Validate `data`, found at `key`, as `model`; note what is wrong and return None then."""
        try:
            return model.model_validate(data, context={"border": True, "folder": folder, **context})
        except ValidationError as error:
            for place, message in findings(error, model, data):
                self.find((*key, *place), message)
        except ScenarioError as error:
            self.adopt(error)
        return None

    def _mapping(self, data: Any) -> Any:
        if data is None:
            self._fatal(f"is empty; expected a {self._what}")
        if not isinstance(data, dict):
            self._fatal(f"expected a mapping, the keys of a {self._what}", line=1)
        return data

    def _fatal(self, message: str, *, line: int | None = None) -> NoReturn:
        raise ScenarioError([Problem(message, file=self.file, line=line)])


def findings(error: ValidationError, model: type[BaseModel], data: Any) -> Iterator[tuple[Key, str]]:
    """Yield place and message of everything that is wrong with `data` as `model`.

    Parameters
    ----------
    error : ValidationError
        What was found.
    model : type
        What was expected.
    data : Any
        What was given.
    """
    for detail in error.errors():
        yield _visible(detail["loc"], data), _message(detail, model)


def unknown_key(key: str, known: Iterable[str]) -> str:
    """Return the message for a key that nothing knows."""
    names = sorted(known)
    near = difflib.get_close_matches(shortened(key), names, n=1)
    hint = f"; did you mean {near[0]!r}?" if near else ""
    return f"unknown key{hint} (known: {', '.join(names)})"


def _visible(loc: tuple[str | int, ...], data: Any) -> Key:
    """Drop the steps of a pydantic location that are not in the file (names of union members)."""
    key: list[str | int] = []
    node = data
    for step in loc:
        if isinstance(node, dict) and isinstance(step, str):
            key.append(step)
            node = node.get(step)
        elif isinstance(node, list) and isinstance(step, int):
            key.append(step)
            node = node[step] if step < len(node) else None
    return tuple(key)


def _message(detail: Mapping[str, Any], model: type[BaseModel]) -> str:
    kind = detail["type"]
    if kind == "extra_forbidden":
        return unknown_key(str(detail["loc"][-1]), _known(model, detail["loc"][:-1]))
    if kind == "missing":
        return "is required"
    if kind == "quantity":
        return str(detail["msg"])
    if kind in _COUNTED:
        return _count_message(detail)
    reason = str(detail["msg"]).removeprefix("Value error, ")
    if kind == "value_error":
        return reason
    return f"{reason[0].lower()}{reason[1:]}, got {quoted(detail['input'])}"


def _count_message(detail: Mapping[str, Any]) -> str:
    """Return the message for a list or mapping of too few or too many entries, with the remedy."""
    context = detail["ctx"]
    if detail["type"] == "too_short":
        least = context["min_length"]
        return f"expected at least {least} {_entries(least)}, got {context['actual_length']}: add some, or leave it out"
    most, count = context["max_length"], context["actual_length"] or "more"
    return f"expected at most {most} {_entries(most)}, got {count}: leave some out"


def _entries(count: int) -> str:
    return "entry" if count == 1 else "entries"


def _known(model: type[BaseModel], loc: tuple[str | int, ...]) -> Iterable[str]:
    """Return the keys that are known at `loc` inside `model`."""
    here: Any = model
    for step in loc:
        field = getattr(here, "model_fields", {}).get(step)
        if field is not None:
            here = next((c for c in _classes(field.annotation) if issubclass(c, BaseModel)), here)
    known: list[str] = here.known_keys() if hasattr(here, "known_keys") else list(getattr(here, "model_fields", {}))
    return known


def _classes(annotation: Any) -> list[type]:
    if isinstance(annotation, type):
        return [annotation]
    return [c for inner in getattr(annotation, "__args__", ()) for c in _classes(inner)]
