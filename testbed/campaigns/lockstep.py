"""Seeds and settings over one truth, side by side: block after block, so that nothing of a run's length is held."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from testbed.campaigns.many import ManyFilters, ManySensors
from testbed.chain.instruments import sample_rates
from testbed.chain.pointing import LinesOfSight
from testbed.chain.truth import Truth
from testbed.fusion.lanes.pack import Buffers
from testbed.judging.case import CaseFacts
from testbed.judging.judge import Judge
from testbed.runs.block import RunBlock

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from testbed.fusion.base import EstimateBlock, Received
    from testbed.runs.metrics import RunMetrics
    from testbed.scenario.model import Scenario
    from testbed.signals import FloatArray

# Seeds whose signals of a block are there at a time, unless more of them go faster together.
_PACK = 16


class Lockstep:
    """Scenarios that differ in sensors, filters and judgement only, under some seeds.

    A stage is started once for all scenarios that have an equal one.

    Parameters
    ----------
    cases : sequence of Scenario
        The scenarios, of the same truth.
    seeds : sequence of int
        Of their noise, each once.
    """

    def __init__(self, cases: Sequence[Scenario], seeds: Sequence[int]) -> None:
        # A truth that is drawn is that of the one seed that it is played for.
        cases = [case.with_seed(seeds[0]) for case in cases]
        self._seeds, self._truth = seeds, Truth(cases[0])
        self._sensors: list[tuple[Any, ManySensors]] = []
        self._filters: list[tuple[Any, ManyFilters]] = []
        self._buffers = Buffers()
        # Of each case the numbers of its stages by their names.
        self._reads = [self._find_sensors(case) for case in cases]
        self._estimates = [self._find_filters(case, reads) for case, reads in zip(cases, self._reads, strict=True)]
        # Of each filter its name, and the numbers of the cases that have it.
        self._users = [
            (name, [i for i, made in enumerate(self._estimates) if made.get(name) == number])
            for number, ((name, *_), _) in enumerate(self._filters)
        ]
        # Filters that receive the same come one after the other, so that it is there once, and no longer than for them.
        fronts: dict[Any, list[int]] = {}
        for number in sorted(range(len(self._filters)), key=lambda number: not self._filters[number][1].in_lanes):
            fronts.setdefault(self._front(number), []).append(number)
        self._order = [number for numbers in fronts.values() for number in numbers]
        # Lanes go fastest where their buffers stay; others are slow enough to have the room instead, unless what stands
        # in them is for further seeds of this block.
        self._pack = max([_PACK, *(stage.at_once for _, stage in self._filters)])
        self._makes_room = len(seeds) <= self._pack and not all(stage.in_lanes for _, stage in self._filters)
        rates = [sample_rates(case) for case in cases]
        self._common = [CaseFacts(case, rate, self._truth.step) for case, rate in zip(cases, rates, strict=True)]
        self._sights = {
            (i, seed): LinesOfSight(case.with_seed(seed), rates[i]) for i, case in enumerate(cases) for seed in seeds
        }
        self._judges = {
            (i, seed): Judge(case.with_seed(seed), rates[i], self._truth.step, self._common[i])
            for i, case in enumerate(cases)
            for seed in seeds
        }

    def _find_sensors(self, case: Scenario) -> dict[str, int]:
        return {
            name: _number(self._sensors, (name, sensor), lambda name=name: ManySensors(case, name, self._seeds))
            for name, sensor in case.sensors.items()
        }

    def _find_filters(self, case: Scenario, reads: Mapping[str, int]) -> dict[str, int]:
        begin = case.frame.fusion_from
        return {
            name: _number(
                self._filters,
                (name, spec, reads, begin),
                lambda name=name: ManyFilters(case, name, self._seeds, self._buffers),
            )
            for name, spec in case.fusion.items()
        }

    def advance(self, n_time: int) -> None:
        """Take the next `n_time` base samples.

        Parameters
        ----------
        n_time : int
            How many.
        """
        command, truth = self._truth.process(n_time)
        block = RunBlock(command.start, command, truth, {}, {}, {})
        for case in self._common:
            case.write(block)
        for _, sensor in self._sensors:
            sensor.take(truth)
        for k in range(0, len(self._seeds), self._pack):
            self._judge(block, self._seeds[k : k + self._pack])

    def _judge(self, block: RunBlock, pack: Sequence[int]) -> None:
        """Judge some seeds: their readings, then one filter after the other, then what all of them leave of the line
        of sight. No more than the estimates of one filter are there at a time, of a filter without lanes those of one
        seed.
        """
        readings = [sensor.readings(pack) for _, sensor in self._sensors]
        sensed = {
            (i, seed): {name: readings[at][j] for name, at in reads.items()}
            for i, reads in enumerate(self._reads)
            for j, seed in enumerate(pack)
        }
        for key, given in sensed.items():
            self._judges[key].write(replace(block, sensors=given))
        rates: dict[tuple[int, int], dict[str, FloatArray]] = {key: {} for key in sensed}
        known: dict[Any, list[Received]] = {}
        for number in self._order:
            estimates = self._estimated(number, readings, pack, known)
            for seed in pack:
                self._take(block, number, seed, next(estimates), rates)
            del estimates  # with what is received, before the next filter receives something else
        for key, given in sensed.items():
            truth = block.truth
            sight = self._sights[key].process(truth.rate, truth.sensor_rate, given, rates[key])
            self._judges[key].write(replace(block, pointing=sight))

    def _take(
        self,
        block: RunBlock,
        number: int,
        seed: int,
        estimate: EstimateBlock,
        rates: Mapping[tuple[int, int], dict[str, FloatArray]],
    ) -> None:
        """Judge an estimate in each case that has it; nobody else holds it, so that it is gone before the next one."""
        name, users = self._users[number]
        for i in users:
            self._judges[i, seed].write(replace(block, fusion={name: estimate}))
            if name in self._sights[i, seed].names:
                rates[i, seed][name] = estimate.rate.copy()  # it holds until the next filter works

    def _estimated(
        self,
        number: int,
        readings: Sequence[list[FloatArray]],
        pack: Sequence[int],
        known: dict[Any, list[Received]],
    ) -> Iterator[EstimateBlock]:
        """Yield the estimates of a filter; those that receive the same of the same readings do so once, and it is
        `known` until others receive something else.
        """
        (_, _, reads, _), stage = self._filters[number]
        given = {name: readings[i] for name, i in reads.items()}
        if self._makes_room:
            self._buffers.clear()
        if stage.front is None:
            return stage.process(given, pack)
        key = self._front(number)
        if key not in known:
            known.clear()
            known[key] = stage.received(given, pack)
        return stage.process(given, pack, known[key])

    def _front(self, number: int) -> Any:
        """Return what a filter receives, in a form that is equal where that is the same."""
        (_, _, reads, _), stage = self._filters[number]
        return number if stage.front is None else (stage.in_lanes, stage.front, *reads.items())

    def foresee(self) -> None:
        """Work out ahead what the metrics of all seeds share and no signal is needed for."""
        for case in self._common:
            case.foresee()

    def metrics(self, case: int, seed: int, versions: Mapping[str, str]) -> RunMetrics:
        """Return the metrics of a case under a seed.

        Parameters
        ----------
        case, seed : int
            Number of the case, and the seed.
        versions : mapping of str to str
            Of what the result depends on.
        """
        return self._judges[case, seed].metrics(versions)


def _number(known: list[tuple[Any, Any]], content: Any, make: Any) -> int:
    """Return the place of the stage of that content in a list, where it is put if there is none yet."""
    for i, (other, _) in enumerate(known):
        if other == content:
            return i
    known.append((content, make()))
    return len(known) - 1
