"""The chain: motion -> turntable -> sensors -> fusion, block by block."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from testbed.chain.instruments import Instruments
from testbed.chain.logger import whole_stamps
from testbed.chain.truth import Truth
from testbed.signals import BLOCK

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from testbed.runs.block import RunBlock
    from testbed.scenario.model import Scenario
    from testbed.signals import FloatArray


class Chain:
    """All stages of a scenario, joined.

    Parameters
    ----------
    scenario : Scenario
        What to run.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._scenario, self._truth = scenario, Truth(scenario)
        self._instruments = Instruments(scenario)
        self.step, self.turntable, self.rates = self._truth.step, self._truth.turntable, self._instruments.rates

    def process(self, n_time: int) -> RunBlock:
        """Advance everything by `n_time` base samples."""
        return self._instruments.process(*self._truth.process(n_time))

    def tried(self, n_time: int) -> RunBlock:
        """Advance a trial by `n_time` base samples, in which shipped filters stay undefined (`CheckedFilter.tried`)."""
        return self._instruments.tried(*self._truth.process(n_time))

    @cached_property
    def time_ns(self) -> dict[str, NDArray[np.int64]]:
        """What the logger writes for the readings of each sensor with a clock of its own, over the whole run [ns]."""
        return whole_stamps(self._scenario)

    @property
    def times(self) -> dict[str, FloatArray]:
        """The same in seconds."""
        return {name: np.asarray(stamps * 1e-9, float) for name, stamps in self.time_ns.items()}

    @property
    def untried_seconds(self) -> float:
        """About how long the filters take, per base sample, for what `tried` leaves out [s]."""
        return self._instruments.untried_seconds


def simulate(scenario: Scenario, block: float | None = None) -> tuple[Chain, Iterator[RunBlock]]:
    """Return the chain of a scenario and the iterator that runs it.

    Parameters
    ----------
    scenario : Scenario
        What to run.
    block : float, optional
        Length of a block [s], 20 000 samples of the base clock if not given; the result does not depend on it.
    """
    chain = Chain(scenario)
    return chain, (chain.process(n) for n in block_lengths(scenario, block))


def block_lengths(scenario: Scenario, block: float | None = None) -> Iterator[int]:
    """Yield the number of base samples of each block; arguments as `simulate`."""
    step = BLOCK if block is None else max(round(block * scenario.base_rate_hz), 1)
    return (min(step, scenario.n_time - start) for start in range(0, scenario.n_time, step))
