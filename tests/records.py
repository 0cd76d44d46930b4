"""Records of the two sensors for tests and benchmarks of the filters: motion as a formula, instruments as shipped."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Mapping
from typing import Literal

import numpy as np

from testbed.fusion import estimate
from testbed.fusion.analysis.optimum import filters_from, period_map
from testbed.fusion.belief import load_belief
from testbed.fusion.model import build_model
from testbed.sensors import load_preset
from testbed.signals import FloatArray

DEG = math.pi / 180.0
FS = 20_000.0
RATES = {"mhd_ars": 20_000.0, "mems_gyro": 2_000.0}
PRESETS = {"mhd_ars": "sx300", "mems_gyro": "adis16505_filtered"}
Motion = Callable[[FloatArray], FloatArray]


def mixed(t: FloatArray) -> FloatArray:
    """Return the lines of the mixed scenario [rad/s]: 1 deg/s at 0.5 Hz and 0.18 deg/s at 10 Hz, from t = 0 on."""
    return DEG * (np.sin(np.pi * t) + 0.18 * np.sin(20.0 * np.pi * t))


def offset_mixed(t: FloatArray) -> FloatArray:
    """Return the same on top of a constant 6 deg/s [rad/s]."""
    return mixed(t) + 6.0 * DEG


def ramped(motion: Motion) -> Motion:
    """Return the motion as it begins on a table at rest: with a smooth ramp over the first half second."""

    def started(t: FloatArray) -> FloatArray:
        x = np.clip(t / 0.5, 0.0, 1.0)
        return motion(t) * x * x * (3.0 - 2.0 * x)

    return started


def record(
    motion: Motion,
    duration: float,
    seed: int,
    changes: Mapping[str, Mapping[str, object]] | None = None,
    presets: Mapping[str, str] = PRESETS,
) -> tuple[FloatArray, dict[str, FloatArray]]:
    """Return the true rate [rad/s] at 20 kHz and the readings of both sensors [rad/s], which begin in mid-motion.

    Parameters
    ----------
    motion : callable
        Rate of the time [s] -> [rad/s].
    duration : float
        Length [s].
    seed : int
        Of the sensors' noise.
    changes : mapping, optional
        Parameters of a sensor that differ from its preset.
    presets : mapping of str to str, optional
        Of each sensor.
    """
    rate = motion(np.arange(round(duration * FS)) / FS)
    given = changes or {}
    sensors = {
        name: load_preset(preset).model_copy(update=dict(given.get(name, {}))) for name, preset in presets.items()
    }
    return rate, {name: sensor.start(FS, seed, name).process(rate) for name, sensor in sensors.items()}


def cut(rate: FloatArray, readings: Mapping[str, FloatArray], begin: float) -> tuple[FloatArray, dict[str, FloatArray]]:
    """Return rate and readings from `begin` [s] on, a whole reading of the slowest sensor."""
    return rate[round(begin * FS) :], {name: z[round(begin * RATES[name]) :] for name, z in readings.items()}


def judged(
    name: str, rate: FloatArray, readings: Mapping[str, FloatArray], begin: float, end: float, **parameters: object
) -> tuple[float, float]:
    """Return error and claim of a filter from `begin` to `end` [s], root mean squares [deg/s]."""
    parameters = {"belief": "identified", **parameters}
    block = estimate(name, readings, sample_rate_hz=RATES, verdict=False, **parameters)
    part = slice(round(begin * FS), round(end * FS))
    return rms((block.rate - rate)[part]) / DEG, rms(block.std[part]) / DEG


def left_by(order: int, q: float, start: Literal["unknown", "rest"]) -> float:
    """Return the rms standard deviation 10 to 14 s after a start that the Kalman filter of that signal model has with
    white noise and exact sensors [rad/s]: the Riccati recursion by maps of a second, nothing simulated.
    """
    model = build_model(load_belief("identified"), RATES, order=order, q=q, start=start)
    period = period_map(model, model.Q[None])
    second, periods = None, round(model.sample_rate_hz / model.cycle)
    while periods:
        if periods & 1:
            second = period if second is None else second.then(period)
        period, periods = period.then(period), periods >> 1
    P, found = model.P0[None], []
    for k in range(14):
        P = second.applied(P)
        if k + 1 >= 10:
            found.append(filters_from(model, np.array([q]), model.Q[None], P).posterior()[:, 0, 0, 0].mean())
    return math.sqrt(np.mean(found))


def rms(values: FloatArray) -> float:
    """Return the root mean square, unit of `values`."""
    return float(np.sqrt(np.mean(np.square(values))))


@functools.cache
def long_record(motion: Motion, duration: float, seed: int) -> tuple[FloatArray, dict[str, FloatArray]]:
    """Return `record`, kept."""
    return record(motion, duration, seed)
