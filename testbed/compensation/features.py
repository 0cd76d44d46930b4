"""Causal temperature features: what a drift model may know of the temperature and its past.

Everything starts from the thermometer alone, in the state of a gyro that had come to rest at its first reading.
"""

# mypy: disable-error-code="no-untyped-def, misc"

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numba import njit

from testbed.compensation.record import checked, checked_rate

if TYPE_CHECKING:
    from testbed.signals import FloatArray

# Share of the trained span by which a feature may leave it before the model counts as extrapolating.
_MARGIN = 0.05
# Of the second pole, in samples: below this a slope is the rounding of the readings.
_LEAST_DELAY = 1e-6


@njit(cache=True)
def _advance(state, temperature, gains, plays, degree, slopes, reference, delay, out):  # pragma: no cover
    """Fill one row of `out` per reading; `state` holds two smoothing stages, the lags, the play operators."""
    n_lag, n_play = gains.size - 2, plays.size
    for k in range(temperature.size):
        reading = temperature[k]
        state[0] += gains[0] * (reading - state[0])
        state[1] += gains[1] * (state[0] - state[1])
        for i in range(n_lag):
            state[2 + i] += gains[2 + i] * (reading - state[2 + i])
        smooth = state[0]
        for i in range(n_play):
            held = state[2 + n_lag + i]
            state[2 + n_lag + i] = min(max(held, smooth - plays[i]), smooth + plays[i])
        column = 0
        power = 1.0
        for _ in range(degree):
            power *= smooth - reference
            out[k, column] = power
            column += 1
        if slopes:
            slope = (smooth - state[1]) / delay
            out[k, column] = slope
            out[k, column + 1] = (smooth - reference) * slope
            column += 2
        ahead = smooth
        for i in range(n_lag):
            out[k, column] = ahead - state[2 + i]
            ahead = state[2 + i]
            column += 1
        for i in range(n_play):
            out[k, column] = smooth - state[2 + n_lag + i]
            column += 1


@dataclass(frozen=True)
class Features:
    r"""Which features are formed of the thermometer's reading T; :math:`T_s` is T smoothed over `smoothing`.

    .. math:: (T_s - T_0)^k,\; k \le \text{degree}; \quad \dot T_s,\; (T_s - T_0) \dot T_s; \quad
        T_s - L_1,\; L_1 - L_2, \ldots; \quad T_s - P_1, \ldots

    L_i are one-pole low-passes of T, whose differences stand for the temperature gradient across the coil; P_i are
    play operators of :math:`T_s`, which stay until :math:`T_s` has moved by their half width (hysteresis).

    Parameters
    ----------
    degree : int
        Highest power of the temperature [-].
    slopes : bool
        Whether the slope and its product with the temperature are features.
    lags : tuple of float
        Time constants of the low-passes, increasing [s].
    plays : tuple of float
        Half widths of the play operators [K]. None by default: under one penalty with the rest they cost a factor of
        two after one cycle (docs/compensation_models.md); the method `process` gives them a prior of their own.
    least_significant : float
        Step of the thermometer [K].
    slope_error : float
        Largest error of the slope that one step may cause [K/s]; 0.005 degC/min, a twentieth of paper 3's ramps.
    reference : float
        T_0 [K].
    """

    degree: int = 3
    slopes: bool = True
    lags: tuple[float, ...] = (900.0, 1500.0, 2400.0)
    plays: tuple[float, ...] = ()
    least_significant: float = 0.0625
    slope_error: float = 0.005 / 60.0
    reference: float = 293.15

    def __post_init__(self) -> None:
        positive = (*self.lags, *self.plays, self.least_significant, self.slope_error, self.reference)
        if not all(math.isfinite(value) and value > 0.0 for value in positive) or self.degree < 1:
            msg = f"features: expected a degree of at least 1 and positive, finite parameters, got {self}"
            raise ValueError(msg)

    @property
    def smoothing(self) -> float:
        r"""Time constant of both smoothing poles [s].

        The slope :math:`(T_s - T_{ss}) / \tau` answers a step of one least significant bit with
        :math:`(LSB\, t / \tau^2) e^{-t/\tau}`, at most LSB / (e tau): tau = LSB / (e slope_error).
        """
        return self.least_significant / (math.e * self.slope_error)

    @property
    def names(self) -> tuple[str, ...]:
        """Name of each column."""
        powers = [f"T^{k}" for k in range(1, self.degree + 1)]
        slopes = ["dT/dt", "T dT/dt"] if self.slopes else []
        gradients = [f"gradient {lag:g} s" for lag in self.lags]
        return (*powers, *slopes, *gradients, *(f"play {width:g} K" for width in self.plays))

    def start(self, sample_rate_hz: float) -> FeatureStage:
        """Return the features in time.

        Parameters
        ----------
        sample_rate_hz : float
            Rate of the thermometer's readings [Hz].
        """
        return FeatureStage(self, sample_rate_hz)

    def compute(self, temperature: FloatArray, sample_rate_hz: float) -> FloatArray:
        """Return the features of a whole record, the same bits as in blocks.

        Parameters
        ----------
        temperature : ndarray, shape (n_time,)
            Readings [K].
        sample_rate_hz : float
            Their rate [Hz].

        Returns
        -------
        ndarray, shape (n_time, n_feature)
            One column per name [K^k, K/s, K^2/s].
        """
        return self.start(sample_rate_hz).process(temperature)


