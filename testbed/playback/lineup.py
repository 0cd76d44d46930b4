"""Reels side by side: the common time base, what lies outside of it, and the reference at its instants."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.interpolate import make_interp_spline

from testbed.errors import Problem, ScenarioError
from testbed.logs.clock import NANO
from testbed.runs.block import first_due
from testbed.signals import NORMAL_MEDIAN
from testbed.units import rate_unit

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from testbed.playback.reel import Reel
    from testbed.signals import FloatArray
    from testbed.units import RateUnit

FEWEST = 4
# As the filters take rates for whole multiples.
_SAME = 1e-9
# Instants that are one [ns].
_SAME_NS = 0.5
_BEFORE = 1.5
# Median of |a - b| over the standard deviation of a and b, both Gaussian.
_MEDIAN_STEP = NORMAL_MEDIAN * math.sqrt(2.0)
# Beyond this many steps of the reference from its nearest known samples there is no reference.
_REACH = 1.5


@dataclass(frozen=True)
class Lineup:
    """The sensors of a recording on one time base, which begins when all have begun.

    Parameters
    ----------
    rates : mapping of str to float
        Sample rate [Hz] of ``base``, that of the fastest sensor, and of every sensor.
    readings : mapping of str to ndarray, shape (n_sensor_samples,)
        Rates [rad/s], NaN where one is lost.
    references : mapping of str to ndarray, shape (n_time,), optional
        What is taken for the truth [rad/s] at the instants of ``base`` and of every sensor, NaN where it is not known.
    start_ns : int
        Where the time base begins, on the recording's own clock [ns].
    dropped : mapping of str to int
        Samples outside of it.
    stamps_ns : mapping of str to ndarray, shape (n_time,), optional
        Stamps [ns] after `start_ns` of ``base`` and of every sensor; None where the clocks are in whole ratios, and k /
        rate says all.
    """

    rates: Mapping[str, float]
    readings: Mapping[str, FloatArray]
    references: Mapping[str, FloatArray] | None
    start_ns: int
    dropped: Mapping[str, int]
    stamps_ns: Mapping[str, NDArray[np.int64]] | None = None

    @property
    def sensors(self) -> tuple[str, ...]:
        """Names of the sensors."""
        return tuple(self.readings)

    @property
    def n_time(self) -> int:
        """Number of samples of the base clock."""
        if self.stamps_ns is not None:
            return int(self.stamps_ns["base"].size)
        return max(values.size for values in self.readings.values())

    @property
    def duration(self) -> float:
        """Length of the time base [s]."""
        if self.stamps_ns is not None:
            return NANO * float(self.stamps_ns["base"][-1]) + 1.0 / self.rates["base"]
        return self.n_time / self.rates["base"]

    @property
    def rate_unit(self) -> RateUnit:
        """Unit in which every rate of a replay is shown, by what neighbouring readings differ."""
        return rate_unit(_noise(values) for values in self.readings.values())

    def times(self) -> dict[str, FloatArray]:
        """Return the stamps of ``base`` and of every sensor, shape (n_time,) [s]."""
        if self.stamps_ns is not None:
            return {name: (NANO * stamps).astype(np.float64) for name, stamps in self.stamps_ns.items()}
        found = {name: np.arange(values.size) / self.rates[name] for name, values in self.readings.items()}
        return {"base": np.arange(self.n_time) / self.rates["base"], **found}

    def first(self, name: str, start: int) -> int:
        """Return the index of the first reading of a sensor at or after a sample of the base clock.

        Parameters
        ----------
        name : str
            The sensor.
        start : int
            The sample; one past the last gives all that is left.
        """
        if self.stamps_ns is None:
            return first_due(start, self.rates["base"], self.rates[name])
        base, own = self.stamps_ns["base"], self.stamps_ns[name]
        return int(own.size if start >= base.size else np.searchsorted(own, base[start]))

    def clock_words(self) -> str:
        """Return how the clocks go together, for people."""
        base = self.rates["base"]
        others = [name for name in self.sensors if self.rates[name] != base]
        if self.stamps_ns is None:
            every = [f"{name} every {round(base / self.rates[name])}" for name in others]
            return ", ".join([f"{base:.9g} Hz", *every])
        stamped = [f"{name} at its own stamps, {self.rates[name]:.7g} Hz" for name in others]
        return ", ".join([f"the stamps of the fastest sensor, {base:.7g} Hz", *stamped])


def line_up(reels: Sequence[Reel], reference: Reel | None, file: str) -> Lineup:
    """Return the sensors of a recording on the clock of the fastest.

    Even clocks in whole ratios with an instant in common, but for the rounding of their stamps, begin at that instant
    and need no stamps; all others keep them.

    Parameters
    ----------
    reels : sequence of Reel
        Of the sensors.
    reference : Reel, optional
        What is taken for the truth.
    file : str
        The recording, for messages.

    Raises
    ------
    ScenarioError
        If the sensors have no time in common.
    """
    fastest = max(reels, key=lambda reel: reel.sample_rate_hz)
    _check_overlap(reels, fastest, file)
    strides = {reel.name: _stride(reel, fastest) for reel in reels}
    first = _first_common(reels, fastest, strides)
    if first is None:
        return _by_stamps(reels, fastest, reference)
    base = fastest.from_place(first)
    n_time = base.rate.size
    readings, dropped = {}, {}
    for reel in reels:
        stride = strides[reel.name]
        assert stride is not None
        skipped = (first - round(_offset(reel, fastest))) // stride
        readings[reel.name] = _fitted(reel.rate[skipped:], -(-n_time // stride))
        dropped[reel.name] = reel.doubled + skipped + max(reel.rate.size - skipped - readings[reel.name].size, 0)
    rates = {reel.name: _rate(reel, base, strides[reel.name] or 1) for reel in reels}
    references = None
    if reference is not None:
        known = at_instants(reference, base, n_time)
        references = {"base": known, **{name: known[:: strides[name]] for name in readings}}
    return Lineup({"base": base.sample_rate_hz, **rates}, readings, references, base.start_ns, dropped)


def _by_stamps(reels: Sequence[Reel], fastest: Reel, reference: Reel | None) -> Lineup:
    """Return the sensors at their own stamps, from where all have begun to the last of the fastest.

    A sensor has begun a step and a half before its first reading: of what was cut so nothing is cut another time.
    """
    all_stamps = {reel.name: reel.stamps() for reel in reels}
    begun = max(all_stamps[reel.name][0] - _BEFORE / (NANO * reel.sample_rate_hz) for reel in reels)
    clock = all_stamps[fastest.name]
    start, end = int(clock[np.searchsorted(clock, begun)]), int(clock[-1])
    readings, stamps_ns, dropped, references = {}, {}, {}, {}
    for reel in reels:
        stamps = all_stamps[reel.name]
        kept = slice(int(np.searchsorted(stamps, start)), int(np.searchsorted(stamps, end, side="right")))
        readings[reel.name], stamps_ns[reel.name] = reel.rate[kept], stamps[kept] - start
        dropped[reel.name] = reel.doubled + stamps.size - stamps_ns[reel.name].size
        if reference is not None:
            references[reel.name] = _interpolated(reference, (stamps[kept] - reference.start_ns).astype(np.float64))
    stamps_ns = {"base": stamps_ns[fastest.name], **stamps_ns}
    if reference is not None:
        references["base"] = references[fastest.name]
    rates = {"base": fastest.sample_rate_hz, **{reel.name: reel.sample_rate_hz for reel in reels}}
    return Lineup(rates, readings, references or None, start, dropped, stamps_ns)


def _noise(readings: FloatArray) -> float:
    """Return the standard deviation of white noise whose steps would be as large as those of the readings [rad/s]."""
    steps = np.abs(np.diff(readings[np.isfinite(readings)]))
    return float(np.median(steps)) / _MEDIAN_STEP if steps.size else 0.0


def _stride(reel: Reel, fastest: Reel) -> int | None:
    """Return how many steps of the fastest sensor a step is; None if that is no whole number."""
    if reel.stamps_ns is not None or fastest.stamps_ns is not None:
        return None
    stride = round(fastest.sample_rate_hz / reel.sample_rate_hz)
    return stride if math.isclose(stride * reel.sample_rate_hz, fastest.sample_rate_hz, rel_tol=_SAME) else None


def _offset(reel: Reel, fastest: Reel) -> float:
    """Return where a reel begins, in steps of the fastest sensor."""
    return (reel.start_ns - fastest.start_ns) * NANO * fastest.sample_rate_hz


def _first_common(reels: Sequence[Reel], fastest: Reel, strides: Mapping[str, int | None]) -> int | None:
    """Return the first step of the fastest sensor at which all have a sample; None if there is none."""
    places = []
    for reel in reels:
        stride, offset = strides[reel.name], _offset(reel, fastest)
        rounding = (reel.quantum_ns + fastest.quantum_ns) * NANO * fastest.sample_rate_hz
        if stride is None or abs(offset - round(offset)) > rounding:
            return None
        places.append((round(offset), stride))
    begin = max(0, *(offset for offset, _ in places))
    cycle = math.lcm(*(stride for _, stride in places))
    found = (step for step in range(begin, begin + cycle) if all((step - at) % stride == 0 for at, stride in places))
    return next(found, None)


def _rate(reel: Reel, base: Reel, stride: int) -> float:
    """Return the sample rate of a reel [Hz]: as it was said, else that of the base clock divided."""
    return reel.sample_rate_hz if reel.stated else base.sample_rate_hz / stride


def _fitted(values: FloatArray, n_time: int) -> FloatArray:
    """Return so many samples: what is beyond is left out, what is not there is lost."""
    kept: FloatArray = np.full(n_time, np.nan)
    there = min(n_time, values.size)
    kept[:there] = values[:there]
    return kept


def _check_overlap(reels: Sequence[Reel], fastest: Reel, file: str) -> None:
    ends = {reel.name: (reel.start_ns, reel.start_ns + float(reel.times_ns()[-1])) for reel in reels}
    begin, end = max(start for start, _ in ends.values()), min(stop for _, stop in ends.values())
    if end - begin < FEWEST / (NANO * fastest.sample_rate_hz):
        spans = ", ".join(f"{name} {NANO * a:.9g} to {NANO * b:.9g} s" for name, (a, b) in ends.items())
        message = f"expected sensors that were recorded at the same time, got {spans}: a map's time.offset moves one"
        raise ScenarioError([Problem(message, file=file)])


def at_instants(reference: Reel, base: Reel, n_time: int) -> FloatArray:
    """Return a reference at the instants of the base clock, shape (n_time,) [rad/s]: its own samples where they fall
    there, else by a cubic spline; NaN where it is not known.

    Parameters
    ----------
    reference, base : Reel
        Both on the recording's clock.
    n_time : int
        Instants wanted.
    """
    offset = base.start_ns - reference.start_ns
    if reference.stamps_ns is None and base.stamps_ns is None:
        ratio = reference.sample_rate_hz / base.sample_rate_hz
        place = offset * NANO * reference.sample_rate_hz
        rounding = (reference.quantum_ns + base.quantum_ns) * NANO * reference.sample_rate_hz
        whole = round(ratio)
        same = whole >= 1 and math.isclose(ratio, whole, rel_tol=_SAME) and abs(place - round(place)) <= rounding
        if same and place > -0.5:
            return _fitted(reference.rate[round(place) :: whole], n_time)
    return _interpolated(reference, base.times_ns()[:n_time] + offset)


def _interpolated(reference: Reel, wanted: FloatArray) -> FloatArray:
    """Return the reference at instants [ns] by a spline through each stretch without a gap: what is lost reaches no
    further, and between two samples one of which is lost nothing is known.
    """
    known = np.isfinite(reference.rate)
    times, rate = reference.times_ns()[known], reference.rate[known]
    found = np.full(wanted.size, np.nan)
    gaps = np.flatnonzero(np.diff(times) > _REACH / (NANO * reference.sample_rate_hz)) + 1
    for first, stop in itertools.pairwise([0, *gaps.tolist(), times.size]):
        if stop - first < 2:
            continue
        inside = slice(
            int(np.searchsorted(wanted, times[first] - _SAME_NS)),
            int(np.searchsorted(wanted, times[stop - 1] + _SAME_NS)),
        )
        spline = make_interp_spline(times[first:stop], rate[first:stop], k=min(3, stop - first - 1))
        found[inside] = spline(wanted[inside])
    return found
