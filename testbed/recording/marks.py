"""Where a filter's gate struck a reading out: crosses on the filter's own line."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import rerun as rr

from testbed.pages.palette import rgb

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from testbed.recording.stream import Recording
    from testbed.signals import FloatArray

PREFIX = "struck_"


class GateMarks:
    """A cross for each sample at which a count of gated readings rose.

    Parameters
    ----------
    recording : Recording
        Where they go.
    entity : str
        Path of the entity.
    name, color : str
        Of the crosses.
    """

    def __init__(self, recording: Recording, entity: str, name: str, color: str) -> None:
        self.entity = entity
        self._recording, self._count, self.n = recording, 0.0, 0
        style = rr.SeriesPoints(names=[name], colors=[rgb(color)], markers=["cross"], marker_sizes=[5.0])
        recording.static(entity, style)

    def write(self, stamps: NDArray[np.timedelta64], count: FloatArray, rate: FloatArray) -> None:
        """Take the next samples.

        Parameters
        ----------
        stamps : ndarray of timedelta64[ns], shape (n_time,)
            Of the filter's samples.
        count : ndarray, shape (n_time,)
            Readings that were struck out so far [-].
        rate : ndarray, shape (n_time,)
            The estimate as it is shown, where the cross is drawn.
        """
        (rose,) = np.nonzero(np.diff(count, prepend=self._count) > 0.0)
        if count.size:
            self._count = float(count[-1])
        if rose.size:
            self.n += rose.size
            self._recording.rows(self.entity, stamps[rose], rr.Scalars.columns(scalars=rate[rose]))