class FeatureStage:
    """Features of a stream of readings, block by block; any division gives the same bits.

    Parameters
    ----------
    features : Features
        Which.
    sample_rate_hz : float
        Rate of the readings [Hz].

    Raises
    ------
    ValueError
        If it is so low that slopes cannot be formed.
    """

    def __init__(self, features: Features, sample_rate_hz: float) -> None:
        self._features = features
        times = np.array([features.smoothing, features.smoothing, *features.lags])
        self._gains = -np.expm1(-1.0 / (checked_rate(sample_rate_hz) * times))
        # By which the second pole lags a ramp: smoothing less half a sample.
        self._delay = (1.0 / self._gains[1] - 1.0) / sample_rate_hz
        if features.slopes and self._delay * sample_rate_hz < _LEAST_DELAY:
            msg = (
                f"sample rate: expected several readings within the {features.smoothing:.3g} s over which slopes are "
                f"formed, got one in {1.0 / sample_rate_hz:.3g} s"
            )
            raise ValueError(msg)
        self._plays = np.array(features.plays, dtype=np.float64)
        self._state: FloatArray | None = None

    def process(self, temperature: FloatArray) -> FloatArray:
        """Return the features of the next readings; each uses readings up to its own only.

        Parameters
        ----------
        temperature : ndarray, shape (n_time,)
            Readings [K].

        Returns
        -------
        ndarray, shape (n_time, n_feature)
            One column per name of `Features.names`.

        Raises
        ------
        ValueError
            If a reading is not finite.
        """
        readings = checked("temperature", temperature)
        which = self._features
        out = np.empty((readings.size, len(which.names)))
        if readings.size:
            if self._state is None:
                self._state = np.full(self._gains.size + self._plays.size, readings[0])
            _advance(
                self._state,
                readings,
                self._gains,
                self._plays,
                which.degree,
                which.slopes,
                which.reference,
                self._delay,
                out,
            )
        return out


@dataclass(frozen=True)
class Scaling:
    """Standardisation by training statistics, and the box that training has seen.

    Parameters
    ----------
    mean, scale : ndarray, shape (n_feature,)
        Mean and standard deviation of each feature over the training rows; the scale of a constant feature is 1.
    low, high : ndarray, shape (n_feature,)
        Least and largest standardised value seen.
    """

    mean: FloatArray
    scale: FloatArray
    low: FloatArray
    high: FloatArray

    @classmethod
    def fit(cls, X: FloatArray) -> Scaling:
        """Return the scaling that gives each column of `X` mean zero and unit variance.

        Parameters
        ----------
        X : ndarray, shape (n_row, n_feature)
            Features of the training rows.
        """
        mean, scale = X.mean(axis=0), X.std(axis=0)
        # The spread of a feature that never moved is rounding.
        scale = np.where(scale > 1e-12 * np.abs(X).max(axis=0), scale, 1.0)
        Z = (X - mean) / scale
        return cls(mean, scale, Z.min(axis=0), Z.max(axis=0))

    def apply(self, X: FloatArray) -> FloatArray:
        """Return the standardised features, shape (n_row, n_feature), of features `X` of that shape."""
        Z: FloatArray = (X - self.mean) / self.scale
        return Z

    def outside(self, Z: FloatArray) -> FloatArray:
        """Return by how much each row leaves the trained box, in spans of its worst feature.

        Parameters
        ----------
        Z : ndarray, shape (n_row, n_feature)
            Standardised features.

        Returns
        -------
        ndarray, shape (n_row,)
            0 inside [-].
        """
        span = np.where(self.high > self.low, self.high - self.low, 1.0)
        excess: FloatArray = np.maximum(np.maximum(self.low - Z, Z - self.high) / span, 0.0).max(axis=1)
        return excess

    def extrapolated(self, Z: FloatArray) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
        """Return whether rows of standardised features `Z`, shape (n_row, n_feature), leave the box by over 5 % of its
        span.
        """
        return self.outside(Z) > _MARGIN
