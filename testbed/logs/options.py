"""Quantities that options give, and the errors that name the options."""

from __future__ import annotations

import math
import re
from contextlib import contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING

from testbed import units
from testbed.errors import Problem, ScenarioError, shortened

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

# Where an option of a single column, or of a text, stands in a map.
_IN_A_MAP = {"--time": "time.column", "--time-unit": "time.unit", "--rate": "time.rate"} | {
    f"--{name.replace('_', '-')}": name
    for name in ("unit", "scale", "kind", "missing", "only", "separator", "decimal", "encoding", "skip", "drop_faulty")
}
_OPTION = re.compile("|".join(rf"{name}(?![\w-])" for name in _IN_A_MAP))


def refusal(path: Path | str, message: str, key: str = "", line: int | None = None) -> ScenarioError:
    """Return the error that says what is wrong with `path`, at which option and line."""
    return ScenarioError([Problem(message, key=key, file=str(path), line=line)])


@contextmanager
def saying_keys() -> Iterator[None]:
    """Let errors about a recording name the keys of its map, for who has no options of a single column."""
    try:
        yield
    except ScenarioError as error:
        raise ScenarioError(
            [replace(one, message=in_a_map(one.message), key=in_a_map(one.key)) for one in error.problems]
        ) from error


def in_a_map(text: str) -> str:
    """Return what is said of a recording with the keys of its map in place of the options of a single column."""
    return _OPTION.sub(lambda found: _IN_A_MAP[found.group()], text)


def quantity(text: str, si: str, example: str, key: str) -> float:
    """Return the quantity above zero that `text` gives, with its unit or as a number in the unit `si`.

    Parameters
    ----------
    text : str
        Such as ``100`` or ``2 kHz``.
    si, example, key : str
        SI unit of the result, a good text, and the option that gave it, for the message.

    Raises
    ------
    ScenarioError
        If it is none above zero.
    """
    try:
        value = float(text) if _is_number(text) else units.parse(text, si, example=example)
    except ValueError as error:
        raise ScenarioError([Problem(str(error), key=key)]) from error
    if not (value > 0.0 and math.isfinite(value)):
        raise ScenarioError([Problem(f"expected more than 0 {si}, got {shortened(text)}", key=key)])
    return value


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
