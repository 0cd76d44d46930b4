"""The velocity profile of a fluid channel: the curve u(h) as it is now, and its history at a few heights."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import rerun as rr

from testbed.pages.palette import mix, rgb
from testbed.recording.stream import FRAMES, INK
from testbed.recording.world import nice_ceiling

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from testbed.recording.stream import Recording
    from testbed.signals import FloatArray
    from testbed.units import RateUnit

# Drawing units: Rerun's 2-D view has equal axes, y pointing down, so the plot is a box into which the curve is scaled.
WIDTH, HEIGHT = 160.0, 90.0
# What a table at rest leaves is arithmetic and no profile; its scale would not fit a single-precision number.
SMALLEST = 1e-14
FRACTIONS = (1 / 32, 1 / 8, 1 / 2)  # of the channel height; the flow is symmetric for a rotating wall


class Channel:
    """Draws the profile of one sensor under `/sensors/<name>/channel`.

    `profile` is a line of points (u, h [m]), exact but for float32, put into the plot by one static transform;
    `velocity` has the same u as scalars at a few heights.

    Parameters
    ----------
    recording : Recording
        Where it goes.
    sensor : str
        Name of the sensor.
    heights : ndarray, shape (n_height,)
        Heights of the nodes above the lower wall [m].
    color : str
        Of the sensor.
    unit : str
        Of u.
    """

    def __init__(self, recording: Recording, sensor: str, heights: FloatArray, color: str, unit: RateUnit) -> None:
        self.entity = f"/sensors/{sensor}/channel"
        self._recording, self._heights, self._color, self._unit = recording, heights, color, unit
        self._largest = self._full = 0.0
        self._batch = recording.batch(self._send, FRAMES)
        wanted = np.array(FRACTIONS) * heights.max()
        self.probes = np.abs(heights[:, np.newaxis] - wanted).argmin(axis=0)
        names = [f"u(h = {heights[node] * 1e3:.2f} mm)" for node in self.probes]
        shades = [mix(color, "#e2553d", share) for share in np.linspace(0, 1, len(names))]
        recording.lines(f"{self.entity}/velocity", names, shades)

    def write(self, index: NDArray[np.int64], profiles: FloatArray) -> None:
        """Add profiles at the base samples `index`.

        Parameters
        ----------
        index : ndarray of int, shape (n_pose,)
            Base samples.
        profiles : ndarray, shape (n_pose, n_height)
            Velocity of the fluid relative to the wall, per radius [the unit].
        """
        self._largest = max(self._largest, float(np.abs(profiles).max(initial=0.0)))
        self._batch.add(index, profiles)
        if self._recording.live:
            self._draw_axes()

    def _send(self, index: NDArray[np.int64], profiles: FloatArray) -> None:
        points = np.stack(np.broadcast_arrays(profiles, self._heights), axis=-1).astype(np.float32)
        self._recording.columns(f"{self.entity}/profile", index, rr.LineStrips2D.columns(strips=points))
        velocity = np.ascontiguousarray(profiles[:, self.probes])
        self._recording.columns(f"{self.entity}/velocity", index, rr.Scalars.columns(scalars=velocity))

    def finish(self) -> None:
        """Send what is held back and draw the axes, whose range is known only now."""
        self._batch.flush()
        self._draw_axes()

    def _draw_axes(self) -> None:
        """Draw the axes for the largest velocity so far, if they are not those that are there."""
        full = nice_ceiling(self._largest if self._largest > SMALLEST else 1.0)
        if full == self._full:
            return
        self._full = full
        top = float(self._heights.max())
        to_box = rr.Transform3D(scale=[WIDTH / 2 / full, -HEIGHT / top, 1.0])
        style = rr.LineStrips2D.from_fields(
            colors=[rgb(self._color)], radii=[rr.Radius.ui_points(1.5)], draw_order=20.0
        )
        self._recording.static(f"{self.entity}/profile", to_box, style)
        right, up = WIDTH / 2, -HEIGHT
        frame = [[[-right, 0], [right, 0]], [[-right, up], [right, up]], [[0, 0], [0, up]], [[-right, 0], [-right, up]]]
        walls = rr.LineStrips2D(frame, colors=rgb(INK), radii=[rr.Radius.ui_points(r) for r in (2.0, 2.0, 0.5, 0.5)])
        self._recording.static(f"{self.entity}/axes", walls)
        texts = [(x * right, 9.0, f"{x * full:g}") for x in (-1.0, -0.5, 0.0, 0.5, 1.0)]
        texts += [(-right - 13.0, y * up, f"{y * top * 1e3:g}") for y in (0.0, 0.5, 1.0)]
        texts += [
            (0.0, 27.0, f"fluid minus wall, per radius [{self._unit}]"),
            (-right + 12.0, up - 16.0, "height above lower wall [mm]"),
        ]
        self._recording.texts(f"{self.entity}/labels", texts)
