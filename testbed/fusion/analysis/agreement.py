r"""How far two sensors agree: gain, offset and rate of one against the other, by weighted least squares.

.. math:: a(t) = \kappa\, c(t - d(t)) + n(t), \quad d(t) = d_0 + \epsilon (t - t_m)

a is the noisy path, c the clean one (`testbed.fusion.analysis.paths`), n of the believed density by frequency, scaled
by what the residual shows of it. Regressed the other way the noise would pass for signal, and the gain read too small.
What noise the clean path has is taken off the normal equations.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.fft import irfft, rfft, rfftfreq

from testbed.fusion.analysis.finding import QUANTILE
from testbed.fusion.analysis.paths import Grid, Trace

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from testbed.signals import ComplexArray, FloatArray

# The search for a shift: longest, and the largest rate [s], [-]; segments of the record [s].
_LONGEST, _FASTEST, _SEGMENT = 0.5, 0.01, 2.0
# The part that a long record is begun with: what is left of its rate turns the whole by a fraction of a period.
_PART = 0.25
# Shifts whose likelihood is this close to the best one's are told apart by their size alone.
_TIE = 0.03
# What the dynamics remember from before the record, in a pole beside a zero at 0.02 Hz, is below.
_LOWEST_HZ, _HIGHEST_SHARE = 0.3, 0.4
_STEPS, _WEIGHINGS = 8, 3
# Enough of a band for the median of its residual to tell the scale of the noise.
# Share of the motion below which an octave holds what the ends of the record leave of the others: 1 % of their size.
_LEAST_SHARE = 1e-4
_LEAST_LINES = 8
# Of the clean path's power at most this share may be noise, and the gain must stand out this far [std], for a motion to
# be common: the search alone finds 5.
_MOST_NOISE, _STANDS_OUT = 0.05, 10.0
# Of a motion that both feel each shows this much at least, whatever its gain is by mistake short of its unit.
_FOLLOWS = 0.5


@dataclass(frozen=True)
class Agreement:
    """What makes a noisy sensor's readings those of a clean one.

    Parameters
    ----------
    gain : float
        kappa, of the noisy sensor over the clean one's [-].
    offset, rate : float
        d_0, by how much the noisy one's stamps are late in the middle of the record [s], and epsilon, how fast they
        run [-].
    middle : float
        t_m [s].
    covariance : ndarray, shape (3, 3)
        Of the three, by noise.
    common : bool
        A motion shows in both; nothing else here means anything without.
    swing : float
        Root mean square angular frequency of what the fit rests on [rad/s].
    ambiguity : float
        The least further shift that would look the same [s]; infinite if there is none.
    departure : float
        The largest |a / (kappa c) - 1| of an octave [-] that is significant at 1e-4, 0 if none is.
    departs_at : float
        The middle of that octave [Hz].
    moved : tuple of bool
        Whether most of what the noisy path, and the clean one, show stands out of its noise as lines do.
    powers : tuple of float
        Of the two, under one weight.
    own : float
        Share of the noisy path's power beyond noise that does not follow the clean one [-].
    """

    gain: float
    offset: float
    rate: float
    middle: float
    covariance: FloatArray
    common: bool
    swing: float
    ambiguity: float
    departure: float
    departs_at: float
    moved: tuple[bool, bool] = (False, False)
    powers: tuple[float, float] = (0.0, 0.0)
    own: float = 0.0

    @property
    def misses(self) -> tuple[bool, bool]:
        """Whether the noisy one lacks half or more of what the clean one shows, and the other way round."""
        most = abs(self.gain) + QUANTILE * math.sqrt(self.covariance[0, 0])
        noisy, clean = self.powers
        return most < _FOLLOWS, clean < _FOLLOWS**2 * noisy


class _Fit(NamedTuple):
    """kappa, kappa d_0 and kappa epsilon, their covariance, and what `Agreement` says of the rest."""

    theta: FloatArray
    covariance: FloatArray
    share: float
    moved: tuple[bool, bool]
    powers: tuple[float, float]
    own: float
    swing: float
    departure: float
    departs_at: float


class Pair:
    """A noisy and a clean sensor over what both have in common.

    Parameters
    ----------
    noisy, clean : Trace
        The sensors.
    """

    def __init__(self, noisy: Trace, clean: Trace) -> None:
        self.noisy, self.clean = noisy, clean
        self.grid = Grid(noisy, clean)
        fs = self.grid.sample_rate_hz
        freq = rfftfreq(self.grid.t.size, 1.0 / fs)
        self._used = (freq >= _LOWEST_HZ) & (freq <= _HIGHEST_SHARE * fs)
        self._freq = freq[self._used]
        self._octave = np.floor(np.log2(self._freq)).astype(int)
        self._a_noise = np.abs(clean.belief.response(self._freq)) ** 2 * self.grid.noise(noisy, self._freq)
        self._c_noise = np.abs(noisy.belief.response(self._freq)) ** 2 * self.grid.noise(clean, self._freq)
        self.c = self.grid.through(clean, noisy.belief)

    def put_right(self, offset: float, rate: float, middle: float) -> Trace:
        """Return the noisy trace with its stamps put right."""
        t = self.noisy.t
        return replace(self.noisy, t=t - offset - rate * (t - middle))

    def path(self, noisy: Trace) -> FloatArray:
        """Return a [rad/s], shape (n_time,), of the noisy trace with whatever stamps."""
        return self.grid.through(noisy, self.clean.belief)

    def mean_std(self, weight: FloatArray) -> float:
        """Return the believed standard deviation of the mean of a - c under a weight that sums to one [rad/s]."""
        fs = self.grid.sample_rate_hz
        freq = np.geomspace(1e-6, 0.5 * fs * float(np.sum(weight**2)), 200)
        pairs = (self.noisy, self.clean.belief), (self.clean, self.noisy.belief)
        density = sum(np.abs(by.response(freq)) ** 2 * one.reading_noise(freq) for one, by in pairs)
        return math.sqrt(2.0 * float(np.trapezoid(density, freq)))

    def agreement(self) -> Agreement:
        """Return what makes the two agree: a search over all shifts, then Gauss-Newton steps."""
        middle = float(self.grid.t[self.grid.t.size // 2])
        offset, rate, gain, ambiguity = self._from_a_part(middle) or self._searched(middle)
        for _ in range(_STEPS):
            found = self._fitted(self.put_right(offset, rate, middle), middle, gain)
            gain = float(found.theta[0])
            step = found.theta[1:] / gain
            offset, rate = offset + float(step[0]), rate + float(step[1])
            if abs(step[0]) + abs(step[1]) * self.grid.duration < 1e-7:
                break
        scale = np.diag([1.0, 1.0 / gain, 1.0 / gain])
        covariance = scale @ found.covariance @ scale
        common = found.share < _MOST_NOISE and abs(gain) > _STANDS_OUT * math.sqrt(covariance[0, 0])
        # Steps that lead far beyond all that was searched follow no motion.
        common = common and abs(offset) < 2.0 * _LONGEST and abs(rate) < 2.0 * _FASTEST
        shape = (found.departure, found.departs_at, found.moved, found.powers, found.own)
        return Agreement(gain, offset, rate, middle, covariance, common, found.swing, ambiguity, *shape)

    def _fitted(self, noisy: Trace, middle: float, gain: float) -> _Fit:
        w, span = self.grid.weight(noisy, self.clean), self.grid.t - middle
        power = float(np.sum(w * w))
        y, X = self._columns(self.path(noisy), w, span)
        density = power / self.grid.sample_rate_hz * (self._a_noise + self._c_noise)
        # In each path by itself: noise that is off by a factor, or in another unit, shows in the residual.
        scale = np.full(density.size, max(gain * gain, 1.0))
        for _ in range(_WEIGHINGS):
            # Each line of a one-sided spectrum stands for two; its real part has half the variance.
            weight = 2.0 / (scale * density)
            normal: FloatArray = np.real((X.conj() * weight) @ X.T)
            noise = self._own_noise(weight, power / self.grid.sample_rate_hz, float(np.sum((w * span) ** 2)) / power)
            share = float(noise[0, 0] / normal[0, 0])
            inverse = np.asarray(np.linalg.inv(normal - noise if share < _MOST_NOISE else normal), np.float64)
            theta: FloatArray = inverse @ np.real((X.conj() * weight) @ y)
            fitted: ComplexArray = theta @ X
            scale = self._scale(y - fitted, density)
        swing = math.sqrt(normal[1, 1] / normal[0, 0])
        # What the weight leaves of the record.
        inverse *= w.size * float(np.sum(w**4)) / power**2
        moved = self._moved(y, self._a_noise, weight), self._moved(X[0], self._c_noise, weight)
        total = float(np.sum(weight * np.abs(y) ** 2))
        # Noise leaves two of each line, and what that scatters by is no motion.
        left = float(np.sum(weight * np.abs(y - fitted) ** 2)) - 2.0 * y.size - QUANTILE * 2.0 * math.sqrt(y.size)
        own = left / max(total - 2.0 * y.size, abs(left), 1e-300)
        shares = share, moved, (total, float(normal[0, 0])), own
        return _Fit(theta, inverse, *shares, swing, *self._departure(y - fitted, fitted, weight))

    def _columns(self, a: FloatArray, w: FloatArray, span: FloatArray) -> tuple[ComplexArray, ComplexArray]:
        """Return the spectra of a, and of c with its derivatives by offset and rate, shapes (n_freq,), (3, n_freq)."""
        fs = self.grid.sample_rate_hz
        # A constant would leak from under the weight into what is compared.
        a, c = (one - np.sum(w * one) / max(float(np.sum(w)), 1e-300) for one in (a, self.c))
        slope = np.gradient(self.c, 1.0 / fs)
        columns = (a, c, -slope, -span * slope)
        spectra: ComplexArray = np.array([rfft(w * one)[self._used] for one in columns], np.complex128) / fs
        return spectra[0], spectra[1:]

    def _own_noise(self, weight: FloatArray, power: float, spread: float) -> FloatArray:
        """Return what the clean path's noise adds to the normal equations, shape (3, 3)."""
        own = weight * self._c_noise * power
        swung = float(np.sum(own * (2.0 * np.pi * self._freq) ** 2))
        return np.diag([float(own.sum()), swung, swung * spread])

    def _scale(self, residual: ComplexArray, density: FloatArray) -> FloatArray:
        """Return the residual's density over the believed one, by the median over octaves, which lines do not move."""
        ratio = np.abs(residual) ** 2 / density / math.log(2.0)
        scale = np.full_like(ratio, np.median(ratio))
        for octave in np.unique(self._octave):
            mine = self._octave == octave
            if np.count_nonzero(mine) >= _LEAST_LINES:
                scale[mine] = max(float(np.median(ratio[mine])), 1e-12)
        return scale

    def _moved(self, path: ComplexArray, noise: FloatArray, weight: FloatArray) -> bool:
        """Return whether lines are most of a path, beside noise of whatever size."""
        like_noise = float(np.sum(weight * self._scale(path, noise) * noise))
        return like_noise < _FOLLOWS * float(np.sum(weight * np.abs(path) ** 2))

    def _departure(self, residual: ComplexArray, fitted: ComplexArray, weight: FloatArray) -> tuple[float, float]:
        """Return the largest significant departure of an octave that holds motion, and its frequency [Hz]."""
        worst, at = 0.0, math.nan
        power = np.abs(fitted) ** 2
        for octave in np.unique(self._octave):
            mine = self._octave == octave
            if power[mine].sum() < _LEAST_SHARE * power.sum():
                continue
            information = float(np.sum(weight[mine] * np.abs(fitted[mine]) ** 2))
            found = abs(np.sum(weight[mine] * fitted[mine].conj() * residual[mine])) / information
            # The square of a complex normal is exponential: ln 1e4.
            if found > worst and found**2 > 2.0 * math.log(1e4) / information:
                worst, at = float(found), 2.0 ** (float(octave) + 0.5)
        return worst, at

    def _from_a_part(self, middle: float) -> tuple[float, float, float, float] | None:
        """Return what `_searched` does, from the beginning of a long record, of which the search does not reach all
        rates; None of a short one, and where nothing is common. Loggers begin together.
        """
        if self.grid.duration <= 2.0 * _LONGEST / _FASTEST:
            return None
        begin = float(self.grid.t[0])
        end = begin + _PART * self.grid.duration
        found = Pair(*(_cut(one, begin, end) for one in (self.noisy, self.clean))).agreement()
        if not found.common:
            return None
        return found.offset + found.rate * (middle - found.middle), found.rate, found.gain, found.ambiguity

    def _searched(self, middle: float) -> tuple[float, float, float, float]:
        """Return offset [s], rate and gain of the best shift, and the least further one that is as good [s]."""
        cross, norm, at = self._correlations(middle)
        fs, lags = self.grid.sample_rate_hz, cross.shape[1] // 2
        reach = max(float(np.abs(at).max(initial=0.0)), 1.0)
        most = math.ceil(min(_FASTEST, _LONGEST / reach) * reach * fs)
        rates = np.arange(-most, most + 1) / (reach * fs)
        moved = np.clip(np.rint(np.outer(rates, at) * fs).astype(int), -lags, lags)
        padded = np.pad(cross, ((0, 0), (lags, lags)))
        total = np.zeros((rates.size, 2 * lags + 1))
        for i, shifts in enumerate(moved):
            for row, k in zip(padded, shifts, strict=True):
                total[i] += row[lags + k : 3 * lags + k + 1]
        good = np.argwhere(np.abs(total) >= (1.0 - _TIE) * np.abs(total).max())
        offset, rate = (good[:, 1] - lags) / fs, rates[good[:, 0]]
        # Loggers begin together: the shift at the first stamp, and that of the last against it.
        chosen = int(np.argmin(np.abs(offset - rate * reach) + np.abs(rate) * reach))
        line = np.abs(total[good[chosen, 0]]) >= (1.0 - _TIE) * np.abs(total).max()
        gain = float(total[tuple(good[chosen])]) / norm
        return float(offset[chosen]), float(rate[chosen]), gain, _next_peak(line, int(good[chosen, 1])) / fs

    def _correlations(self, middle: float) -> tuple[FloatArray, float, FloatArray]:
        """Return the correlation of a and c in each segment over lags, that of c with itself, and the segments' times
        from the middle [s].
        """
        fs, w, a = self.grid.sample_rate_hz, self.grid.weight(self.noisy, self.clean), self.path(self.noisy)
        n = min(round(_SEGMENT * fs), a.size)
        begins = np.arange(0, a.size - n + 1, max(n // 2, 1))
        window, freq = np.hanning(n + 2)[1:-1], rfftfreq(n, 1.0 / fs)
        weight = 1.0 / np.interp(freq, self._freq, self._a_noise + self._c_noise)
        weight[(freq < 1.0 / _SEGMENT) | (freq > _HIGHEST_SHARE * fs)] = 0.0
        A, C = (np.array([rfft(window * (w * one)[k : k + n]) for k in begins]) for one in (a, self.c))
        lags = min(round(_LONGEST * fs), n // 4)
        # Two windows overlap the less the further they are apart.
        overlap = np.correlate(window, window, "full")[n - 1 - lags : n + lags] / np.sum(window**2)
        cross = np.roll(irfft(A * C.conj() * weight, n, axis=1), lags, axis=1)[:, : 2 * lags + 1] / overlap
        norm = float(np.sum(irfft(np.abs(C) ** 2 * weight, n, axis=1)[:, 0]))
        return cross, norm, self.grid.t[begins] + 0.5 * n / fs - middle


def _cut(trace: Trace, begin: float, end: float) -> Trace:
    """Return what a trace has between two times [s]."""
    kept = slice(*np.searchsorted(trace.t, (begin, end)))
    return replace(trace, t=trace.t[kept], z=trace.z[kept])


def _next_peak(high: NDArray[np.bool_], chosen: int) -> float:
    """Return how many samples from `chosen` the next stretch of high values is, of those that it is not in itself."""
    edges = np.flatnonzero(np.diff(high.astype(int)))
    before, after = edges[edges < chosen], edges[edges >= chosen]
    left = chosen - before[-2] if before.size > 1 else math.inf
    right = after[1] + 1 - chosen if after.size > 1 else math.inf
    return float(min(left, right))
