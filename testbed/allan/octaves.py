"""The Allan deviation of a record that comes block by block: octave by octave, with memory flat in its length."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from testbed.allan.freedom import chi_square_limits, curve_exponents, equivalent_freedom
from testbed.allan.types import AllanCurve

if TYPE_CHECKING:
    from testbed.signals import FloatArray

# Means of a level that make one averaging time: the differences overlap by three quarters of it.
_MEANS = 4
# Shortest record of a level, in averaging times; and the share of its differences that lost samples must leave.
_RECORD, _LEAST_USED = 4, 0.02


class AllanOctaves:
    r"""Overlapping Allan variance at 1, 2, 4, 8, ... samples.

    Level k holds the means y of :math:`2^k` samples. Means of four of them, at every one, stand for the averaging time
    :math:`\tau = 4 \cdot 2^k T`; the shortest, of one and two samples, come from level 0.

    .. math:: \sigma^2(\tau) = \tfrac{1}{2} \langle (\bar y_{i+m} - \bar y_i)^2 \rangle

    Blocks may be divided in any way. A lost sample (NaN) leaves out the means that it would be in.

    Parameters
    ----------
    sample_rate_hz : float
        Sample rate [Hz].

    Examples
    --------
    White noise of 1 rad/s falls as the root of the averaging time.

    >>> octaves = AllanOctaves(1.0)
    >>> octaves.process(np.random.default_rng(1).standard_normal(10_000))
    >>> curve = octaves.curve()
    >>> bool(curve.lower[0] < 1.0 < curve.upper[0])  # white noise of 1 rad/s: 1 over sqrt(tau)
    True
    """

    def __init__(self, sample_rate_hz: float) -> None:
        self._fs = sample_rate_hz
        self._singles = [_Differences(1), _Differences(2)]
        self._levels: list[_Level] = []
        self._n_time = 0

    def process(self, values: FloatArray) -> None:
        """Take the next samples.

        Parameters
        ----------
        values : ndarray, shape (n_time,)
            Rate or error [rad/s]; NaN where a sample is lost.
        """
        self._n_time += values.size
        for one in self._singles:
            one.process(values)
        k = 0
        while values.size:
            if k == len(self._levels):
                self._levels.append(_Level())
            values = self._levels[k].process(values)
            k += 1

    def curve(self) -> AllanCurve | None:
        """Return the deviation with its 95 % limits, None of a record of fewer than 16 samples or without differences.

        The type of noise, which the limits depend on, is that of the slope of the curve.
        """
        found = [(one.m, one, self._n_time) for one in self._singles]
        found += [(_MEANS << k, level.differences, self._n_time >> k) for k, level in enumerate(self._levels)]
        rows = [
            (m, one.variance, one.m, n_level, one.n / (n_level - 2 * one.m + 1))
            for m, one, n_level in found
            if n_level >= _RECORD * one.m and one.variance > 0.0
        ]
        rows = [row for row in rows if row[-1] >= _LEAST_USED]
        if self._n_time < _RECORD * _MEANS or not rows:
            return None
        m, variance, of_level, n_level, used = np.array(rows, dtype=np.float64).T
        exponents = curve_exponents(m, variance)
        edf = used * [
            equivalent_freedom(int(factor), int(n) + 1, int(alpha))
            for factor, n, alpha in zip(of_level, n_level, exponents, strict=True)
        ]
        low, high = chi_square_limits(variance, edf)
        return AllanCurve(
            m / self._fs, np.sqrt(variance), np.sqrt(low), np.sqrt(high), edf, self._n_time, self._fs, used
        )


class _Differences:
    """Sum of squared differences of neighbouring means of `m` values, at every value."""

    def __init__(self, m: int) -> None:
        self.m, self.n, self._sum = m, 0, 0.0
        self._tail: FloatArray = np.empty(0)

    @property
    def variance(self) -> float:
        """Allan variance; 0 without a difference."""
        return 0.5 * self._sum / self.n if self.n else 0.0

    def process(self, values: FloatArray) -> None:
        """Take the next values, shape (n_time,)."""
        values = np.concatenate([self._tail, values])
        self._tail = values[max(values.size - 2 * self.m + 1, 0) :].copy()
        if values.size < 2 * self.m:
            return
        n_means = values.size - self.m + 1
        means = np.sum([values[i : i + n_means] for i in range(self.m)], axis=0) / self.m
        differences = means[self.m :] - means[: -self.m]
        known = differences[np.isfinite(differences)]
        self._sum, self.n = self._sum + float(known @ known), self.n + known.size


class _Level:
    """The means of one level: their differences, and their pairs for the next."""

    def __init__(self) -> None:
        self.differences = _Differences(_MEANS)
        self._odd: FloatArray = np.empty(0)

    def process(self, values: FloatArray) -> FloatArray:
        """Take the next means, shape (n_time,); return those of the next level that are complete."""
        self.differences.process(values)
        values = np.concatenate([self._odd, values])
        even = values.size // 2 * 2
        self._odd = values[even:].copy()
        halved: FloatArray = (values[:even:2] + values[1:even:2]) / 2.0
        return halved
