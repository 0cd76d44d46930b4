"""A frequency of the signal that does not depend on its amplitude, in place of N_k: by increments, and by comparing two
sensors.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from testbed.signals import BLOCK, Recursion

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import ArrayLike

    from testbed.fusion.belief import SensorBelief
    from testbed.signals import FloatArray

# Lags [s] of the increments, each four times the one before: from 0.12 Hz (a sixteenth of a turn in the longest) to 1
# kHz.
LAGS_S = tuple(0.5e-3 * 4.0**i for i in range(6))
# Time constant of the means [s], and signal over noise, by energy, from which a lag is used.
MEMORY_S, MARGIN = 1.0, 1.0
# A mean says something once it holds this share of the readings that it holds in the long run: before, and soon after a
# gap has begun, the noise of a few readings passes for a signal of any frequency.
ENOUGH = 0.1
FREQUENCY = "frequency_"
# A lag is long enough once the signal turns by this angle in it [rad]; the next shorter one then sees at least a
# quarter of a turn less.
_TURN = np.pi / 8.0
# No sensor turns as fast: such a reading is none [rad/s].
_LARGEST = 1e6
_GRID_HZ = np.geomspace(1e-3, 1e3, 1201)
# The believed noise is integrated over these frequencies.
_NOISE_HZ = np.concatenate([[0.0], np.geomspace(1e-4, 1e4, 4001)])


def energies(z: FloatArray, lag: int) -> tuple[FloatArray, FloatArray]:
    r"""Return the Teager-Kaiser energies of a record and of its increments over `lag`; the first 3 lag values have
    none.

    .. math:: \Psi_k = z_{k-L}^2 - z_k z_{k-2L} = A^2 \sin^2 \theta, \quad
        \Psi^d_k = d_{k-L}^2 - d_k d_{k-2L} = 4 A^2 \sin^2(\theta/2) \sin^2 \theta, \quad d_k = z_k - z_{k-L}

    for z = A sin(2 pi f t + phi) and theta = 2 pi f L T: constant, without the ripple of z^2. A constant c in z leaves
    their mean over many periods alone, but makes the first ripple by c A.

    Parameters
    ----------
    z : ndarray, shape (n_time,)
        Readings [rad/s].
    lag : int
        L, in readings.

    Returns
    -------
    tuple of two ndarray, shape (n_time - 3 lag,)
        Both energies [rad^2/s^2].

    References
    ----------
    Kaiser, ICASSP 1990, 381-384 (the energy); Maragos, Kaiser, Quatieri, IEEE Trans. Signal Processing 41 (1993)
    3024-3051 (its ratio).
    """
    a, b, c, d = (z[3 * lag - i * lag : z.size - i * lag] for i in range(4))
    return b * b - a * c, (b - c) ** 2 - (a - b) * (c - d)


def turn(of_signal: ArrayLike, of_increments: ArrayLike) -> FloatArray:
    r"""Return the angle per lag [rad] from the ratio of the energies, :math:`\theta = 2 \arcsin(\sqrt{\Psi^d / \Psi} /
    2)`.

    Parameters
    ----------
    of_signal, of_increments : array_like
        Energies of `energies`, or their means less those of the noise [rad^2/s^2].

    Returns
    -------
    ndarray, of that shape
        Angle [rad], 0 to pi; NaN where either is not above zero.
    """
    ours, theirs = np.asarray(of_signal, float), np.asarray(of_increments, float)
    defined = (ours > 0.0) & (theirs > 0.0)
    ratio = np.divide(theirs, ours, out=np.full(ours.shape, np.nan), where=defined)
    return np.asarray(2.0 * np.arcsin(np.minimum(0.5 * np.sqrt(ratio), 1.0)))


def noise_energies(belief: SensorBelief, sample_rate_hz: float, lag: int) -> tuple[float, float]:
    """Return the mean energies [rad^2/s^2] that the believed noise alone has at `lag`, for the signal and for its
    increments.

    With r_i the autocovariance of the noise at i lags: r_0 - r_2 and 2 r_0 - r_1 - 2 r_2 + r_3.

    Parameters
    ----------
    belief : SensorBelief
        Noise before and behind the sensor's response.
    sample_rate_hz : float
        Rate of the readings [Hz].
    lag : int
        In readings.

    Returns
    -------
    tuple of float
        Of the signal and of its increments [rad^2/s^2].
    """
    density = np.abs(belief.realisation().response(_NOISE_HZ)) ** 2 * belief.input_noise**2
    angle = 2.0 * np.pi * _NOISE_HZ * lag / sample_rate_hz
    r = [2.0 * float(np.trapezoid(density * np.cos(i * angle), _NOISE_HZ)) for i in range(4)]
    r[0] += belief.output_noise**2 * sample_rate_hz
    return r[0] - r[2], 2.0 * r[0] - r[1] - 2.0 * r[2] + r[3]


def fits_lags(sample_rate_hz: float) -> bool:
    """Return whether every lag is a whole number of readings at that rate [Hz]."""
    lags = sample_rate_hz * np.array(LAGS_S)
    return bool(lags[0] > 0.5 and np.allclose(np.rint(lags), lags, rtol=1e-9, atol=0.0))


@dataclass(frozen=True)
class FrequencyBlock:
    """Frequencies over a block, NaN where no signal stands above the noise, or too few readings are known to tell.

    Parameters
    ----------
    by_increments : dict of str to ndarray, shape (n_sensor_samples,)
        From each sensor alone [Hz].
    by_sensors : ndarray, shape (n_slow_samples,)
        From the ratio of both sensors' energies, at the readings of the slower one [Hz].
    """

    by_increments: dict[str, FloatArray]
    by_sensors: FloatArray


class _Energies:
    """Fading means of the energies of one sensor at all lags, the noise's taken off."""

    def __init__(self, belief: SensorBelief, sample_rate_hz: float, memory: float, margin: float) -> None:
        self.lags = [round(sample_rate_hz * lag) for lag in LAGS_S]
        if not fits_lags(sample_rate_hz):
            msg = f"sample_rate_hz: expected a multiple of {1.0 / LAGS_S[0]:g} Hz, got {sample_rate_hz:g}"
            raise ValueError(msg)
        self._seconds = np.array(LAGS_S)
        self._noise = [noise_energies(belief, sample_rate_hz, lag) for lag in self.lags]
        self._margin = margin
        keep = float(np.exp(-1.0 / (sample_rate_hz * memory)))
        self._enough = ENOUGH / (1.0 - keep)
        self._past = np.full(3 * self.lags[-1], np.nan)
        # Of the means of each lag, and of the readings: their values and how many there are.
        b, a = np.array([1.0, 0.0]), np.array([1.0, -keep])
        self._fading = [[Recursion(b, a) for _ in range(3)] for _ in range(len(self.lags) + 1)]

    def process(self, z: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the corrected energies of signal and increments, shape (n_lag, n_time) [rad^2/s^2]; NaN before the
        first.
        """
        z = np.concatenate([self._past, self._less_level(np.where(np.abs(z) < _LARGEST, z, np.nan))])
        n = z.size - self._past.size
        means = np.empty((2, len(self.lags), n))
        for i, (lag, noise) in enumerate(zip(self.lags, self._noise, strict=True)):
            pair = energies(z[self._past.size - 3 * lag :], lag)
            there = np.isfinite(pair[0]) & np.isfinite(pair[1])
            weight = self._fading[i][2].process(there.astype(float))
            for j in range(2):
                total = self._fading[i][j].process(np.where(there, pair[j], 0.0))
                means[j, i] = np.divide(total, weight, out=np.full(n, np.nan), where=weight > self._enough) - noise[j]
        self._past = z[n:]
        return means[0], means[1]

    def _less_level(self, z: FloatArray) -> FloatArray:
        """Return readings less their fading mean: a filter leaves a line its frequency, and no constant remains."""
        there = np.isfinite(z)
        weight = self._fading[-1][0].process(there.astype(float))
        total = self._fading[-1][1].process(np.where(there, z, 0.0))
        level: FloatArray = np.divide(total, weight, out=np.zeros(z.size), where=there)
        return z - level

    def choose(self, signal: FloatArray, increments: FloatArray) -> tuple[np.ndarray, FloatArray]:
        """Return the lag used (-1 for none) and the frequency [Hz]: the shortest long enough, or else the longest that
        sees the signal.
        """
        lag, frequency = np.full(signal.shape[1], -1), np.full(signal.shape[1], np.nan)
        for i in reversed(range(len(self.lags))):
            angle = turn(signal[i], increments[i])
            seen = (signal[i] > self._margin * self._noise[i][0]) & (increments[i] > self._margin * self._noise[i][1])
            use = seen & ((angle >= _TURN) | (lag < 0))
            lag[use] = i
            frequency[use] = angle[use] / (2.0 * np.pi * self._seconds[i])
        return lag, frequency


class FrequencyRows:
    """The frequency that each sensor sees by itself, by increments, beside the diagnostics of a filter.

    Sensors whose rate does not fit the lags, a multiple of 2 kHz, have none.

    Parameters
    ----------
    belief : mapping of str to SensorBelief
        Noise of each sensor.
    sample_rate_hz : mapping of str to float
        Their rates [Hz], in whole ratios.
    """

    def __init__(self, belief: Mapping[str, SensorBelief], sample_rate_hz: Mapping[str, float]) -> None:
        fastest = max(sample_rate_hz.values(), default=1.0)
        self._sensors = {
            name: (_Energies(belief[name], rate, MEMORY_S, MARGIN), round(fastest / rate))
            for name, rate in sample_rate_hz.items()
            if fits_lags(rate)
        }
        self._sample = 0

    def process(self, readings: Mapping[str, FloatArray], n_time: int) -> dict[str, FloatArray]:
        """Return ``frequency_<sensor>`` over the next block [Hz], NaN between readings and without a signal.

        Parameters
        ----------
        readings : mapping of str to ndarray, shape (n_sensor_samples,)
            Readings that are due in the block [rad/s]; not finite means none.
        n_time : int
            Its length, at the fastest rate.
        """
        rows = self.blank(n_time)
        for name, (means, stride) in self._sensors.items():
            row = rows[f"{FREQUENCY}{name}"][-self._sample % stride :: stride]
            for first in range(0, row.size, BLOCK):
                part = slice(first, first + BLOCK)
                _, row[part] = means.choose(*means.process(readings[name][part]))
        self._sample += n_time
        return rows

    def blank(self, n_time: int) -> dict[str, FloatArray]:
        """Return a block of that length in which all is undefined."""
        return {f"{FREQUENCY}{name}": np.full(n_time, np.nan) for name in self._sensors}


class FrequencyIndicator:
    r"""Frequency of the signal from two sensors, online, the same for every amplitude.

    By increments, from each sensor alone: the ratio of two energies at one lag, :math:`f = \theta / (2 \pi L T)`. By
    comparing both sensors: :math:`\Psi_a / \Psi_b = |H_a(f)|^2 / |H_b(f)|^2`, solved for f with the believed responses,
    over the frequencies where that ratio rises. Energies are means with an exponential memory, less what
    the believed noise adds; the readings are taken less their own mean of that memory.

    Parameters
    ----------
    belief : mapping of str to SensorBelief
        Response and noise of both sensors.
    sample_rate_hz : mapping of str to float
        Their rates [Hz], multiples of 2 kHz; the faster a multiple of the slower.
    memory : float, optional
        Time constant of the means [s].
    margin : float, optional
        Signal over noise, by energy, from which a lag is used.

    Raises
    ------
    ValueError
        If there are not two sensors, a rate does not fit the lags, or memory or margin is out of range.
    """

    def __init__(
        self,
        belief: Mapping[str, SensorBelief],
        sample_rate_hz: Mapping[str, float],
        *,
        memory: float = MEMORY_S,
        margin: float = MARGIN,
    ) -> None:
        if not (memory > 0.0 and margin >= 0.0):
            msg = f"memory, margin: expected above 0 s and at least 0, got {memory:g} and {margin:g}"
            raise ValueError(msg)
        if len(sample_rate_hz) != 2:
            msg = f"sample_rate_hz: expected two sensors, got {list(sample_rate_hz)}"
            raise ValueError(msg)
        self._slow, self._fast = sorted(sample_rate_hz, key=lambda name: sample_rate_hz[name])
        self._stride = round(sample_rate_hz[self._fast] / sample_rate_hz[self._slow])
        self._sensors = {name: _Energies(belief[name], rate, memory, margin) for name, rate in sample_rate_hz.items()}
        gain = {name: np.abs(belief[name].realisation().response(_GRID_HZ)) ** 2 for name in sample_rate_hz}
        self._log_ratio, self._log_freq = _rising(np.log(gain[self._fast] / gain[self._slow]), np.log(_GRID_HZ))
        self._sample = 0

    def process(self, readings: Mapping[str, ArrayLike]) -> FrequencyBlock:
        """Use the next block of readings.

        Parameters
        ----------
        readings : mapping of str to array_like, shape (n_sensor_samples,)
            Readings that are due in the block [rad/s], the first of all sensors at the same time; not finite means
            none.

        Returns
        -------
        FrequencyBlock
            Frequencies [Hz].
        """
        found = {name: one.process(np.asarray(readings[name], float)) for name, one in self._sensors.items()}
        chosen = {name: one.choose(*found[name]) for name, one in self._sensors.items()}
        at = slice(-self._sample % self._stride, None, self._stride)
        self._sample += found[self._fast][0].shape[1]
        fast, slow = found[self._fast][0][:, at], found[self._slow][0]
        used = np.where(chosen[self._slow][0] >= 0, chosen[self._fast][0][at], -1)
        ratio = np.full(used.size, np.nan)
        for i in range(len(LAGS_S)):
            both = (used == i) & (slow[i] > 0.0) & (fast[i] > 0.0)
            ratio[both] = fast[i][both] / slow[i][both]
        by_sensors = np.exp(np.interp(np.log(ratio), self._log_ratio, self._log_freq, left=np.nan, right=np.nan))
        return FrequencyBlock({name: freq for name, (_, freq) in chosen.items()}, by_sensors)


def _rising(ratio: FloatArray, freq: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the longest stretch over which `ratio` rises strictly, and its `freq`."""
    breaks = np.flatnonzero(np.diff(ratio) <= 0.0)
    starts, ends = np.concatenate([[0], breaks + 1]), np.concatenate([breaks, [ratio.size - 1]])
    longest = int(np.argmax(ends - starts))
    stretch = slice(int(starts[longest]), int(ends[longest]) + 1)
    return ratio[stretch], freq[stretch]
