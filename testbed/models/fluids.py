"""Liquid metals of MHD channels, by name or by their properties."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BeforeValidator

from testbed.errors import UnknownNameError
from testbed.parts import Part
from testbed.units import Conductivity, MassDensity, Viscosity


class Fluid(Part):
    """Properties of a conducting liquid at working temperature.

    Parameters
    ----------
    density : float
        rho [kg/m^3].
    viscosity : float
        Dynamic viscosity mu [Pa s].
    conductivity : float
        Electrical conductivity sigma [S/m].
    """

    density: MassDensity
    viscosity: Viscosity
    conductivity: Conductivity

    @property
    def kinematic_viscosity(self) -> float:
        """Kinematic viscosity nu = mu/rho [m^2/s]."""
        return self.viscosity / self.density


FLUIDS = {
    # 20 C.
    "mercury": Fluid(density=13534.0, viscosity=1.526e-3, conductivity=1.04e6),
    "galinstan": Fluid(density=6440.0, viscosity=2.4e-3, conductivity=3.46e6),
    # Eutectic Na22K78, 20 C: Mueller and Buehler, Magnetofluiddynamics in Channels and Containers, Springer 2001
    # (nu 1.05e-6 m^2/s). Only the density is confirmed by a second source (866 kg/m^3 at 21 C).
    "nak": Fluid(density=868.0, viscosity=9.11e-4, conductivity=2.63e6),
}


def known_fluid(value: Any) -> Any:
    """Replace the name of a fluid, in any case, by its properties; pass anything else on.

    Raises
    ------
    UnknownNameError
        If the name is unknown; lists the known ones.
    """
    if not isinstance(value, str):
        return value
    if value.lower() not in FLUIDS:
        kind = "fluid"
        raise UnknownNameError(kind, value, FLUIDS)
    return FLUIDS[value.lower()]


NamedFluid = Annotated[Fluid, BeforeValidator(known_fluid, json_schema_input_type=Fluid | str)]
