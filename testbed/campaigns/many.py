"""A sensor and a filter under many seeds: what does not depend on the seed is computed once."""

from __future__ import annotations

from copy import deepcopy
from typing import TYPE_CHECKING, Any

from testbed.chain.instruments import start_filter, surroundings
from testbed.chain.onset import Onset, joined, longest
from testbed.fusion import FILTERS
from testbed.fusion.lanes.together import Together
from testbed.sensors import SENSORS
from testbed.sensors.checked import CheckedSensor
from testbed.sensors.stages import ExposedStage, SplitStage, Surroundings

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from testbed.fusion.base import EstimateBlock, Received
    from testbed.fusion.lanes.pack import Buffers
    from testbed.models.turntable.truth import TruthBlock
    from testbed.scenario.model import Scenario
    from testbed.sensors.stages import SensorStage
    from testbed.signals import FloatArray


class ManySensors:
    """One instrument under many seeds over the same truth.

    Clean readings are worked out once, and each seed adds its noise, rounds and loses readings by itself; all of it is
    done for each seed where noise comes before something that is not linear, and for the instrument of a plug-in.

    Parameters
    ----------
    scenario : Scenario
        What it belongs to.
    name : str
        Of the instrument.
    seeds : sequence of int
        Of the noise.
    """

    def __init__(self, scenario: Scenario, name: str, seeds: Sequence[int]) -> None:
        self._scenario, self._name, base = scenario, name, scenario.base_rate_hz
        sensor = scenario.sensors[name]
        self._stages = {seed: sensor.start(base, seed, name) for seed in seeds}
        self._faults = {seed: sensor.start_faults() for seed in seeds}
        self._losses = {seed: sensor.start_losses(seed, name) for seed in seeds}
        self._watch = None
        if scenario.sensor_types[name] not in SENSORS:
            self._watch = {seed: CheckedSensor(name, round(base / sensor.sample_rate)) for seed in seeds}
        # Of stages that split, the first also does for all what comes before the noise.
        self._split: dict[int, SplitStage] = {}
        if self._watch is None:
            self._split = {
                seed: stage for seed, stage in self._stages.items() if isinstance(stage, SplitStage) and stage.separable
            }

    def take(self, truth: TruthBlock) -> None:
        """Take the next block of the truth."""
        self._rate, self._around = truth.sensor_rate[self._name], surroundings(self._scenario, self._name, truth)
        if self._split:
            self._clean = next(iter(self._split.values())).clean(self._rate, self._around)

    def readings(self, seeds: Sequence[int]) -> list[FloatArray]:
        """Return the readings of that block [rad/s] under some of the seeds, each once.

        Parameters
        ----------
        seeds : sequence of int
            Some of those given at the start.
        """
        return [self._losses[seed].process(self._faults[seed].process(self._reading(seed))) for seed in seeds]

    def _reading(self, seed: int) -> FloatArray:
        if self._split:
            return self._split[seed].finish(self._clean)
        stage = self._stages[seed]
        if self._watch is None:
            return _whole(stage, self._rate, self._around)
        return self._watch[seed].sense(lambda rate: (_whole(stage, rate, self._around), None), self._rate)[0]


def _whole(stage: SensorStage, rate: FloatArray, around: Surroundings) -> FloatArray:
    return stage.process_in(rate, around) if isinstance(stage, ExposedStage) else stage.process(rate)


class ManyFilters:
    """One filter under many seeds.

    Parameters
    ----------
    scenario : Scenario
        What it belongs to.
    name : str
        Of the filter.
    seeds : sequence of int
        Of the noise.
    buffers : Buffers
        For the estimates, shared with filters whose estimates are not needed at the same time.
    """

    def __init__(self, scenario: Scenario, name: str, seeds: Sequence[int], buffers: Buffers) -> None:
        spec = scenario.fusion[name]
        self._shipped = spec.type in FILTERS
        # Filters with an equal one receive the same of equal readings; None has what nobody else has.
        self.front: Any = None
        self.in_lanes, self.at_once = False, 1
        if self._shipped:
            rates = {sensor: part.sample_rate for sensor, part in scenario.sensors.items()}
            first = spec.start(rates)
            # Some design their gains before they start.
            self._stages = {seed: deepcopy(first) for seed in seeds}
            self._together = Together(first, buffers)
            self.in_lanes, self.at_once = self._together.in_lanes, self._together.at_once
            self._onsets = {seed: Onset(scenario) for seed in seeds if scenario.frame.fusion_from}
            self.front = None if self._onsets else first.front()
        else:
            self._stages = {seed: start_filter(scenario, name, spec) for seed in seeds}

    def received(self, readings: Mapping[str, Sequence[FloatArray]], seeds: Sequence[int]) -> list[Received]:
        """Return what shipped filters receive of the readings of a block; arguments as for `process`."""
        stages = [self._stages[seed] for seed in seeds]
        return [stage.received(given) for stage, given in zip(stages, _by_seed(readings, seeds), strict=True)]

    def process(
        self,
        readings: Mapping[str, Sequence[FloatArray]],
        seeds: Sequence[int],
        received: Sequence[Received] | None = None,
    ) -> Iterator[EstimateBlock]:
        """Yield the estimates over a block under some of the seeds; of the diagnostics at least innovations, their
        variances and counts of the gate. They hold until the next call of any that shares the buffers, and all of them
        are to be taken.

        Parameters
        ----------
        readings : mapping of str to sequence of ndarray
            By sensor, the readings under each of these seeds [rad/s].
        seeds : sequence of int
            Some of those given at the start.
        received : sequence of tuple of ndarray, optional
            What is received of them, by a filter with an equal `front`; in every block or in none.
        """
        stages = [self._stages[seed] for seed in seeds]
        if self._shipped and received is not None:
            return self._together.process(stages, received)
        given = _by_seed(readings, seeds)
        if self._shipped and self._onsets:
            return self._late(stages, given, seeds)
        if self._shipped:
            return self._together.process(stages, self.received(readings, seeds))
        return (stage.process(values) for stage, values in zip(stages, given, strict=True))

    def _late(
        self, stages: Sequence[Any], given: Sequence[Mapping[str, FloatArray]], seeds: Sequence[int]
    ) -> Iterator[EstimateBlock]:
        """Yield the estimates where the filters do not see all readings of the run."""
        parts = [self._onsets[seed].divide(values) for seed, values in zip(seeds, given, strict=True)]
        unseen, seen = parts[0]
        blank = [stages[0].blank(longest(unseen))] if longest(unseen) else []
        if blank and not longest(seen):
            return iter(blank * len(seeds))
        received = [stage.received(values) for stage, (_, values) in zip(stages, parts, strict=True)]
        return (joined([*blank, one]) for one in self._together.process(stages, received))


def _by_seed(readings: Mapping[str, Sequence[FloatArray]], seeds: Sequence[int]) -> list[dict[str, FloatArray]]:
    return [{name: values[j] for name, values in readings.items()} for j in range(len(seeds))]
