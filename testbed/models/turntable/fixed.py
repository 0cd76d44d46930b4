"""A table on a base that is held: it turns about the vertical as commanded, and with the Earth."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from testbed.models.turntable import plant

if TYPE_CHECKING:
    from collections.abc import Mapping

    import mujoco

    from testbed.models.motion import CommandBlock
    from testbed.models.turntable.parameters import Mounting, TurntableParameters
    from testbed.signals import FloatArray


class FixedBase:
    """What the places of the table feel when it does nothing but what is commanded.

    Parameters
    ----------
    model : mujoco.MjModel
        With a site for the table's axis and for each sensor.
    parameters : TurntableParameters
        Gravity, and the Earth's rate if it is asked for.
    mountings : mapping of str to Mounting
        Sensor name to its place on the table.
    dt : float
        Step of the commands [s].
    """

    def __init__(
        self, model: mujoco.MjModel, parameters: TurntableParameters, mountings: Mapping[str, Mounting], dt: float
    ) -> None:
        self._earth, self._gravity, self._dt = parameters.earth_rate, parameters.gravity, dt
        self._position = {name: mounting.position for name, mounting in mountings.items()}
        # The axes of each site as columns, on the table at angle 0.
        self._to_table = {name: plant.rotation(model.site(name).quat) for name in (plant.AXIS, *mountings)}

    def rate(self, name: str, command: CommandBlock) -> FloatArray:
        """Return the inertial rate about the z axis of a site, shape (n_time,) [rad/s].

        Parameters
        ----------
        name : str
            Of the site.
        command : CommandBlock
            What the table does.
        """
        return self._about(self._to_table[name][:, 2], command)

    def surroundings(self, name: str, command: CommandBlock) -> tuple[FloatArray, FloatArray]:
        """Return rates about the x and y axes of a mounting [rad/s], shape (n_time, 2), and its specific force [m/s^2],
        shape (n_time, 3); arguments as `rate`.
        """
        x, y, _ = self._position[name]
        rate, acceleration = command.rate[:-1], np.diff(command.rate) / self._dt
        force = [-acceleration * y - rate**2 * x, acceleration * x - rate**2 * y, np.full(rate.size, self._gravity)]
        to_table = self._to_table[name]
        turned: FloatArray = (to_table.T[:, :, None] * np.array(force)).sum(axis=1).T
        return np.stack([self._about(to_table[:, i], command) for i in range(2)], axis=1), turned

    def _about(self, axis: FloatArray, command: CommandBlock) -> FloatArray:
        """Return the rate along an axis of the table, which sees that about the vertical as far as it is upright."""
        rate: FloatArray = axis[2] * command.rate[:-1]
        if self._earth is not None:
            rate += self._earth.along(_turned(axis, command.angle[:-1]))
        return rate


def _turned(axis: FloatArray, angle: FloatArray) -> FloatArray:
    """Return an axis, shape (3,), turned about the vertical by angles, shape (n_time,); shape (3, n_time)."""
    x, y, z = axis
    c, s = np.cos(angle), np.sin(angle)
    return np.array([c * x - s * y, s * x + c * y, np.full_like(c, z)])
