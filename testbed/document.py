"""A YAML 1.2 document whose findings know their line."""

from __future__ import annotations

import difflib
from typing import TYPE_CHECKING, Any, NoReturn, TypeVar

from pydantic import BaseModel, ValidationError
from ruamel.yaml import YAML
from ruamel.yaml.constructor import DuplicateKeyError
from ruamel.yaml.error import MarkedYAMLError, YAMLError

from testbed.errors import Problem, ScenarioError

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from pathlib import Path

    Key = tuple[str | int, ...]

Model = TypeVar("Model", bound=BaseModel)

_LARGEST = 1_000_000


class Document:
    """The content of a YAML file and what was found wrong with it.

    Parameters
    ----------
    path : Path
        The file.
    what : str
        What it should hold, with its first keys, for the message about an empty or wrong one.

    Raises
    ------
    ScenarioError
        If it cannot be read, is empty, binary, no mapping, or breaks YAML 1.2 (a repeated key does).
    """

    def __init__(self, path: Path, what: str = "scenario (name, duration, motion, sensors, ...)") -> None:
        self.file, self._what = str(path), what
        self.problems: list[Problem] = []
        self.data = self._mapping(self._parse(self._text(path)))

    def find(self, key: Key, message: str) -> None:
        """Note a problem at `key`, a path of mapping keys and list indices."""
        self.problems.append(Problem(message, ".".join(map(str, key)), self.file, self._line(key)))

    def adopt(self, error: ScenarioError) -> None:
        """Take over the findings about another file, such as a recorded motion."""
        self.problems.extend(error.problems)

    def refuse(self) -> None:
        """Raise ScenarioError with everything found so far, in the order of the lines, if anything was."""
        if self.problems:
            raise ScenarioError(
                sorted(self.problems, key=lambda problem: (problem.file != self.file, problem.line or 0))
            )

    def validate(self, model: type[Model], data: Any, key: Key, folder: Path) -> Model | None:
        """Validate `data`, found at `key`, as `model`; note what is wrong and return None then."""
        try:
            return model.model_validate(data, context={"border": True, "folder": folder})
        except ValidationError as error:
            for detail in error.errors():
                self.find((*key, *_visible(detail["loc"], data)), _message(detail, model))
        except ScenarioError as error:
            self.adopt(error)
        return None

    def _text(self, path: Path) -> str:
        try:
            if path.stat().st_size > _LARGEST:
                self._fatal(f"expected a {self._what.split()[0]} of at most {_LARGEST} bytes")
            text = path.read_text(encoding="utf-8-sig")
        except UnicodeDecodeError:
            self._fatal("expected a YAML text in UTF-8, got a binary file")
        except OSError as error:
            self._fatal(f"cannot be read: {error.strerror or error}")
        return text

    def _parse(self, text: str) -> Any:
        try:
            return YAML(typ="rt", pure=True).load(text)
        except DuplicateKeyError as error:
            self._fatal(str(error.problem).replace("found duplicate key", "repeated key"), error)
        except MarkedYAMLError as error:
            self._fatal(f"not YAML: {error.problem or error.context}", error)
        except (YAMLError, ValueError) as error:
            reason = str(error).splitlines()[0] if str(error) else "unreadable characters"
            self._fatal(f"not YAML: {reason}")

    def _mapping(self, data: Any) -> Any:
        if data is None:
            self._fatal(f"is empty; expected a {self._what}")
        if not isinstance(data, dict):
            self._fatal(f"expected a mapping, the keys of a {self._what}", line=1)
        return data

    def _fatal(self, message: str, error: MarkedYAMLError | None = None, *, line: int | None = None) -> NoReturn:
        mark = getattr(error, "problem_mark", None)
        raise ScenarioError([Problem(message, file=self.file, line=mark.line + 1 if mark is not None else line)])

    def _line(self, key: Key) -> int | None:
        """Return the line of the deepest part of `key` that stands in the file."""
        node, line = self.data, None
        for step in key:
            try:
                position = node.lc.data[step]
                node = node[step]
            except (AttributeError, KeyError, IndexError, TypeError):
                break
            line = position[0] + 1
        return line


def unknown_key(key: str, known: Iterable[str]) -> str:
    """Return the message for a key that nothing knows."""
    names = sorted(known)
    near = difflib.get_close_matches(key, names, n=1)
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
    reason = str(detail["msg"]).removeprefix("Value error, ")
    if kind == "value_error":
        return reason
    return f"{reason[0].lower()}{reason[1:]}, got {detail['input']!r}"


def _known(model: type[BaseModel], loc: tuple[str | int, ...]) -> Iterable[str]:
    """Return the keys that are known at `loc` inside `model`."""
    here: Any = model
    for step in loc:
        field = getattr(here, "model_fields", {}).get(step)
        if field is not None:
            here = next((c for c in _classes(field.annotation) if issubclass(c, BaseModel)), here)
    return list(getattr(here, "model_fields", {}))


def _classes(annotation: Any) -> list[type]:
    if isinstance(annotation, type):
        return [annotation]
    return [c for inner in getattr(annotation, "__args__", ()) for c in _classes(inner)]
