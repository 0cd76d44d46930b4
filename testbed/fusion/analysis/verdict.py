"""What stands against a record before anything is estimated from it."""

from __future__ import annotations

from dataclasses import replace
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from testbed.errors import quoted
from testbed.fusion.analysis.comparison import Compared, compared, without_repeats
from testbed.fusion.analysis.continuity import continuity_findings
from testbed.fusion.analysis.finding import Finding, Verdict
from testbed.fusion.analysis.floor import loudness_findings, own_noise
from testbed.fusion.analysis.paths import Trace
from testbed.fusion.belief import check_belief

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from numpy.typing import ArrayLike, NDArray

    from testbed.fusion.belief import SensorBelief

# Readings to be judged at all.
_LEAST_READINGS = 100
# Where the sensors' noise is compared to find the cleanest [Hz].
_BAND_HZ = np.geomspace(1.0, 30.0, 16)
# Kinds of findings that another sensor would explain.
_OF_BELIEF = ("belief", "bandwidth", "axis")


def verdict(
    readings: Mapping[str, ArrayLike],
    time_ns: Mapping[str, NDArray[np.int64]],
    belief: Mapping[str, SensorBelief],
    said: Mapping[str, float] = MappingProxyType({}),
) -> Verdict:
    """Return what the readings contradict: each other, and what is believed of the sensors.

    Every sensor is compared with the one of least noise, and its noise with the belief. A finding is significant at
    1e-4 and above a tolerance (gain 1 %, offset 0.3 ms, rate 100 ppm, noise 1.5 times, a bias of 0.01 deg/s).

    Parameters
    ----------
    readings : mapping of str to array_like, shape (n_sensor_samples,)
        Readings of each sensor [rad/s]; not finite means no reading.
    time_ns : mapping of str to ndarray of int64, shape (n_sensor_samples,)
        Their stamps on whatever clocks [ns].
    belief : mapping of str to SensorBelief
        Dynamics and noise of each sensor.
    said : mapping of str to float, optional
        How many of the unit that was said of its readings, before they were turned into rad/s, are 1 rad/s, for what
        another unit would make of them [-]; 1 for the others.

    Returns
    -------
    Verdict
        Findings, and what this record cannot decide.

    Raises
    ------
    ValueError
        If a sensor has no belief, or not as many stamps as readings.

    Examples
    --------
    A gyro whose sign is turned, against one of less noise, both of 100 Hz:

    >>> import numpy as np
    >>> from testbed.fusion.belief import load_belief
    >>> like = {"numerator": [300.0], "denominator": [1.0, 300.0]}
    >>> belief = load_belief({"good": like | {"output_noise": 1e-5}, "turned": like | {"output_noise": 1e-4}})
    >>> noise, t = np.random.default_rng(1).normal(size=(2, 3000)), np.arange(3000) * 10_000_000
    >>> rate = 0.02 * np.sin(2.0 * np.pi * 0.7e-9 * t)
    >>> readings = {"good": rate + 1e-4 * noise[0], "turned": -rate + 1e-3 * noise[1]}
    >>> [(one.kind, one.sensor) for one in verdict(readings, {"good": t, "turned": t}, belief).findings]
    [('sign', 'turned')]
    """
    check_belief(belief, readings)
    traces = {name: replace(one, said=said.get(name, 1.0)) for name, one in _traces(readings, time_ns, belief).items()}
    few = [name for name, trace in traces.items() if np.count_nonzero(np.isfinite(trace.z)) < _LEAST_READINGS]
    undecided = [f"{name}: anything: it has fewer than {_LEAST_READINGS} readings" for name in few]
    kept = {name: trace for name, trace in traces.items() if name not in few}
    if not kept:
        return Verdict((), tuple(undecided))
    found = _judged(kept)
    if len(kept) == 2 and any(one.kind in _OF_BELIEF for one in found.findings):
        found = _exchanged(kept, found)
    return Verdict(found.findings, (*undecided, *found.undecided))


def _exchanged(traces: Mapping[str, Trace], found: Verdict) -> Verdict:
    """Return what stands against two sensors, or, if nothing would with each other's beliefs, that they are swapped."""
    (one, first), (other, second) = traces.items()
    swapped = _judged({one: replace(first, belief=second.belief), other: replace(second, belief=first.belief)})
    if swapped.findings:
        return found
    worst = next(finding for finding in found.findings if finding.kind in _OF_BELIEF)
    remedy = f"the readings of {one} are as is believed of {other}, and the other way round: exchange the two names"
    return Verdict((replace(worst, kind="swapped", remedy=remedy),), swapped.undecided)


