"""The chain: motion -> turntable -> sensors -> fusion, block by block."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from testbed.models.motion import CommandBlock, MotionProfile
from testbed.models.turntable import TruthBlock, Turntable
from testbed.scenario import BASE_RATE_HZ, Scenario
from testbed.sensors.base import ProfiledStage
from testbed.signals import random_stream

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from testbed.fusion import EstimateBlock
    from testbed.sensors.base import SensorStage
    from testbed.signals import FloatArray

POSE_STRIDE = 400


@dataclass(frozen=True)
class RunBlock:
    """Everything that one block of the chain produced.

    Parameters
    ----------
    start : int
        Index of its first base sample.
    command, truth : CommandBlock, TruthBlock
        What was commanded and what happened.
    sensors : mapping
        Readings [rad/s] by sensor, those that fall due in the block.
    fusion : mapping
        Estimates by filter.
    profiles : mapping
        By MHD sensor: heights [m], shape (n_height,), and velocity profiles at the pose samples, shape (n_pose, n_height).
    """

    start: int
    command: CommandBlock
    truth: TruthBlock
    sensors: Mapping[str, FloatArray]
    fusion: Mapping[str, EstimateBlock]
    profiles: Mapping[str, tuple[FloatArray, FloatArray]]

    @property
    def n_time(self) -> int:
        """Number of base samples."""
        return self.command.n_time


class Chain:
    """All stages of a scenario, joined.

    Parameters
    ----------
    scenario : Scenario
        What to run.
    """

    def __init__(self, scenario: Scenario) -> None:
        frame = scenario.frame
        terms = [
            motion.start(frame.duration, random_stream(frame.seed, "motion", str(i), kind))
            for i, (kind, motion) in enumerate(scenario.motion)
        ]
        self._motion = MotionProfile(terms, frame.ramp_in, BASE_RATE_HZ)
        mountings = {name: sensor.mounting for name, sensor in scenario.sensors.items()}
        floor = scenario.turntable.floor.start(frame.duration, partial(random_stream, frame.seed, "turntable", "floor"))
        self.turntable = Turntable(scenario.turntable, mountings, BASE_RATE_HZ, pose_stride=POSE_STRIDE, floor=floor)
        self._sensors = {
            name: sensor.start(BASE_RATE_HZ, frame.seed, name) for name, sensor in scenario.sensors.items()
        }
        rates = {name: sensor.sample_rate for name, sensor in scenario.sensors.items()}
        self._fusion = {
            name: spec.factory(spec.belief, rates, spec.parameters) for name, spec in scenario.fusion.items()
        }
        self.rates = {
            "base": BASE_RATE_HZ,
            **rates,
            **dict.fromkeys(self._fusion, max(rates.values(), default=BASE_RATE_HZ)),
        }

    def process(self, n_time: int) -> RunBlock:
        """Advance everything by `n_time` base samples."""
        command = self._motion.process(n_time)
        truth = self.turntable.process(command)
        readings, profiles = {}, {}
        for name, stage in self._sensors.items():
            readings[name], profile = _sense(stage, truth.sensor_rate[name], command.start)
            if profile is not None:
                profiles[name] = profile
        estimates = {name: stage.process(readings) for name, stage in self._fusion.items()}
        return RunBlock(command.start, command, truth, readings, estimates, profiles)


def simulate(scenario: Scenario, block: float = 1.0) -> tuple[Chain, Iterator[RunBlock]]:
    """Return the chain of a scenario and the iterator that runs it.

    Parameters
    ----------
    scenario : Scenario
        What to run.
    block : float, optional
        Length of a block [s]; the result does not depend on it.
    """
    chain = Chain(scenario)
    step = max(round(block * BASE_RATE_HZ), 1)
    return chain, (chain.process(min(step, scenario.n_time - start)) for start in range(0, scenario.n_time, step))


def _sense(stage: SensorStage, rate: FloatArray, start: int) -> tuple[FloatArray, tuple[FloatArray, FloatArray] | None]:
    """Return the readings of a block, and the velocity profiles of a sensor that has them."""
    if not isinstance(stage, ProfiledStage):
        return stage.process(rate), None
    # A profile belongs to the last sample that went in, so the block is cut behind every pose sample.
    ends = [k + 1 for k in range(-start % POSE_STRIDE, rate.size, POSE_STRIDE)]
    readings, profiles, done = [], [], 0
    for end in ends:
        readings.append(stage.process(rate[done:end]))
        profiles.append(stage.profile())
        done = end
    readings.append(stage.process(rate[done:]))
    heights = stage.heights
    return np.concatenate(readings), (heights, np.array(profiles).reshape(len(profiles), heights.size))
