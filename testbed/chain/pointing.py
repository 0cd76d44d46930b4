"""The stage after fusion: the line of sight behind every filter that feeds the mirror forward."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from testbed.pointing.angle import RateIntegral
from testbed.pointing.inputs import NOISE, UNKNOWN, BelievedSensor, input_parts
from testbed.pointing.line_of_sight import Fades, LineOfSight
from testbed.scenario.pointing import fed_forward, gains_of
from testbed.sensors import SENSORS
from testbed.signals import random_stream

if TYPE_CHECKING:
    from collections.abc import Mapping

    from testbed.pointing.line_of_sight import PointingBlock
    from testbed.scenario.model import Scenario
    from testbed.signals import FloatArray


class LinesOfSight:
    """The line of sight behind each filter that feeds forward; nothing for a scenario without pointing.

    Parameters
    ----------
    scenario : Scenario
        What runs.
    rates : mapping of str to float
        Sample rate [Hz] of ``base`` and of every sensor and filter by its name.

    Attributes
    ----------
    names : list of str
        The filters.
    """

    def __init__(self, scenario: Scenario, rates: Mapping[str, float]) -> None:
        self.names = fed_forward(scenario)
        pointing = scenario.pointing
        if pointing is None:
            return
        base = rates["base"]
        self._noise = pointing.tracker.noise * math.sqrt(base)
        self._random = random_stream(scenario.frame.seed, "pointing", "tracker")
        self._fades = Fades([(fade.at, fade.length) for fade in pointing.tracker.fades], base)
        self._true = RateIntegral(1, base)
        self._clean = {
            name: sensor.model_copy(update={"noise": False}).start(base, scenario.frame.seed, name)
            for name, sensor in scenario.sensors.items()
            if scenario.sensor_types[name] in SENSORS
        }
        self._lines = {name: _Line(scenario, name, rates) for name in self.names}

    def process(
        self,
        truth: FloatArray,
        sensor_rate: Mapping[str, FloatArray],
        readings: Mapping[str, FloatArray],
        estimates: Mapping[str, FloatArray],
    ) -> dict[str, PointingBlock]:
        """Take the next block and return what it leaves, by filter.

        Parameters
        ----------
        truth : ndarray, shape (n_time,)
            True rate [rad/s] on the base clock.
        sensor_rate : mapping of str to ndarray, shape (n_time,)
            What each sensor's axis feels [rad/s].
        readings, estimates : mapping of str to ndarray, shape (n_due,)
            Of sensors and filters, those that fall due [rad/s].
        """
        if not self.names:
            return {}
        whole = self._true.process(truth, truth.size)
        clean = {name: stage.process(sensor_rate[name]) for name, stage in self._clean.items()}
        noise = self._noise * self._random.standard_normal(truth.size) if self._noise else np.zeros(truth.size)
        seen = self._fades.process(truth.size)
        return {
            name: line.process(truth, whole, clean, readings, estimates[name], noise, seen)
            for name, line in self._lines.items()
        }


class _Line:
    """One filter: what it believes, its angles and its line of sight."""

    def __init__(self, scenario: Scenario, name: str, rates: Mapping[str, float]) -> None:
        assert scenario.pointing is not None
        spec, base = scenario.fusion[name], rates["base"]
        ratio = {sensor: round(base / rates[sensor]) for sensor in scenario.sensors}
        self._believed = {one: BelievedSensor(spec.belief[one], base, ratio[one]) for one in ratio}
        self._estimated = RateIntegral(round(base / rates[name]), base)
        inputs = {f"{kind}{one}": ratio[one] for kind in (NOISE, UNKNOWN) for one in ratio}
        self._angles = {one: RateIntegral(step, base) for one, step in inputs.items()}
        gains = gains_of(scenario, name)
        self._sight = LineOfSight(scenario.pointing, gains, list(inputs), base)

    def process(
        self,
        truth: FloatArray,
        whole: tuple[FloatArray, FloatArray],
        clean: Mapping[str, FloatArray],
        readings: Mapping[str, FloatArray],
        estimate: FloatArray,
        noise: FloatArray,
        seen: FloatArray,
    ) -> PointingBlock:
        believed = {name: sensor.process(truth) for name, sensor in self._believed.items()}
        found = input_parts(readings, clean, believed)
        inputs = {name: angle.process(found[name], truth.size) for name, angle in self._angles.items()}
        return self._sight.process(whole, self._estimated.process(estimate, truth.size), inputs, noise, seen)
