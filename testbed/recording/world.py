"""The turntable in 3-D: bodies of the MuJoCo model, moving, and a dial that makes their tiny rotation visible."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import mujoco
import numpy as np
import rerun as rr

from testbed.pages.palette import TRUTH, rgb
from testbed.recording.bodies import draw_bodies
from testbed.recording.stream import FRAMES, INK, Batch

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from testbed.recording.stream import Recording
    from testbed.signals import FloatArray

DIAL = "/world/dial"
DIAL_RANGE = float(np.radians(40.0))
ROUND = (1.0, 1.2, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0)


class Extent(NamedTuple):
    """Where a body is at rest, in world axes [m]: a point of its axis, and radius and top of its widest part."""

    center: FloatArray
    radius: float
    top: float


class World:
    """Draws each body of the model at `/world/<body>` and a dial whose needle turns by a multiple of the table's angle.

    Parameters
    ----------
    recording : Recording
        Where it goes.
    model : mujoco.MjModel
        The bodies.
    colors : mapping of str to str
        Colour of each sensor.
    """

    def __init__(self, recording: Recording, model: mujoco.MjModel, colors: Mapping[str, str]) -> None:
        self._recording = recording
        self._bodies: dict[str, Batch] = {}
        self._angles: list[FloatArray] = []
        self._index: list[NDArray[np.int64]] = []
        self._largest, self._n_shown = 0.0, 0
        self._scale: tuple[float, float] | None = None
        self._rotor = rotor_extent(model)
        recording.static("/world", rr.ViewCoordinates.RIGHT_HAND_Z_UP)
        draw_bodies(recording, model, colors, self._rotor.radius)

    def write(
        self, index: NDArray[np.int64], poses: Mapping[str, tuple[FloatArray, FloatArray]], angle: FloatArray
    ) -> None:
        """Add the poses at the base samples `index`.

        Parameters
        ----------
        index : ndarray of int, shape (n_pose,)
            Base samples.
        poses : mapping of str to (ndarray, ndarray), shapes (n_pose, 3) and (n_pose, 4)
            Position [m] and quaternion (w, x, y, z) [-] of each body in the world.
        angle : ndarray, shape (n_pose,)
            Angle of the table [rad].
        """
        for body, (position, quaternion) in poses.items():
            if body not in self._bodies:
                self._bodies[body] = self._recording.batch(partial(self._send, body), FRAMES)
            self._bodies[body].add(index, position, quaternion)
        self._index.append(index)
        # A copy: a view would keep the whole block alive.
        self._angles.append(angle.copy())
        self._largest = max(self._largest, float(np.abs(angle).max(initial=0.0)))
        if self._recording.live:
            self._turn_needle()

    def _send(self, body: str, index: NDArray[np.int64], position: FloatArray, quaternion: FloatArray) -> None:
        # MuJoCo puts the scalar part first, Rerun last.
        columns = rr.Transform3D.columns(translation=position, quaternion=quaternion[:, [1, 2, 3, 0]])
        self._recording.columns(f"/world/{body}", index, columns)

    def finish(self) -> None:
        """Send what is held back and draw the dial, whose magnification is known only when the largest angle is."""
        for batch in self._bodies.values():
            batch.flush()
        self._turn_needle()

    def _turn_needle(self) -> None:
        """Add what is new of the needle; where the dial needs another scale, draw it and all of the needle in that."""
        scale = dial_scale(self._largest)
        if scale != self._scale:
            self._scale, self._n_shown = scale, 0
            _draw_dial(self._recording, self._rotor, *scale)
        if self._n_shown == len(self._index):
            return
        index, angle = np.concatenate(self._index[self._n_shown :]), np.concatenate(self._angles[self._n_shown :])
        self._n_shown = len(self._index)
        half = scale[1] * angle / 2
        turned = np.column_stack((np.zeros((angle.size, 2)), np.sin(half), np.cos(half)))
        self._recording.columns(f"{DIAL}/needle", index, rr.Transform3D.columns(quaternion=turned))


def nice_ceiling(value: float) -> float:
    """Return the smallest round number (one of `ROUND` times a power of ten) not below `value` (any unit, > 0)."""
    decade = 10.0 ** np.floor(np.log10(value))
    return float(next(decade * m for m in ROUND if decade * m >= value * (1 - 1e-12)))


def dial_scale(largest: float) -> tuple[float, float]:
    """Return the angle at the last tick of the dial [rad] and the factor [-] by which it is magnified there.

    Parameters
    ----------
    largest : float
        Largest angle to be shown [rad]; at or above the range of the dial nothing is magnified.
    """
    full = nice_ceiling(max(largest, 1e-6))
    if full >= DIAL_RANGE:
        return DIAL_RANGE, 1.0
    # Rounded down, for the needle must not leave the dial.
    decade = 10.0 ** np.floor(np.log10(DIAL_RANGE / full))
    return full, float(max(m * decade for m in (1.0, 2.0, 5.0) if m * decade * full <= DIAL_RANGE))


def rotor_extent(model: mujoco.MjModel) -> Extent:
    """Return the extent of body `rotor`, or of the last body of a model without one."""
    names = [model.body(body).name for body in range(model.nbody)]
    body = names.index("rotor") if "rotor" in names else model.nbody - 1
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    center = data.xpos[body].copy()
    radius = top = 0.0
    for geom in np.flatnonzero(model.geom_bodyid == body):
        rotation = data.geom_xmat[geom].reshape(3, 3)
        middle = data.geom_xpos[geom] + rotation @ model.geom_aabb[geom, :3] - center
        half = np.abs(rotation) @ model.geom_aabb[geom, 3:]
        reach = float((np.abs(middle) + half)[:2].max())
        if reach > radius:
            radius, top = reach, float(middle[2] + half[2])
    return Extent(center, radius or 0.1, float(center[2]) + top)


def _draw_dial(recording: Recording, rotor: Extent, full: float, factor: float) -> None:
    radius = 1.25 * rotor.radius
    origin = [rotor.center[0], rotor.center[1], rotor.top + 0.03 * rotor.radius]
    recording.static(DIAL, rr.Transform3D(translation=origin))
    arc = np.linspace(-full, full, 65) * factor
    ticks = np.linspace(-full, full, 5)
    rim = [_on_rim(arc, radius)] + [_on_rim(np.full(2, a * factor), radius * np.array([1.0, 1.05])) for a in ticks]
    recording.static(f"{DIAL}/scale", rr.LineStrips3D(rim, colors=rgb(INK), radii=0.006 * rotor.radius))
    labels = [angle_text(-full), angle_text(full), f"table angle × {factor:.4g}"]
    points = _on_rim(np.array([-full, full, 0.0]) * factor, radius * np.array([1.18, 1.18, 1.25]))
    recording.static(
        f"{DIAL}/labels", rr.Points3D(points, labels=labels, colors=rgb(INK), radii=1e-4 * radius, show_labels=True)
    )
    needle = rr.Arrows3D(
        origins=[[0.25 * rotor.radius, 0, 0]],
        vectors=[[0.99 * radius - 0.25 * rotor.radius, 0, 0]],
        colors=rgb(TRUTH),
        radii=0.014 * rotor.radius,
    )
    recording.static(f"{DIAL}/needle", needle)


def _on_rim(angle: FloatArray, radius: float | FloatArray) -> FloatArray:
    points: FloatArray = np.column_stack((radius * np.cos(angle), radius * np.sin(angle), np.zeros(angle.size)))
    return points


def angle_text(angle: float) -> str:
    """Return an angle [rad] with a sign and the unit that suits it: deg, mrad or urad."""
    size = abs(angle)
    if size == 0.0:
        return "0"
    if size > 0.1:
        return f"{np.degrees(angle):+.3g}°"
    return f"{angle * 1e3:+.3g} mrad" if size >= 0.99e-4 else f"{angle * 1e6:+.3g} µrad"
