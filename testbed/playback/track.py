"""A signal on its way to another tool: values block by block, on an even clock or by stamps."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from testbed.signals import BLOCK

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from testbed.runs.signals import Signals
    from testbed.signals import FloatArray

NANO = 1e-9


@dataclass(frozen=True)
class Track:
    """A rate of a run that is written to a file of another format.

    Parameters
    ----------
    name : str
        Of the channel.
    signals : Signals
        The group of the run that holds it, with ``rate`` and ``time``.
    """

    name: str
    signals: Signals

    @property
    def n_time(self) -> int:
        """Number of samples."""
        return self.signals.n_time

    @property
    def sample_rate_hz(self) -> float:
        """Rate of the samples [Hz]."""
        return self.signals.sample_rate_hz

    def blocks(self) -> Iterator[tuple[NDArray[np.int64], FloatArray]]:
        """Yield stamps [ns] since the start of the run and rates [rad/s], shapes (n_block,)."""
        for start in range(0, self.n_time, BLOCK):
            stop = min(start + BLOCK, self.n_time)
            yield self.stamps(start, stop), np.asarray(self.signals.read("rate", start, stop), np.float64)

    def stamps(self, start: int, stop: int) -> NDArray[np.int64]:
        """Return the stamps [ns] of samples `start` <= k < `stop`, shape (n_time,), each rounded to the nearest."""
        seconds = np.asarray(self.signals.read("time", start, stop), np.float64)
        return np.rint(seconds / NANO).astype(np.int64)
