"""The law by which a property of magnet or fluid follows temperature."""

from __future__ import annotations

import math

REFERENCE = 20.0 + 273.15  # K, of the values that data tables give


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
