"""YAML that is bounded before it is built.

Every limit is far above what an experiment needs, and low enough that whatever is given is refused within seconds and
in bounded memory.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from ruamel.yaml import YAML
from ruamel.yaml.constructor import DuplicateKeyError
from ruamel.yaml.error import MarkedYAMLError
from ruamel.yaml.events import AliasEvent, CollectionEndEvent, CollectionStartEvent, NodeEvent, ScalarEvent
from ruamel.yaml.nodes import MappingNode, ScalarNode, SequenceNode
from ruamel.yaml.parser import Parser
from ruamel.yaml.tag import Tag

from testbed.errors import Problem, ScenarioError, quoted, shortened
from testbed.inputs.files import read_bytes

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    Key = tuple[str, ...]

MOST_BYTES = 1 << 18
MOST_NODES = 20_000
MOST_DEPTH = 24
MOST_CHARACTERS = 4096
MOST_DIGITS = 64
_DATE, _TEXT = Tag(suffix="tag:yaml.org,2002:timestamp"), Tag(suffix="tag:yaml.org,2002:str")
_NUMBER = re.compile(r"[-+.]*\d[\w.+-]*")
# What moves a terminal's cursor or colours it, turns the direction of what follows, or is half of a character.
_UNSEEN = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x84\x86-\x9f\u202a-\u202e\u2066-\u2069\ud800-\udfff]")


@dataclass(frozen=True)
class Tree:
    """A YAML document of plain mappings, lists and scalars, and where its keys stand.

    Parameters
    ----------
    data : Any
        The content; None for an empty document.
    lines : dict
        Path of keys and list indices, as text, to the line, counted from 1.
    """

    data: Any
    lines: dict[Key, int] = field(repr=False)

    def line(self, key: tuple[Any, ...]) -> int | None:
        """Return the line of the deepest part of `key` that stands in the document."""
        steps = tuple(map(str, key))
        return next((self.lines[steps[:n]] for n in range(len(steps), 0, -1) if steps[:n] in self.lines), None)


def read_yaml(path: Path, what: str) -> Tree:
    """Read a YAML 1.2 file within the limits of this module.

    Parameters
    ----------
    path : Path
        The file.
    what : str
        What it should be, for messages, such as ``a scenario``.

    Raises
    ------
    ScenarioError
        If it cannot be read, is no YAML (a repeated key is none), has a tag, or exceeds a limit; with its line.
    """
    content = read_bytes(path, MOST_BYTES, what)
    try:
        return _tree(content.decode("utf-8-sig"))
    except UnicodeDecodeError:
        message, line = "expected a YAML text in UTF-8, got a binary file", None
    except _LimitError as error:
        message, line = str(error), error.line
    except DuplicateKeyError as error:
        message, line = f"repeated key {_repeated(error)}", _line_of(error)
    except MarkedYAMLError as error:
        message, line = f"not YAML: {shortened(str(error.problem or error.context))}", _line_of(error)
    except Exception as error:  # noqa: BLE001 - the library answers a version 1.9 with what it met
        reason = str(error).splitlines()[0] if str(error) else "unreadable characters"
        message, line = f"not YAML: {shortened(reason)}", None
    raise ScenarioError([Problem(message, file=str(path), line=line)])


def _line_of(error: MarkedYAMLError) -> int | None:
    mark = error.problem_mark
    return None if mark is None else mark.line + 1


def _repeated(error: DuplicateKeyError) -> str:
    return shortened(str(error.problem).removeprefix("found duplicate key "))


def _tree(text: str) -> Tree:
    yaml = YAML(typ="safe", pure=True)
    yaml.Parser = _BoundedParser
    root = yaml.compose(text)
    if root is None:
        return Tree(None, {})
    _check_keys(root)
    _keep_dates(root)
    return Tree(yaml.constructor.construct_document(root), dict(_lines(root, ())))


def _check_keys(node: Any) -> None:
    if isinstance(node, MappingNode):
        for name, value in node.value:
            if not isinstance(name, ScalarNode):
                msg = "expected a name as key, got a list or a mapping"
                raise _LimitError(msg, name.start_mark.line + 1)
            _check_keys(value)
    elif isinstance(node, SequenceNode):
        for value in node.value:
            _check_keys(value)


def _keep_dates(node: Any) -> None:
    """Leave dates as they were written: YAML 1.2 knows none, and here they are names, or stamps with an epoch."""
    if isinstance(node, MappingNode):
        for entry in node.value:
            for part in entry:
                _keep_dates(part)
    elif isinstance(node, SequenceNode):
        for value in node.value:
            _keep_dates(value)
    elif node.ctag == _DATE:
        node.ctag = _TEXT


def _lines(node: Any, key: Key) -> Iterator[tuple[Key, int]]:
    """Yield the path and the line of every key and list item."""
    if isinstance(node, MappingNode):
        entries = [(str(name.value), name, value) for name, value in node.value]
    elif isinstance(node, SequenceNode):
        entries = [(str(i), value, value) for i, value in enumerate(node.value)]
    else:
        return
    for step, place, value in entries:
        yield (*key, step), place.start_mark.line + 1
        yield from _lines(value, (*key, step))


class _LimitError(Exception):
    """A limit of this module is exceeded in a line."""

    def __init__(self, message: str, line: int) -> None:
        super().__init__(message)
        self.line = line


class _BoundedParser(Parser):  # type: ignore[misc]  # untyped library
    """Parser that stops at the first event beyond a limit; an alias counts as all that it stands for."""

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self._nodes = 0
        # Of the collections that are open: anchor and the nodes before it.
        self._open: list[tuple[str | None, int]] = []
        self._sizes: dict[str, int] = {}

    def get_event(self) -> Any:
        event = super().get_event()
        if isinstance(event, NodeEvent):
            self._enter(event)
        elif isinstance(event, CollectionEndEvent):
            anchor, before = self._open.pop()
            if anchor is not None:
                self._sizes[anchor] = self._nodes - before
        return event

    def _enter(self, event: NodeEvent) -> None:
        line = event.start_mark.line + 1
        if isinstance(event, AliasEvent):
            if event.anchor in [anchor for anchor, _ in self._open]:
                msg = f"expected no alias of what it stands in, got *{shortened(event.anchor)}"
                raise _LimitError(msg, line)
            self._nodes += self._sizes.get(event.anchor, 1)
        else:
            self._nodes += 1
            _check_tag(event, line)
        if isinstance(event, CollectionStartEvent):
            self._open.append((event.anchor, self._nodes - 1))
        elif isinstance(event, ScalarEvent):
            _check_scalar(event, line)
        if self._nodes > MOST_NODES or len(self._open) > MOST_DEPTH:
            msg = (
                f"expected at most {MOST_NODES} values, aliases counted as what they stand for, in at most "
                f"{MOST_DEPTH} levels, got more"
            )
            raise _LimitError(msg, line)


def _check_tag(event: Any, line: int) -> None:
    if event.ctag is not None:
        msg = f"expected plain YAML without tags, got {quoted(str(event.ctag))}"
        raise _LimitError(msg, line)


def _check_scalar(event: ScalarEvent, line: int) -> None:
    if len(event.value) > MOST_CHARACTERS:
        msg = f"expected texts of at most {MOST_CHARACTERS} characters, got {len(event.value)}"
        raise _LimitError(msg, line)
    if unseen := _UNSEEN.search(event.value):
        msg = f"expected texts of characters that can be seen, got U+{ord(unseen[0]):04X}"
        raise _LimitError(msg, line)
    if event.implicit[0] and len(event.value) > MOST_DIGITS and _NUMBER.fullmatch(event.value):
        msg = f"expected numbers of at most {MOST_DIGITS} characters, got {len(event.value)}"
        raise _LimitError(msg, line)
