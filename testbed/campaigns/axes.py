"""What a varied key takes: a list, points between two ends, or points that are drawn."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING, Annotated, Any, Self

import numpy as np
from pydantic import Field, model_validator

from testbed.errors import quoted
from testbed.parts import Part

if TYPE_CHECKING:
    from collections.abc import Sequence

Ends = Annotated[tuple[str | int | float, str | int | float], Field()]
_NUMBER = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(.*)")
_DIGITS = 12
_KINDS = ("list", "linear", "log", "random", "latin_hypercube")


class Axis(Part):
    """Values of one key: exactly one of the first five.

    Parameters
    ----------
    list : sequence
        The values themselves, as a scenario has them: with units, or whole mappings; None removes the key.
    linear, log : tuple of two
        Ends, with their unit, of `points` values at equal distances or ratios.
    random, latin_hypercube : tuple of two
        Ends of `points` values that are drawn evenly between; all such axes are drawn together, and in a hypercube
        each value stands alone in its part of the axis.
    points : int, optional
        How many.
    """

    list: tuple[Any, ...] | None = Field(default=None, min_length=1, max_length=10_000)
    linear: Ends | None = None
    log: Ends | None = None
    random: Ends | None = None
    latin_hypercube: Ends | None = None
    points: Annotated[int, Field(ge=1, le=10_000, strict=True)] | None = None

    @model_validator(mode="before")
    @classmethod
    def _bare_list(cls, data: Any) -> Any:
        return {"list": data} if isinstance(data, list | tuple) else data

    @model_validator(mode="after")
    def _one_kind(self) -> Self:
        given = [name for name in _KINDS if getattr(self, name) is not None]
        if len(given) != 1:
            msg = f"expected one of {', '.join(_KINDS)}, got {', '.join(given) or 'none'}"
            raise ValueError(msg)
        if (self.points is None) != (given == ["list"]):
            needs = "no points beside a list" if given == ["list"] else f"points beside {given[0]}, such as points: 13"
            msg = f"expected {needs}"
            raise ValueError(msg)
        return self

    @property
    def drawn(self) -> bool:
        """Whether its values are drawn."""
        return self.random is not None or self.latin_hypercube is not None


def values_of(axis: Axis) -> list[Any]:
    """Return the values of an axis that is not drawn, as a scenario has them.

    Parameters
    ----------
    axis : Axis
        A list, or two ends.

    Raises
    ------
    ValueError
        If an end is no number with a unit, the units differ, or an end of a logarithmic axis is not above zero.
    """
    if axis.list is not None:
        return list(axis.list)
    ends = axis.linear or axis.log
    assert ends is not None
    assert axis.points is not None
    low, high, unit = _span(ends)
    if axis.linear is not None:
        return [_written(x, unit, ends) for x in np.linspace(low, high, axis.points)]
    if not (low > 0.0 and high > 0.0):
        msg = f"expected ends above zero on a logarithmic axis, got {quoted(ends[0])} and {quoted(ends[1])}"
        raise ValueError(msg)
    return [_written(x, unit, ends) for x in np.geomspace(low, high, axis.points)]


def jointly_drawn(axes: dict[str, Axis], seed: int) -> list[dict[str, Any]]:
    """Return the points that are drawn over all axes together; one point without axes if there are none.

    Parameters
    ----------
    axes : dict of str to Axis
        By key, each drawn.
    seed : int
        Of the draws.

    Raises
    ------
    ValueError
        As `values_of`, or if they do not have the same number of points.
    """
    if not axes:
        return [{}]
    counts = {key: axis.points for key, axis in axes.items()}
    n = next(iter(counts.values()))
    if len(set(counts.values())) != 1 or n is None:
        msg = f"expected the same points on all drawn axes, since they are drawn together, got {quoted(counts)}"
        raise ValueError(msg)
    columns = {key: _drawn(key, axis, n, seed) for key, axis in axes.items()}
    return [{key: column[k] for key, column in columns.items()} for k in range(n)]


def as_written(values: Sequence[Any]) -> tuple[list[float], str] | None:
    """Return the numbers of an axis with their unit, None unless all are numbers in one unit.

    Parameters
    ----------
    values : sequence
        What the cases of a study have at a key.
    """
    found = [_NUMBER.fullmatch(str(value)) for value in values if not isinstance(value, bool)]
    numbers = [(float(match[1]), match[2].strip()) for match in found if match is not None]
    units = {unit for _, unit in numbers}
    if len(numbers) < len(values) or len(units) != 1:
        return None
    return [number for number, _ in numbers], units.pop()


def _drawn(key: str, axis: Axis, n: int, seed: int) -> list[Any]:
    from scipy.stats import qmc

    ends = axis.random or axis.latin_hypercube
    assert ends is not None
    # A stream for each key, so that another axis does not move the values of this one.
    rng = np.random.default_rng([seed, *key.encode()])
    share = rng.random(n) if axis.random is not None else qmc.LatinHypercube(1, rng=rng).random(n)[:, 0]
    low, high, unit = _span(ends)
    return [_written(x, unit, ends) for x in low + share * (high - low)]


def _span(ends: tuple[Any, Any]) -> tuple[float, float, str]:
    """Return both ends and their unit."""
    found = []
    for end in ends:
        match = _NUMBER.fullmatch(str(end))
        if isinstance(end, bool) or match is None or not math.isfinite(float(match[1])):
            msg = f"expected two numbers with their unit, such as ['0.5 Hz', '500 Hz'], got {quoted(end)}"
            raise ValueError(msg)
        found.append((float(match[1]), match[2].strip()))
    (low, unit), (high, other) = found
    if unit != other:
        msg = f"expected both ends in the same unit, got {quoted(ends[0])} and {quoted(ends[1])}"
        raise ValueError(msg)
    return low, high, unit


def _written(value: float, unit: str, ends: tuple[Any, Any]) -> Any:
    """Return a value as a scenario has it: with its unit, or a whole number where both ends are and it is."""
    if unit:
        return f"{value:.{_DIGITS}g} {unit}"
    whole = all(isinstance(end, int) for end in ends) and float(value).is_integer()
    return int(value) if whole else float(f"{value:.{_DIGITS}g}")
