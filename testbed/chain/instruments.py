"""The second half of the chain: the sensors on the table and the filters behind them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.chain.logger import Logger
from testbed.chain.onset import LateFilter, Onset
from testbed.chain.pointing import LinesOfSight
from testbed.errors import RunError
from testbed.fusion import FILTERS
from testbed.fusion.checked import CheckedFilter
from testbed.inputs.plugins import PluginError
from testbed.runs.block import POSE_STRIDE, RunBlock
from testbed.sensors import SENSORS
from testbed.sensors.checked import CheckedSensor
from testbed.sensors.stages import ExposedStage, ProfiledStage, Surroundings, ThermalStage

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from testbed.fusion import EstimateBlock
    from testbed.models.motion import CommandBlock
    from testbed.models.turntable.truth import TruthBlock
    from testbed.scenario.model import FilterSpec, Scenario
    from testbed.sensors.stages import SensorStage
    from testbed.signals import FloatArray

    WatchedFilter = CheckedFilter | LateFilter
    Estimation = Callable[..., EstimateBlock]


class Instruments:
    """Sensors and filters of a scenario under one seed.

    Parameters
    ----------
    scenario : Scenario
        What runs.
    """

    def __init__(self, scenario: Scenario) -> None:
        self.rates = sample_rates(scenario)
        self._scenario = scenario
        self._sensors = {
            name: sensor.start(self.rates["base"], scenario.frame.seed, name)
            for name, sensor in scenario.sensors.items()
        }
        self._faults = {name: sensor.start_faults() for name, sensor in scenario.sensors.items()}
        self._losses = {
            name: sensor.start_losses(scenario.frame.seed, name) for name, sensor in scenario.sensors.items()
        }
        self._logger = Logger(scenario)
        self._foreign = {
            name: CheckedSensor(name, round(self.rates["base"] / sensor.sample_rate))
            for name, sensor in scenario.sensors.items()
            if scenario.sensor_types[name] not in SENSORS
        }
        self._pointing = LinesOfSight(scenario, self.rates)
        self._fusion = {name: start_filter(scenario, name, spec) for name, spec in scenario.fusion.items()}

    def process(self, command: CommandBlock, truth: TruthBlock) -> RunBlock:
        """Return all that the run has over a block of the truth."""
        return self._block(command, truth, lambda stage: stage.process)

    def tried(self, command: CommandBlock, truth: TruthBlock) -> RunBlock:
        """Return the same of a trial, in which shipped filters stay undefined (`CheckedFilter.tried`)."""
        return self._block(command, truth, lambda stage: stage.tried)

    @property
    def untried_seconds(self) -> float:
        """About how long the filters take, per base sample, for what `tried` leaves out [s]."""
        steps = {name: self.rates[name] / self.rates["base"] for name in self._fusion}
        return sum(steps[name] * stage.untried_seconds for name, stage in self._fusion.items())

    def _block(self, command: CommandBlock, truth: TruthBlock, way: Callable[[WatchedFilter], Estimation]) -> RunBlock:
        readings, profiles = {}, {}
        for name in self._sensors:
            readings[name], profile = self._sensed(name, truth)
            if profile is not None:
                profiles[name] = profile
        ticked = self._logger.ticked(truth)
        seen = self._logger.seen(readings, ticked, truth)
        estimates = {name: way(stage)(*seen) for name, stage in self._fusion.items()}
        thermal = {name: stage for name, stage in self._sensors.items() if isinstance(stage, ThermalStage)}
        rates = {name: estimate.rate for name, estimate in estimates.items()}
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
            ticked=ticked,
        )

    def _sensed(self, name: str, truth: TruthBlock) -> tuple[FloatArray, tuple[FloatArray, FloatArray] | None]:
        """Return the readings of a block, and the velocity profiles of a sensor that has them."""
        stage, around = self._sensors[name], surroundings(self._scenario, name, truth)

        def feed(rate: FloatArray) -> tuple[FloatArray, tuple[FloatArray, FloatArray] | None]:
            return _sense(stage, rate, truth.start, around)

        rate = truth.sensor_rate[name]
        readings, profile = self._foreign[name].sense(feed, rate) if name in self._foreign else feed(rate)
        return self._losses[name].process(self._faults[name].process(readings)), profile


def sample_rates(scenario: Scenario) -> dict[str, float]:
    """Return the sample rate [Hz] of ``base`` and of every sensor and filter by its name.

    Parameters
    ----------
    scenario : Scenario
        What runs.
    """
    base = scenario.base_rate_hz
    rates = {name: sensor.sample_rate for name, sensor in scenario.sensors.items()}
    return {"base": base, **rates, **dict.fromkeys(scenario.fusion, max(rates.values(), default=base))}


def surroundings(scenario: Scenario, name: str, truth: TruthBlock) -> Surroundings:
    """Return what reaches a sensor over a block besides its rate.

    Parameters
    ----------
    scenario : Scenario
        With the temperature.
    name : str
        Of the sensor.
    truth : TruthBlock
        The block.
    """
    temperature = scenario.frame.temperature.at(truth.start, truth.rate.size, scenario.base_rate_hz)
    return Surroundings(truth.cross_rate.get(name), truth.specific_force.get(name), temperature)


def start_filter(scenario: Scenario, name: str, spec: FilterSpec) -> WatchedFilter:
    """Return a filter of a scenario at its beginning, under watch; it sees the readings from `fusion_from` on.

    Parameters
    ----------
    scenario : Scenario
        With the sensors.
    name : str
        Of the filter.
    spec : FilterSpec
        What it is.

    Raises
    ------
    RunError
        If it is a plug-in's and raises anything.
    """
    rates = {sensor: part.sample_rate for sensor, part in scenario.sensors.items()}
    fastest = sample_rates(scenario)[name]

    def started() -> CheckedFilter:
        return CheckedFilter(name, _started(name, spec, rates), fastest, shipped=spec.type in FILTERS)

    return LateFilter(started(), started(), Onset(scenario)) if scenario.frame.fusion_from else started()


def _started(name: str, spec: FilterSpec, rates: Mapping[str, float]) -> Any:
    try:
        return spec.start(rates)
    except PluginError as error:
        msg = f"filter {name}: {error}"
        raise RunError(msg) from error


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
