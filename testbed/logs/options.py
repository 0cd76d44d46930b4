"""Quantities that options give, and the errors that name the options."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from testbed import units
from testbed.errors import Problem, ScenarioError, shortened

if TYPE_CHECKING:
    from pathlib import Path


def refusal(path: Path | str, message: str, key: str = "", line: int | None = None) -> ScenarioError:
    """Return the error that says what is wrong with `path`, at which option and line."""
    return ScenarioError([Problem(message, key=key, file=str(path), line=line)])


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
