"""How a user says what a file does not: options of the command line, and the errors that name them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from testbed import units
from testbed.errors import Problem, ScenarioError

if TYPE_CHECKING:
    from pathlib import Path


@dataclass(frozen=True)
class TextOptions:
    """What is known of a text file beforehand; None: found in the file.

    Parameters
    ----------
    separator : str, optional
        ``,``, ``;``, ``|``, ``tab`` or ``blank``.
    decimal : str, optional
        ``.`` or ``,``.
    encoding : str, optional
        Such as ``utf-8``, ``utf-16``, ``cp1252``.
    skip : int, optional
        Lines to leave out before the header, or before the first row where there is none.
    """

    separator: str | None = None
    decimal: str | None = None
    encoding: str | None = None
    skip: int | None = None


def refusal(path: Path | str, message: str, key: str = "", line: int | None = None) -> ScenarioError:
    """Return the error that says what is wrong with `path`, at which option and line."""
    return ScenarioError([Problem(message, key=key, file=str(path), line=line)])


def frequency(text: str, key: str = "--rate") -> float:
    """Return the frequency [Hz] that `text` gives, with its unit or as a number in hertz.

    Raises
    ------
    ScenarioError
        If it is none above zero.
    """
    try:
        value = float(text) if _is_number(text) else units.parse(text, "Hz", example="100 Hz")
    except ValueError as error:
        raise ScenarioError([Problem(str(error), key=key)]) from error
    if not (value > 0.0 and math.isfinite(value)):
        raise ScenarioError([Problem(f"expected more than 0 Hz, got {text}", key=key)])
    return value


def unit_factor(unit: str, si: str, example: str, key: str) -> float:
    """Return what one `unit` is in the unit `si` [-].

    Parameters
    ----------
    unit, si : str
        Such as ``deg/s`` and ``rad/s``.
    example, key : str
        A good unit, and the option that gave it, for the message.

    Raises
    ------
    ScenarioError
        If it is no unit of that kind.
    """
    try:
        return units.parse(f"1 {unit}", si, example=f"1 {example}")
    except ValueError as error:
        raise ScenarioError([Problem(str(error), key=key)]) from error


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
