"""Changes of a scenario as it was written, by dotted keys."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from testbed.errors import Problem, ScenarioError, quoted
from testbed.inputs.plain import plain_tree

if TYPE_CHECKING:
    from collections.abc import Mapping


def edited(source: Mapping[str, Any], changes: Mapping[str, Any], file: str = "") -> dict[str, Any]:
    """Return a copy of `source` with `changes`, one after the other.

    Parameters
    ----------
    source : mapping
        As written in a scenario.
    changes : mapping
        Dotted key, such as ``sensors.mems_gyro.range`` or ``motion.0.sine.frequency``, to what shall stand there; None
        removes the key.
    file : str, optional
        Where `source` stands, for messages.

    Raises
    ------
    ScenarioError
        If a key leads through a value, an index is outside its list, or there is nothing to remove; all at once.

    Examples
    --------
    >>> edited({"duration": "20 s", "motion": [{"static": {}}]}, {"duration": "5 s", "motion.0": {"constant": {}}})
    {'duration': '5 s', 'motion': [{'constant': {}}]}
    >>> edited({"duration": "20 s", "seed": 3}, {"seed": None})
    {'duration': '20 s'}
    """
    tree: dict[str, Any] = plain_tree(source).data
    problems = []
    for key, value in changes.items():
        try:
            _change(tree, key, value)
        except _KeyError as error:
            problems.append(Problem(str(error), key, file))
    if problems:
        raise ScenarioError(problems)
    return tree


class _KeyError(Exception):
    """A key leads nowhere."""


def _change(tree: Any, key: str, value: Any) -> None:
    *way, last = key.split(".")
    node = tree
    for step in way:
        node = _below(node, step, remove=value is None)
    place = _place(node, last)
    if value is not None:
        node[place] = plain_tree(value).data
    else:
        _require(node, place)
        del node[place]


def _below(node: Any, step: str, *, remove: bool) -> Any:
    """Return what stands at a step; a mapping that is not there yet, such as one of a preset, is begun."""
    place = _place(node, step)
    if remove:
        _require(node, place)
    elif isinstance(node, dict) and node.get(place) is None:
        node[place] = {}
    return node[place]


def _require(node: Any, place: Any) -> None:
    if isinstance(node, dict) and place not in node:
        msg = f"has no {quoted(place)} to be removed (there are {', '.join(node) or 'no keys'})"
        raise _KeyError(msg)


def _place(node: Any, step: str) -> Any:
    """Return the key or index of a step in a mapping or list."""
    if isinstance(node, dict):
        return step
    if not isinstance(node, list):
        msg = f"expected a mapping or a list to hold {quoted(step)}, got {quoted(node)}"
        raise _KeyError(msg)
    if not (step.isdecimal() and int(step) < len(node)):
        msg = (
            f"expected an index from 0 to {len(node) - 1}, got {quoted(step)}"
            if node
            else f"the list is empty at {quoted(step)}"
        )
        raise _KeyError(msg)
    return int(step)
