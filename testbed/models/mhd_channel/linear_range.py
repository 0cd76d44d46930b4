"""Where the linear channel holds: three numbers of a motion that say whether its secondary flow can be left out."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from testbed.models.mhd_channel.channel import MhdChannel

# Any one of them is enough for a sine to come out within 0.1 % of the linear channel's reading.
LARGEST_STROKE = 0.1
LEAST_ELSASSER = 10.0
LEAST_EKMAN = 1.0


class LinearRange(NamedTuple):
    r"""Three numbers of a motion, each the ratio of what moves the fluid linearly to its secondary flow.

    .. math:: \theta, \quad \Lambda = \delta / W, \quad E = \nu / (W l^2)

    A short stroke leaves the secondary flow no time, braking or friction holds it down.

    Parameters
    ----------
    stroke : float
        theta, half of the angle between the walls' extreme positions [rad].
    elsasser : float
        Lambda; delta is the braking of slip at every height, which a radial field whose current is uniform in h
        does not do [-].
    ekman : float
        E [-].
    """

    stroke: float
    elsasser: float
    ekman: float

    @property
    def holds(self) -> bool:
        """Whether the linear channel can be taken for the whole one."""
        return self.stroke <= LARGEST_STROKE or self.elsasser >= LEAST_ELSASSER or self.ekman >= LEAST_EKMAN

    def words(self) -> str:
        """Return the numbers, and what would be enough."""
        return (
            f"stroke {math.degrees(self.stroke):.3g} deg (at most {math.degrees(LARGEST_STROKE):.2g}), "
            f"Elsasser number {self.elsasser:.2g} (at least {LEAST_ELSASSER:g}) or "
            f"Ekman number {self.ekman:.2g} (at least {LEAST_EKMAN:g})"
        )


def linear_range(channel: MhdChannel, rate: float, stroke: float) -> LinearRange:
    """Return the three numbers of a motion.

    Parameters
    ----------
    channel : MhdChannel
        As it is at its temperature.
    rate : float
        Largest rate W of the walls [rad/s].
    stroke : float
        Half of the angle between their extreme positions [rad].
    """
    local = 0.0 if channel.closure == "radial_field" else channel.braking_rate
    friction = channel.fluid.kinematic_viscosity / channel.height**2
    return LinearRange(stroke, local / rate if rate else math.inf, friction / rate if rate else math.inf)
