"""What the contract tests of filters run on: every registered filter, the example, readings of linear sensors."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.fusion import FILTERS
from testbed.fusion.base import EstimateBlock
from testbed.fusion.belief import load_belief
from testbed.parts import resolve
from testbed.signals import LinearFilter, random_stream
from tests.examples.programs import example

if TYPE_CHECKING:
    from collections.abc import Mapping

    from testbed.fusion.belief import SensorBelief
    from testbed.signals import FloatArray

DEG = np.pi / 180.0
RATES = {"mems_gyro": 2000.0, "mhd_ars": 20000.0}
BELIEF = load_belief("eq39")
# A filter that is new here is held to all of it without a word in these tests; so is the one of docs/filters.md.
METHODS = {name: resolve("filter", name, FILTERS) for name in FILTERS} | {"own_filter": example("own_filter").Blend}
NAMES = list(METHODS)


def named(name: str) -> Any:
    """Return what `estimate` takes for a filter: the name of a registered one, else its class."""
    return name if name in FILTERS else METHODS[name]


def built(name: str, **parameters: Any) -> Any:
    """Return a filter with equation (39) as its belief."""
    return METHODS[name](BELIEF, RATES, METHODS[name].Parameters(**parameters))


def from_rest(name: str) -> dict[str, str]:
    """Return the parameter that tells a filter, if it can be told, that the record begins at rest."""
    return {"start": "rest"} if "start" in METHODS[name].Parameters.model_fields else {}


def sines(*lines: tuple[float, float], duration: float) -> FloatArray:
    """Return the sum of (frequency [Hz], amplitude [deg/s]) at 20 kHz [rad/s]."""
    t = np.arange(round(duration * RATES["mhd_ars"])) / RATES["mhd_ars"]
    rate: FloatArray = np.sum([amplitude * DEG * np.sin(2.0 * np.pi * f * t) for f, amplitude in lines], axis=0)
    return rate


def readings_of(
    rate: FloatArray, seed: int, belief: Mapping[str, SensorBelief] = BELIEF, rates: Mapping[str, float] = RATES
) -> dict[str, FloatArray]:
    """Return what sensors that are exactly as believed read of a rate at 20 kHz [rad/s], with their white noise."""
    readings = {}
    for name, one in belief.items():
        fs = RATES["mhd_ars"]
        inner, outer = (random_stream(seed, name, where) for where in ("inner", "outer"))
        seen = rate + one.input_noise * np.sqrt(fs) * inner.standard_normal(rate.size)
        passed = LinearFilter(list(one.numerator), list(one.denominator), fs).process(seen)
        taken = passed[:: round(fs / rates[name])]
        readings[name] = taken + one.output_noise * np.sqrt(rates[name]) * outer.standard_normal(taken.size)
        readings[name].flags.writeable = False
    return readings


def joined(blocks: list[EstimateBlock]) -> EstimateBlock:
    """Return blocks that follow each other as one."""
    diagnostics = {key: np.concatenate([b.diagnostics[key] for b in blocks]) for key in blocks[0].diagnostics}
    return EstimateBlock(np.concatenate([b.rate for b in blocks]), np.concatenate([b.std for b in blocks]), diagnostics)
