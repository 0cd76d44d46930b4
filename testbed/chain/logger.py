"""What stands between sensors with clocks of their own and the filters: stamps, and readings in the order of these."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from testbed.runs.block import Ticked, first_due
from testbed.sensors.clock import TickSampler, stamps_ns

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from testbed.models.turntable.truth import TruthBlock
    from testbed.scenario.model import Scenario
    from testbed.signals import FloatArray

    Seen = tuple[Mapping[str, FloatArray]] | tuple[Mapping[str, FloatArray], Mapping[str, NDArray[np.int64]]]


class Logger:
    """Writes down when each sensor read, and hands the readings on in the order of their stamps.

    The sensors without a clock of their own read at samples of the run. What is stamped late waits until the others
    have come as far, so that the filters give the same for any division into blocks.

    Parameters
    ----------
    scenario : Scenario
        With the sensors.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._base, self._sensors = scenario.base_rate_hz, scenario.sensors
        seed = scenario.frame.seed
        self._truth = {
            name: TickSampler(sensor.ticks(seed, name), self._base)
            for name, sensor in scenario.sensors.items()
            if sensor.clocked(self._base)
        }
        self._count = dict.fromkeys(self._truth, 0)
        self._waiting = {name: (np.empty(0), np.empty(0, np.int64)) for name in self._truth}

    def ticked(self, truth: TruthBlock) -> dict[str, Ticked]:
        """Return when each sensor with a clock of its own read in a block, and the true rate then.

        Parameters
        ----------
        truth : TruthBlock
            The block.
        """
        found = {}
        for name, sampler in self._truth.items():
            rate = sampler.process(truth.rate)
            times = sampler.times
            found[name] = Ticked(self._count[name], times, rate, stamps_ns(self._sensors[name].clock, times))
            self._count[name] += times.size
        return found

    def seen(self, readings: Mapping[str, FloatArray], ticked: Mapping[str, Ticked], truth: TruthBlock) -> Seen:
        """Return the readings that the filters get in a block [rad/s], and their stamps [ns] if there are clocks.

        Parameters
        ----------
        readings : mapping of str to ndarray, shape (n_reading,)
            Of every sensor in the block.
        ticked : mapping of str to Ticked
            As `ticked` returned it.
        truth : TruthBlock
            The block.
        """
        if not self._truth:
            return (readings,)
        end = round(1e9 * (truth.start + truth.rate.size) / self._base)
        given, stamps = dict(readings), {}
        for name, values in readings.items():
            if name not in ticked:
                rate = self._sensors[name].sample_rate
                first = first_due(truth.start, self._base, rate)
                stamps[name] = np.rint(np.arange(first, first + values.size) * (1e9 / rate)).astype(np.int64)
                continue
            before, waiting = self._waiting[name]
            all_values = np.concatenate([before, values])
            all_stamps = np.concatenate([waiting, ticked[name].time_ns])
            n = int(np.searchsorted(all_stamps, end))
            given[name], stamps[name] = all_values[:n], all_stamps[:n]
            self._waiting[name] = all_values[n:], all_stamps[n:]
        return given, stamps


def whole_stamps(scenario: Scenario) -> dict[str, NDArray[np.int64]]:
    """Return the stamps of all readings of each sensor with a clock of its own over a run [ns].

    Parameters
    ----------
    scenario : Scenario
        What runs.
    """
    base, seed = scenario.base_rate_hz, scenario.frame.seed
    return {
        name: stamps_ns(sensor.clock, sensor.ticks(seed, name).until((scenario.n_time - 1) / base))
        for name, sensor in scenario.sensors.items()
        if sensor.clocked(base)
    }
