"""Seeds and settings over one truth, side by side: block after block, so that nothing of a run's length is held."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from testbed.campaigns.many import ManyFilters, ManySensors
from testbed.chain.instruments import sample_rates
from testbed.chain.pointing import LinesOfSight
from testbed.chain.truth import Truth
from testbed.judging.case import CaseFacts
from testbed.judging.judge import Judge
from testbed.runs.block import RunBlock

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from testbed.fusion.base import EstimateBlock, Received
    from testbed.runs.metrics import RunMetrics
    from testbed.scenario.model import Scenario
    from testbed.signals import FloatArray

# Seeds whose signals of a block are there at a time.
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
        # Of each case the numbers of its stages by their names.
        self._reads = [self._find_sensors(case) for case in cases]
        self._estimates = [self._find_filters(case, reads) for case, reads in zip(cases, self._reads, strict=True)]
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
                self._filters, (name, spec, reads, begin), lambda name=name: ManyFilters(case, name, self._seeds)
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
        for case in self._common:
            case.write(RunBlock(command.start, command, truth, {}, {}, {}))
        for _, sensor in self._sensors:
            sensor.take(truth)
        for k in range(0, len(self._seeds), _PACK):
            pack = self._seeds[k : k + _PACK]
            readings = [sensor.readings(pack) for _, sensor in self._sensors]
            estimates = self._estimated(readings, pack)
            for i, (reads, made) in enumerate(zip(self._reads, self._estimates, strict=True)):
                for j, seed in enumerate(pack):
                    sensed = {name: readings[at][j] for name, at in reads.items()}
                    found = {name: estimates[at][j] for name, at in made.items()}
                    rates = {name: estimate.rate for name, estimate in found.items()}
                    sight = self._sights[i, seed].process(truth.rate, truth.sensor_rate, sensed, rates)
                    block = RunBlock(command.start, command, truth, sensed, found, {}, pointing=sight)
                    self._judges[i, seed].write(block)

    def _estimated(self, readings: Sequence[list[FloatArray]], pack: Sequence[int]) -> list[list[EstimateBlock]]:
        """Return the estimates of each filter; those that receive the same of the same readings do so once."""
        estimates: list[list[EstimateBlock]] = []
        known: dict[Any, list[Received]] = {}
        for (_, _, reads, _), stage in self._filters:
            given, received = {name: readings[i] for name, i in reads.items()}, None
            if stage.front is not None:
                key = (stage.front, *reads.items())
                if key not in known:
                    known[key] = stage.received(given, pack)
                received = known[key]
            estimates.append(stage.process(given, pack, received))
        return estimates

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
