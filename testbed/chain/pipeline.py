"""The chain: motion -> turntable -> sensors -> fusion, block by block."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from testbed.errors import RunError
from testbed.models.turntable.turntable import Turntable
from testbed.runs.block import RunBlock
from testbed.scenario.step_choice import choose_step, exposed
from testbed.sensors.base import ExposedStage, ProfiledStage, Surroundings, ThermalStage
from testbed.signals import random_stream

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from testbed.fusion import EstimateBlock
    from testbed.models.turntable.turntable import TruthBlock
    from testbed.scenario.model import Scenario
    from testbed.sensors.base import SensorStage
    from testbed.signals import FloatArray

POSE_STRIDE = 400
# Samples: a second at 20 kHz.
_BLOCK = 20_000


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
        seed, duration = scenario.frame.seed, scenario.frame.duration
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
            floor=scenario.turntable.floor.start(duration, partial(random_stream, seed, "turntable", "floor")),
        )
        self._temperature = scenario.frame.temperature
        self._sensors = {name: sensor.start(base, seed, name) for name, sensor in scenario.sensors.items()}
        rates = {name: sensor.sample_rate for name, sensor in scenario.sensors.items()}
        self._fusion = {
            name: spec.factory(spec.belief, rates, spec.parameters) for name, spec in scenario.fusion.items()
        }
        self.rates = {
            "base": base,
            **rates,
            **dict.fromkeys(self._fusion, max(rates.values(), default=base)),
        }

    def process(self, n_time: int) -> RunBlock:
        """Advance everything by `n_time` base samples."""
        command = self._motion.process(n_time)
        truth = self.turntable.process(command, self._motion.peek(self.turntable.lookahead))
        readings, profiles = {}, {}
        for name, stage in self._sensors.items():
            readings[name], profile = _sense(stage, truth.sensor_rate[name], command.start, self._around(name, truth))
            if profile is not None:
                profiles[name] = profile
        estimates = {name: self._estimate(name, readings) for name in self._fusion}
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
        )

    def _estimate(self, name: str, readings: Mapping[str, FloatArray]) -> EstimateBlock:
        """Return the estimate of a filter, which may be a user's own: one value per reading of the fastest sensor."""
        estimate: EstimateBlock = self._fusion[name].process(readings)
        n_time = max(values.size for values in readings.values())
        for signal, values in (("rate", estimate.rate), ("std", estimate.std), *estimate.diagnostics.items()):
            if np.shape(values) != (n_time,):
                msg = f"filter {name}: expected {signal} of shape ({n_time},), got {np.shape(values)}"
                raise RunError(msg)
        return estimate

    def _around(self, name: str, truth: TruthBlock) -> Surroundings:
        temperature = self._temperature.at(truth.start, truth.rate.size, self.rates["base"])
        return Surroundings(truth.cross_rate.get(name), truth.specific_force.get(name), temperature)


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
    step = _BLOCK if block is None else max(round(block * scenario.base_rate_hz), 1)
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
