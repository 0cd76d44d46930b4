"""A signal on its way to another tool: values block by block, on an even clock or by stamps."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from testbed.logs.clock import NANO
from testbed.runs.signals import OneSignal
from testbed.signals import BLOCK

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from testbed.runs.signals import Signals
    from testbed.signals import FloatArray


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
    def rate(self) -> OneSignal:
        """The rate [rad/s], read in blocks."""
        return OneSignal(self.signals, "rate")

    def blocks(self) -> Iterator[tuple[NDArray[np.int64], FloatArray]]:
        """Yield stamps [ns] since the start of the run and rates [rad/s], shapes (n_block,)."""
        for start, rate in self.rate.blocks(BLOCK):
            yield self.stamps(start, start + rate.size), rate

    def stamps(self, start: int, stop: int) -> NDArray[np.int64]:
        """Return the stamps [ns] of samples `start` <= k < `stop`, shape (n_time,), each rounded to the nearest."""
        seconds = OneSignal(self.signals, "time").read(start, stop)
        return np.rint(seconds / NANO).astype(np.int64)