def _judged(kept: Mapping[str, Trace]) -> Verdict:
    """Return what stands against sensors that have enough readings."""
    undecided: list[str] = []
    clean = min(kept, key=lambda name: _input_noise(kept[name]))
    noise = own_noise(without_repeats(kept[clean]))
    results = [compared((name, trace), (clean, kept[clean]), noise) for name, trace in kept.items() if name != clean]
    undecided += [reason for reason in results if isinstance(reason, str)]
    pairs = [pair for pair in results if isinstance(pair, Compared)]
    if len(pairs) > 1:
        pairs = _by_majority(pairs)
    findings = [finding for pair in pairs for finding in pair.findings]
    undecided += [text for pair in pairs for text in pair.undecided]
    factors = {name: factor for pair in pairs for name, factor in pair.factors.items()}
    if not results:
        undecided.append(
            f"{clean}: sign, unit, gain, offset, rate and bias: there is no other sensor to compare it with"
        )
    if not any(pair.apart for pair in pairs):
        findings += loudness_findings(clean, noise, factors.get(clean, 1.0))
    for name, trace in kept.items():
        findings += continuity_findings(name, trace, factors.get(name, 1.0))
    return Verdict(tuple(_once(findings)), tuple(undecided))


def even_stamps(readings: Mapping[str, ArrayLike], sample_rate_hz: Mapping[str, float]) -> dict[str, NDArray[np.int64]]:
    """Return the stamps of readings that are even and begin together [ns], shape (n_sensor_samples,) each.

    Parameters
    ----------
    readings : mapping of str to array_like, shape (n_sensor_samples,)
        Of each sensor.
    sample_rate_hz : mapping of str to float
        Rate of each [Hz].
    """
    return {
        name: np.rint(np.arange(np.size(values)) * (1e9 / sample_rate_hz[name])).astype(np.int64)
        for name, values in readings.items()
    }


def _traces(
    readings: Mapping[str, ArrayLike], time_ns: Mapping[str, NDArray[np.int64]], belief: Mapping[str, SensorBelief]
) -> dict[str, Trace]:
    """Return readings and times of each sensor, in order of the stamps; of equal stamps the first."""
    stamps: dict[str, NDArray[np.int64]] = {}
    for name, values in readings.items():
        if name not in time_ns or np.shape(values) != np.shape(time_ns[name]):
            got = np.shape(time_ns[name]) if name in time_ns else "none"
            msg = f"time_ns: expected the stamps of the {np.size(values)} readings of {quoted(name)}, got {got}"
            raise ValueError(msg)
        stamps[name] = np.asarray(time_ns[name], np.int64)
    first = min((int(one.min()) for one in stamps.values() if one.size), default=0)
    found = {}
    for name, values in readings.items():
        ordered, at = np.unique(stamps[name], return_index=True)
        found[name] = Trace(
            np.asarray((ordered - first) * 1e-9, np.float64), np.asarray(values, np.float64)[at], belief[name]
        )
    return found


def _input_noise(trace: Trace) -> float:
    """Return the mean logarithm of the believed noise, referred to the rate."""
    gain = np.abs(trace.belief.response(_BAND_HZ))
    density = trace.reading_noise(_BAND_HZ) / np.maximum(gain, 1e-30) ** 2
    return float(np.mean(np.log(np.maximum(density, 1e-300))))


def _by_majority(pairs: list[Compared]) -> list[Compared]:
    """Return the comparisons with what all contradict the cleanest sensor in said of that one, and what only some do of
    the others.
    """
    everywhere = set.intersection(*({finding.kind for finding in pair.findings} for pair in pairs))
    timed = not everywhere & {"sign", "offset", "rate"}
    scaled = not everywhere & {"gain", "axis"}
    return [replace(pair, names=replace(pair.names, timed=timed, scaled=scaled)) for pair in pairs]


def _once(findings: Iterable[Finding]) -> list[Finding]:
    """Return the first finding of each kind and sensor."""
    found: dict[tuple[str, str], Finding] = {}
    for one in findings:
        found.setdefault((one.sensor, one.kind), one)
    return list(found.values())
