"""The chain: motion -> turntable -> sensors -> fusion, block by block."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.chain.pointing import LinesOfSight
from testbed.errors import RunError
from testbed.fusion import FILTERS
from testbed.fusion.checked import CheckedFilter
from testbed.inputs.plugins import PluginError
from testbed.models.turntable.turntable import Turntable
from testbed.runs.block import RunBlock
from testbed.scenario.step_choice import choose_step, exposed
from testbed.sensors import SENSORS
from testbed.sensors.base import ExposedStage, ProfiledStage, Surroundings, ThermalStage
from testbed.sensors.checked import CheckedSensor
from testbed.signals import BLOCK

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from testbed.fusion import EstimateBlock
    from testbed.models.turntable.turntable import TruthBlock
    from testbed.scenario.model import FilterSpec, Scenario
    from testbed.sensors.base import SensorStage
    from testbed.signals import FloatArray

POSE_STRIDE = 400


class Chain:
    """All stages of a scenario, joined.

    Parameters
    ----------
    scenario : Scenario
        What to run.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._motion, base = scenario.profile(), scenario.base_rate_hz
        mountings = {name: sensor.mounting for name, sensor in scenario.sensors.items()}
        self.step = choose_step(scenario)
        self.turntable = Turntable(
            scenario.turntable,
            mountings,
            base,
            substeps=self.step.substeps,
            holds=self.step.holds,
            pose_stride=POSE_STRIDE,
            exposed=exposed(scenario),
            modal=self.step.modal,
            floor=scenario.floor(),
        )
        self._temperature = scenario.frame.temperature
        self._sensors = {
            name: sensor.start(base, scenario.frame.seed, name) for name, sensor in scenario.sensors.items()
        }
        self._foreign = {
            name: CheckedSensor(name, round(base / sensor.sample_rate))
            for name, sensor in scenario.sensors.items()
            if scenario.sensor_types[name] not in SENSORS
        }
        rates = {name: sensor.sample_rate for name, sensor in scenario.sensors.items()}
        fastest = max(rates.values(), default=base)
        self._fusion = {
            name: CheckedFilter(name, _started(name, spec, rates), fastest, shipped=spec.type in FILTERS)
            for name, spec in scenario.fusion.items()
        }
        self.rates = {
            "base": base,
            **rates,
            **dict.fromkeys(self._fusion, fastest),
        }
        self._pointing = LinesOfSight(scenario, self.rates)

    def process(self, n_time: int) -> RunBlock:
        """Advance everything by `n_time` base samples."""
        return self._block(n_time, CheckedFilter.process)

    def tried(self, n_time: int) -> RunBlock:
        """Advance a trial by `n_time` base samples, in which shipped filters stay undefined (`CheckedFilter.tried`)."""
        return self._block(n_time, CheckedFilter.tried)

    @property
    def untried_seconds(self) -> float:
        """About how long the filters take, per base sample, for what `tried` leaves out [s]."""
        steps = {name: self.rates[name] / self.rates["base"] for name in self._fusion}
        return sum(steps[name] * stage.untried_seconds for name, stage in self._fusion.items())

    def _block(self, n_time: int, estimated: Callable[[CheckedFilter, Any], EstimateBlock]) -> RunBlock:
        command = self._motion.process(n_time)
        truth = self.turntable.process(command, self._motion.peek(self.turntable.lookahead))
        readings, profiles = {}, {}
        for name in self._sensors:
            readings[name], profile = self._sensed(name, truth)
            if profile is not None:
                profiles[name] = profile
        estimates = {name: estimated(stage, readings) for name, stage in self._fusion.items()}
        rates = {name: estimate.rate for name, estimate in estimates.items()}
        thermal = {name: stage for name, stage in self._sensors.items() if isinstance(stage, ThermalStage)}
        return RunBlock(
            command.start,
            command,
            truth,
            readings,
            estimates,
            profiles,
            temperatures={name: stage.temperature for name, stage in thermal.items()},
            drifts={name: stage.drift for name, stage in thermal.items()},
            pointing=self._pointing.process(truth.rate, truth.sensor_rate, readings, rates),
        )

    def _sensed(self, name: str, truth: TruthBlock) -> tuple[FloatArray, tuple[FloatArray, FloatArray] | None]:
        """Return the readings of a block, and the velocity profiles of a sensor that has them."""
        stage, around = self._sensors[name], self._around(name, truth)

        def feed(rate: FloatArray) -> tuple[FloatArray, tuple[FloatArray, FloatArray] | None]:
            return _sense(stage, rate, truth.start, around)

        rate = truth.sensor_rate[name]
        return self._foreign[name].sense(feed, rate) if name in self._foreign else feed(rate)

    def _around(self, name: str, truth: TruthBlock) -> Surroundings:
        temperature = self._temperature.at(truth.start, truth.rate.size, self.rates["base"])
        return Surroundings(truth.cross_rate.get(name), truth.specific_force.get(name), temperature)


def _started(name: str, spec: FilterSpec, rates: Mapping[str, float]) -> Any:
    try:
        return spec.start(rates)
    except PluginError as error:
        msg = f"filter {name}: {error}"
        raise RunError(msg) from error


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
    step = BLOCK if block is None else max(round(block * scenario.base_rate_hz), 1)
    return chain, (chain.process(min(step, scenario.n_time - start)) for start in range(0, scenario.n_time, step))


def _sense(
    stage: SensorStage, rate: FloatArray, start: int, around: Surroundings
) -> tuple[FloatArray, tuple[FloatArray, FloatArray] | None]:
    """Return the readings of a block, and the velocity profiles of a sensor that has them."""

    def feed(begin: int, end: int) -> FloatArray:
        if isinstance(stage, ExposedStage):
            return stage.process_in(rate[begin:end], around.part(begin, end))
        return stage.process(rate[begin:end])

    if not isinstance(stage, ProfiledStage):
        return feed(0, rate.size), None
    # A profile belongs to the last sample that went in, so the block is cut behind every pose sample.
    ends = [k + 1 for k in range(-start % POSE_STRIDE, rate.size, POSE_STRIDE)]
    readings, profiles, done = [], [], 0
    for end in ends:
        readings.append(feed(done, end))
        profiles.append(stage.profile())
        done = end
    readings.append(feed(done, rate.size))
    heights = stage.heights
    return np.concatenate(readings), (heights, np.array(profiles).reshape(len(profiles), heights.size))
