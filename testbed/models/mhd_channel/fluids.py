"""Liquid metals of MHD channels, by name or by their properties."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BeforeValidator

from testbed.errors import UnknownNameError
from testbed.models.mhd_channel.thermal_drift import drift
from testbed.parts import Part
from testbed.units import Conductivity, MassDensity, RatioPerKelvin, Viscosity


class Fluid(Part):
    """Properties of a conducting liquid at 20 degC, and by what they change with temperature.

    Parameters
    ----------
    density : float
        rho [kg/m^3].
    viscosity : float
        Dynamic viscosity mu [Pa s].
    conductivity : float
        Electrical conductivity sigma [S/m].
    density_drift, viscosity_drift, conductivity_drift : float
        Relative change of each per kelvin at 20 degC [1/K].
    """

    density: MassDensity
    viscosity: Viscosity
    conductivity: Conductivity
    density_drift: RatioPerKelvin = 0.0
    viscosity_drift: RatioPerKelvin = 0.0
    conductivity_drift: RatioPerKelvin = 0.0

    @property
    def kinematic_viscosity(self) -> float:
        """Kinematic viscosity nu = mu/rho [m^2/s]."""
        return self.viscosity / self.density

    def at(self, temperature: float) -> Fluid:
        """Return the fluid as it is at `temperature` [K], a `Fluid` of constant properties."""
        return Fluid(
            density=self.density * drift(self.density_drift, temperature),
            viscosity=self.viscosity * drift(self.viscosity_drift, temperature),
            conductivity=self.conductivity * drift(self.conductivity_drift, temperature),
        )


FLUIDS = {
    "mercury": Fluid(
        density=13534.0,
        viscosity=1.526e-3,
        conductivity=1.04e6,
        # Specific volume of 10 and 30 C in the CRC Handbook: 0.0736877 and 0.0739552 ml/g.
        density_drift=-1.81e-4,
        # From 1.554 mPa s at 20 C to 1.526 mPa s at 25 C, handbook values from memory: not confirmed.
        viscosity_drift=-3.6e-3,
        # Temperature coefficient of resistance of the usual tables: not confirmed.
        conductivity_drift=-8.9e-4,
    ),
    # Drifts: slopes at 20 C of the correlations of Plevachuk et al., J. Chem. Eng. Data 59 (2014) 757, from memory
    # (6580 - 0.776 T kg/m^3; activation energy 3.9 kJ/mol); conductivity assumed. None confirmed.
    "galinstan": Fluid(
        density=6440.0,
        viscosity=2.4e-3,
        conductivity=3.46e6,
        density_drift=-1.2e-4,
        viscosity_drift=-5.5e-3,
        conductivity_drift=-1.0e-3,
    ),
    # Eutectic Na22K78, 20 C: Mueller and Buehler, Magnetofluiddynamics in Channels and Containers, Springer 2001
    # (nu 1.05e-6 m^2/s). Only the density is confirmed by a second source (866 kg/m^3 at 21 C).
    # Drifts: density from 866 kg/m^3 at 20 C to 749 at 550 C (public tables); the other two assumed.
    "nak": Fluid(
        density=868.0,
        viscosity=9.11e-4,
        conductivity=2.63e6,
        density_drift=-2.7e-4,
        viscosity_drift=-7.0e-3,
        conductivity_drift=-2.0e-3,
    ),
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
