"""Temperature at the border and the law by which a property follows it."""

from __future__ import annotations

import math
import re
from typing import Annotated, Any

from testbed.units import Quantity

ABSOLUTE_ZERO_C = 273.15
REFERENCE = 20.0 + ABSOLUTE_ZERO_C

_CELSIUS = re.compile(r"\s*(\S+?)\s*(?:degC|°C)\s*")


class TemperatureQuantity(Quantity):
    """A temperature: kelvin inside; `20 degC` or `293.15 K` at the border.

    Degrees Celsius have an offset, so they are no factor times a kelvin, and none of the products of units.
    """

    def _read(self, value: Any, *, border: bool) -> float:
        celsius = _CELSIUS.fullmatch(value) if isinstance(value, str) else None
        if celsius is None:
            return super()._read(value, border=border)
        return super()._read(f"{celsius[1]} K", border=border) + ABSOLUTE_ZERO_C


Temperature = Annotated[float, TemperatureQuantity("K", "20 degC", above=0.0)]
TemperatureCoefficient = Annotated[float, Quantity("1/K", "-1.1e-3 1/K")]


def drift(coefficient: float, temperature: float) -> float:
    r"""Return by what a property has changed since 20 degC, :math:`e^{c (T - T_0)}`: never negative, linear at first.

    Parameters
    ----------
    coefficient : float
        c, relative change per kelvin at 20 degC [1/K].
    temperature : float
        T [K].

    Returns
    -------
    float
        Factor on the property at 20 degC; exactly 1 there [-].
    """
    return math.exp(coefficient * (temperature - REFERENCE))
