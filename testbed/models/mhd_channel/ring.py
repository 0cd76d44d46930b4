"""The channel bent to a ring: electromotive force, resistance and thermal noise between its electrodes."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from testbed.parts import Part
from testbed.units import Length

if TYPE_CHECKING:
    from testbed.models.mhd_channel.channel import MhdChannel

BOLTZMANN = 1.380649e-23


class ChannelRing(Part):
    r"""A ring of fluid around the sensing axis; the field's direction decides between which walls the current flows.

    ================ ============================== ============== =============================
    closure          current                        EMF per rate   resistance
    ================ ============================== ============== =============================
    `local`,         along the height l, radial B   B l r          l / (2 pi r W sigma)
    `radial_field`
    `axial_field`    across the width W, axial B    B W r          W / (2 pi r l sigma)
    ================ ============================== ============== =============================

    Parameters
    ----------
    width : float
        W, inner to outer wall [m].
    radius : float
        r, mean radius [m].
    """

    width: Length
    radius: Length

    def emf_per_rate(self, channel: MhdChannel) -> float:
        """Return the open-circuit voltage over the slip's rate [V s/rad]; 0 without a field."""
        return channel.field * self._current_path(channel)[0] * self.radius

    def resistance(self, channel: MhdChannel) -> float:
        """Return the resistance of the fluid between the electrodes, R_i [ohm]."""
        along, across = self._current_path(channel)
        return along / (2.0 * math.pi * self.radius * across * channel.fluid.conductivity)

    def voltage_noise(self, channel: MhdChannel, temperature: float) -> float:
        r"""Return the two-sided root density of the resistance's Johnson noise, :math:`\sqrt{2 k T R_i}` [V/sqrt(Hz)].

        Parameters
        ----------
        channel : MhdChannel
            As it is at `temperature`.
        temperature : float
            T [K].

        Returns
        -------
        float
            Root density; data sheets quote the one-sided one, sqrt(2) times as large [V/sqrt(Hz)].
        """
        return math.sqrt(2.0 * BOLTZMANN * temperature * self.resistance(channel))

    def _current_path(self, channel: MhdChannel) -> tuple[float, float]:
        """Return the length of the current's path and the other side of the cross-section [m]."""
        return (self.width, channel.height) if channel.closure == "axial_field" else (channel.height, self.width)
