"""A mapping built in Python, as a YAML file would have given it."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

import numpy as np

from testbed.errors import ScenarioError
from testbed.inputs.tree import MOST_DEPTH, Tree


def plain_tree(data: Any) -> Tree:
    """Return the content as a document without lines: plain mappings, lists and scalars, none shared with `data`.

    Parameters
    ----------
    data : Any
        Mappings, sequences, arrays, NumPy scalars, paths and what YAML has; anything else is handed on, for a message.

    Raises
    ------
    ScenarioError
        If it is nested deeper than a file may be.
    """
    return Tree(_plain(data, MOST_DEPTH), {})


def _plain(data: Any, depth: int) -> Any:
    if depth < 0:
        msg = f"expected at most {MOST_DEPTH} levels, got more"
        raise ScenarioError(msg)
    if isinstance(data, Mapping):
        return {str(key): _plain(value, depth - 1) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return [_plain(value, depth - 1) for value in data]
    if isinstance(data, np.ndarray | np.generic):
        return data.tolist()
    return os.fspath(data) if isinstance(data, os.PathLike) else data
