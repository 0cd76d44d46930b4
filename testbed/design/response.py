r"""Transfer functions of a linear filter, from what it makes of one pulse.

A Gaussian pulse of 0.3 ms holds all frequencies up to 700 Hz alike, and is long enough that it does not matter where
between two readings of a slow sensor it falls. As a true rate, through the sensors, it gives T(f) - 1, the error of the
estimate over the rate; in the readings of one sensor alone it gives that sensor's :math:`H_i(f)`.
"""

from __future__ import annotations

from copy import deepcopy
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping

    from testbed.scenario.model import FilterSpec
    from testbed.sensors.base import Sensor
    from testbed.signals import ComplexArray, FloatArray

# Where the pulse stands in its answer, and how long that is at least and at most [s]; how long gains are waited for at
# the most, which what a filter learns of slow noise moves for half a minute.
_AT, _SHORTEST, _LONGEST, _MOST_SETTLED = 0.05, 4.0, 32.0, 60.0
_WIDTH, _HIGHEST_HZ = 0.3e-3, 700.0
_SIZE = 1e-3
# Twice the pulse gives twice the answer, or the filter is not linear.
_LINEAR = 1e-4


@dataclass(frozen=True)
class FilterResponse:
    """What a filter makes of the truth and of each sensor's readings.

    Parameters
    ----------
    freq_hz : ndarray, shape (n_freq,)
        Frequencies up to 700 Hz [Hz].
    error : ndarray of complex, shape (n_freq,)
        T - 1: error of the estimate over the true rate [-].
    noise : mapping of str to ndarray of complex, shape (n_freq,)
        Estimate over the readings of each sensor [-].
    """

    freq_hz: FloatArray
    error: ComplexArray
    noise: Mapping[str, ComplexArray]

    def at(self, values: ComplexArray, freq_hz: FloatArray) -> ComplexArray:
        """Return one of its responses at other frequencies [Hz], that of the highest above it; shape (n_freq,)."""
        real, imaginary = (np.interp(freq_hz, self.freq_hz, part) for part in (values.real, values.imag))
        response: ComplexArray = real + 1j * imaginary
        return response


def filter_response(
    spec: FilterSpec, sensors: Mapping[str, Sensor], base_rate_hz: float, begin: float, end: float
) -> FilterResponse:
    """Return the responses of a filter of these sensors, as its gains are in the middle of what is judged.

    Parameters
    ----------
    spec : FilterSpec
        The filter, which believes something of every sensor.
    sensors : mapping of str to Sensor
        The instruments, noise-free here.
    base_rate_hz : float
        Base clock [Hz].
    begin, end : float
        From when until when it is judged, from its start on [s].

    Raises
    ------
    ValueError
        If the filter does not take these sensors, or is not linear: it adapts to what it reads.
    """
    # What is slower than the judged stretch is long does not show in it.
    length = min(max(end - begin, _SHORTEST), _LONGEST)
    t = np.arange(round(length * base_rate_hz)) / base_rate_hz
    pulse = _SIZE * np.exp(-0.5 * ((t - _AT) / _WIDTH) ** 2)
    ratio = {name: round(base_rate_hz / sensor.sample_rate) for name, sensor in sensors.items()}
    step = min(ratio.values())
    quiet = {name: np.zeros(pulse[:: ratio[name]].size) for name in sensors}
    seen = {
        name: sensor.model_copy(update={"noise": False}).start(base_rate_hz, 0, name).process(pulse)
        for name, sensor in sensors.items()
    }
    settled = _settled(spec, sensors, base_rate_hz, min(0.5 * (begin + end), _MOST_SETTLED))
    whole = _answer(settled, seen)
    twice = _answer(settled, {name: 2.0 * values for name, values in seen.items()})
    if np.max(np.abs(twice - 2.0 * whole)) > _LINEAR * np.max(np.abs(whole)):
        msg = f"{spec.type}: expected a linear filter, got one that adapts to what it reads and has no spectrum"
        raise ValueError(msg)
    fs = base_rate_hz / step
    freq: FloatArray = np.asarray(np.fft.rfftfreq(whole.size, 1.0 / fs), dtype=np.float64)
    known = (freq > 0.0) & (freq <= _HIGHEST_HZ)
    of_pulse = np.fft.rfft(pulse[::step])[known]

    def over_pulse(answer: FloatArray) -> ComplexArray:
        response: ComplexArray = np.fft.rfft(answer)[known] / of_pulse
        return response

    alone = {name: over_pulse(_answer(settled, {**quiet, name: pulse[:: ratio[name]]})) for name in sensors}
    return FilterResponse(freq[known], over_pulse(whole - pulse[::step]), alone)


def _settled(spec: FilterSpec, sensors: Mapping[str, Sensor], base_rate_hz: float, at: float) -> Any:
    """Return the filter as its gains are at a time [s], at rest."""
    rates = {name: sensor.sample_rate for name, sensor in sensors.items()}
    stage: Any = _ungated(spec).start(rates)
    samples = round(at * base_rate_hz)
    stage.process({name: np.zeros(round(samples * rate / base_rate_hz)) for name, rate in rates.items()})
    return stage


def _answer(settled: Any, readings: Mapping[str, FloatArray]) -> FloatArray:
    """Return the estimate for these readings."""
    estimate: FloatArray = deepcopy(settled).process(dict(readings)).rate
    return estimate


def _ungated(spec: FilterSpec) -> FilterSpec:
    """Return the filter without its gate: readings that rest for seconds are none of a sensor that works."""
    if "gate" not in getattr(type(spec.parameters), "model_fields", {}):
        return spec
    return replace(spec, parameters=spec.parameters.model_copy(update={"gate": False}))
