"""The Earth's rotation, as a sensor that is fixed to a laboratory feels it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import numpy as np

from testbed.parts import Part
from testbed.units import Angle, Quantity

if TYPE_CHECKING:
    from testbed.signals import FloatArray

# WGS 84 (NIMA TR8350.2), Table 3.1 [rad/s].
SPEED = 7.292115e-5

Latitude = Annotated[float, Quantity("rad", "48 deg", at_least=-np.pi / 2, at_most=np.pi / 2)]


class EarthRate(Part):
    """Where on the Earth the table stands; asks for the Earth's rotation in the truth.

    Parameters
    ----------
    latitude : float
        Geodetic latitude [rad], north positive.
    azimuth : float, optional
        Compass bearing of the table's x axis [rad], from north over east.
    """

    latitude: Latitude
    azimuth: Angle = 0.0

    @property
    def vector(self) -> tuple[float, float, float]:
        """Return the Earth's rate in the laboratory's x, y, z (up) [rad/s]."""
        level, up = SPEED * np.cos(self.latitude), SPEED * np.sin(self.latitude)
        return float(level * np.cos(self.azimuth)), float(level * np.sin(self.azimuth)), float(up)

    def along(self, axis: FloatArray) -> FloatArray:
        """Return the Earth's rate along an axis of the laboratory, shape (n_time,) [rad/s].

        Parameters
        ----------
        axis : ndarray, shape (3, n_time)
            Unit vectors [-].
        """
        x, y, z = self.vector
        # No matrix product: its order of additions depends on the length of the block.
        rate: FloatArray = axis[0] * x + axis[1] * y + axis[2] * z
        return rate
