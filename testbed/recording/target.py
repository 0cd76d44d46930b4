"""The spot of the beam on a target, behind each filter: where it stands off, as the mirror and the tracker leave it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import rerun as rr

from testbed.pages.palette import rgb
from testbed.recording.stream import FRAMES, INK
from testbed.recording.world import nice_ceiling

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from testbed.recording.stream import Recording
    from testbed.signals import FloatArray

ENTITY = "/pointing/target"
# Half the width of the target in the view's units; the residual is scaled into it.
HALF = 100.0
_URAD = 1e6
# What arithmetic alone leaves is no spot [rad].
_SMALLEST = 1e-14


class Target:
    """Draws the spots under `/pointing/target/<filter>`: x is the residual [urad], one filter above the other.

    Parameters
    ----------
    recording : Recording
        Where it goes.
    colors : mapping of str to str
        Of each filter, in the order from above.
    """

    def __init__(self, recording: Recording, colors: dict[str, str]) -> None:
        self._recording, self._colors = recording, colors
        self._largest = self._full = 0.0
        self._batches = {name: recording.batch(self._sender(name), FRAMES) for name in colors}

    def write(self, name: str, index: NDArray[np.int64], residual: FloatArray) -> None:
        """Add the spot of a filter at the base samples `index`.

        Parameters
        ----------
        name : str
            The filter.
        index : ndarray of int, shape (n_pose,)
            Base samples.
        residual : ndarray, shape (n_pose,)
            Pointing error [rad].
        """
        self._largest = max(self._largest, float(np.max(np.abs(residual), initial=0.0)))
        self._batches[name].add(index, residual)
        if self._recording.live:
            self._draw_axes()

    def _sender(self, name: str) -> Callable[..., None]:
        def send(index: NDArray[np.int64], residual: FloatArray) -> None:
            points = np.stack([_URAD * residual, np.zeros(residual.size)], axis=1).astype(np.float32)
            self._recording.columns(f"{ENTITY}/{name}", index, rr.Points2D.columns(positions=points))

        return send

    def finish(self) -> None:
        """Send what is held back and draw the target, whose scale is known only now."""
        for batch in self._batches.values():
            batch.flush()
        self._draw_axes()

    def _draw_axes(self) -> None:
        """Draw the target for the largest error so far, if it is not the one that is there."""
        full = _URAD * nice_ceiling(self._largest if self._largest > _SMALLEST else 1e-6)
        if full == self._full:
            return
        self._full = full
        row = 2.0 * HALF / max(len(self._colors), 1)
        turn = np.linspace(0.0, 2.0 * np.pi, 121)
        circle = np.stack([np.cos(turn), np.sin(turn)], axis=1)
        strips, labels = [], []
        for i, (name, color) in enumerate(self._colors.items()):
            height = -HALF + (i + 0.5) * row
            to_row = rr.Transform3D(translation=[0.0, height, 0.0], scale=[HALF / full, 1.0, 1.0])
            style = rr.Points2D.from_fields(colors=[rgb(color)], radii=[rr.Radius.ui_points(7.0)], draw_order=20.0)
            self._recording.static(f"{ENTITY}/{name}", to_row, style)
            strips.append(np.array([[-HALF, height], [HALF, height]]))
            labels.append((-1.25 * HALF, height, name))
        strips += [share * HALF * circle for share in (0.5, 1.0)] + [np.array([[0.0, -HALF], [0.0, HALF]])]
        axes = rr.LineStrips2D(strips, colors=rgb(INK), radii=rr.Radius.ui_points(0.5))
        self._recording.static(f"{ENTITY}/axes", axes)
        labels += [(share * HALF, HALF + 14.0, f"{share * full:g}") for share in (-1.0, -0.5, 0.0, 0.5, 1.0)]
        labels.append((0.0, HALF + 39.0, "pointing error [µrad]"))
        self._recording.texts(f"{ENTITY}/labels", labels)
