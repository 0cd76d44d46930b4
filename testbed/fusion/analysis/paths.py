r"""Two sensors made comparable: the readings of each through the dynamics of the other, on a common grid.

.. math:: a = G_2 z_1, \quad c = G_1 z_2

Both are :math:`G_1 G_2 \omega` and noise, whatever the rate is; where they differ beyond that noise, readings, stamps
or belief are wrong.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft, rfftfreq
from scipy.interpolate import CubicSpline

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from testbed.fusion.belief import SensorBelief
    from testbed.signals import FloatArray

# What the comparison is made at, at the most [Hz].
_GRID_HZ = 1000.0
# Readings that are missing for longer than this are not filled in [s].
_SHORT_GAP = 0.01
# Distance from the ends and from what is missing within which dynamics have not settled, then the rise of the weight
# [s]; of a short record a share of it.
_GUARD, _EDGE, _SHARE = 1.0, 1.0, 0.1


@dataclass(frozen=True)
class Trace:
    """Readings of a sensor with their times and what is believed.

    Parameters
    ----------
    t : ndarray, shape (n_time,)
        Seconds since the first stamp of the record, increasing [s].
    z : ndarray, shape (n_time,)
        Readings [rad/s], NaN where there is none.
    belief : SensorBelief
        Dynamics and noise.
    said : float, optional
        How many of the unit that was said of the readings are 1 rad/s [-].
    """

    t: FloatArray
    z: FloatArray
    belief: SensorBelief
    said: float = 1.0

    @cached_property
    def interval(self) -> float:
        """The usual time from one reading to the next [s]."""
        return float(np.median(np.diff(self.t)))

    def reading_noise(self, freq_hz: FloatArray) -> FloatArray:
        """Return the believed two-sided density of the noise on the readings [rad^2/s], for frequencies above 0 [Hz].

        White, slow and of the step of the readings.
        """
        one = self.belief
        step = (one.resolution or 0.0) ** 2 / 12.0 * self.interval
        walk = (one.rate_random_walk / (2.0 * np.pi * freq_hz)) ** 2
        inner = one.input_noise**2 + one.inner_slow_density(freq_hz) + walk
        power = np.abs(one.response(freq_hz)) ** 2
        density: FloatArray = power * inner + one.output_noise**2 + one.outer_slow_density(freq_hz) + step
        return density


class Grid:
    """A common grid of two traces.

    Parameters
    ----------
    first, second : Trace
        The sensors.
    """

    def __init__(self, first: Trace, second: Trace) -> None:
        begin, end = max(first.t[0], second.t[0]), min(first.t[-1], second.t[-1])
        self.sample_rate_hz = min(_GRID_HZ, 1.0 / first.interval, 1.0 / second.interval)
        n_time = max(int((end - begin) * self.sample_rate_hz), 0)
        self.t = begin + np.arange(n_time) / self.sample_rate_hz
        self._pad = min(n_time - 1, round(2.0 * self.sample_rate_hz))
        self._n = next_fast_len(n_time + 2 * self._pad, real=True)
        self._freq = rfftfreq(self._n, 1.0 / self.sample_rate_hz)

    @property
    def duration(self) -> float:
        """Length of what both have in common [s]."""
        return float(self.t.size / self.sample_rate_hz)

    def means(self, trace: Trace) -> int:
        """Return how many readings of a trace are taken together."""
        return max(1, int(0.5 * (1.0 + 1e-3) / (trace.interval * self.sample_rate_hz)))

    def noise(self, trace: Trace, freq_hz: FloatArray) -> FloatArray:
        """Return the believed density of the noise of a trace on this grid [rad^2/s], with what folds into it.

        Parameters
        ----------
        trace : Trace
            Of the sensor.
        freq_hz : ndarray, shape (n_freq,)
            Frequencies above zero, below half the grid's rate [Hz].
        """
        fs, end = self.sample_rate_hz, 0.5 / (self.means(trace) * trace.interval)
        density = trace.reading_noise(freq_hz)
        for k in range(1, int(end / fs + 1.0) + 1):
            for folded in (k * fs - freq_hz, k * fs + freq_hz):
                density = density + np.where(folded <= end, trace.reading_noise(folded), 0.0)
        return density

    def through(self, trace: Trace, other: SensorBelief) -> FloatArray:
        """Return the readings of a sensor through the dynamics of another one, shape (n_time,) [rad/s].

        Means of as many readings as fall on half a step, whose droop is taken out, a cubic spline between them, and the
        response on the whole record, continued beyond its ends in a mirror.

        Parameters
        ----------
        trace : Trace
            Of the sensor.
        other : SensorBelief
            The other one.
        """
        many = self.means(trace)
        good = np.isfinite(trace.z)
        z = trace.z if good.all() else np.interp(trace.t, trace.t[good], trace.z[good])
        n = z.size // many * many
        t, z = trace.t[:n].reshape(-1, many).mean(axis=1), z[:n].reshape(-1, many).mean(axis=1)
        value = CubicSpline(t, z)(np.clip(self.t, t[0], t[-1]))
        # What is constant was so for ever.
        level = float(value.mean())
        value -= level
        p = self._pad
        # In a mirror: turned about its end as well, a record that is cut at the crest of a swing would go on with twice
        # the crest as its mean, which slow dynamics remember for as long as they last.
        spectrum = rfft(np.concatenate([value[p:0:-1], value, value[-2 : -p - 2 : -1]]), self._n)
        spectrum *= other.response(self._freq) / _droop(self._freq, many, trace.interval)
        passed = level * other.numerator[-1] / other.denominator[-1]
        result: FloatArray = irfft(spectrum, self._n)[p : p + self.t.size] + passed
        return result

    def weight(self, *traces: Trace) -> FloatArray:
        """Return a weight from 0 to 1 that is 0 near the ends and near what is missing, shape (n_time,).

        Parameters
        ----------
        *traces : Trace
            Sensors that are to be there.
        """
        bad = np.zeros(self.t.size, dtype=bool)
        for trace in traces:
            there = trace.t[np.isfinite(trace.z)]
            longer = np.flatnonzero(np.diff(there) > max(_SHORT_GAP, 3.0 * trace.interval))
            for begin, end in zip(there[longer], there[longer + 1], strict=True):
                bad[np.searchsorted(self.t, begin) : np.searchsorted(self.t, end)] = True
        clear = _distance(bad) / self.sample_rate_hz
        short = _SHARE * self.duration
        x = np.clip((clear - min(_GUARD, short)) / min(_EDGE, short), 0.0, 1.0)
        smooth: FloatArray = x * x * (3.0 - 2.0 * x)
        return smooth


def _distance(bad: NDArray[np.bool_]) -> FloatArray:
    """Return how many samples away the next bad one, or an end, is."""
    n = bad.size
    at = np.arange(n)
    before = np.maximum.accumulate(np.where(bad, at, -1))
    after = np.minimum.accumulate(np.where(bad, at, n)[::-1])[::-1]
    nearest: FloatArray = np.minimum(at - before, after - at).astype(float)
    return nearest


def _droop(freq_hz: FloatArray, many: int, interval: float) -> FloatArray:
    """Return the response of the mean of so many readings [-], not below a fifth (where there is nothing to gain)."""
    if many == 1:
        return np.ones_like(freq_hz)
    x = np.pi * freq_hz * interval
    with np.errstate(invalid="ignore", divide="ignore"):
        value = np.sin(many * x) / (many * np.sin(x))
    value[0] = 1.0
    droop: FloatArray = np.maximum(value, 0.2)
    return droop
