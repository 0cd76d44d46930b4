r"""Slow noise of a sensor as states: first-order Markov processes fitted to the density that a belief names.

.. math:: S(f) = \sum_j \frac{2 \tau_j \sigma_j^2}{1 + (2 \pi f \tau_j)^2}, \quad \sigma_j^2 \ge 0

1/f has no finite state model; one process per decade follows it within a few tenths of a decibel.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from testbed.fusion.belief import SensorBelief
    from testbed.signals import FloatArray

# A slow part that adds less than this to the white density is left out: 0.13 dB.
_LEAST_SHARE = 0.03
# The fastest process stands below the end of that band, since the sum falls as 1/f^2 beyond it.
_LAST = 0.5
_PER_DECADE = 100
# The corner at `lowest_frequency`, sharp in the density, is round in any sum of processes: it is reported by itself.
_CORNER = 3.0
_HIGHEST_HZ = 1e4


@dataclass(frozen=True)
class MarkovFit:
    """Markov processes that stand for one density.

    Parameters
    ----------
    rate : ndarray, shape (n_process,)
        1/tau of each [1/s], rising; 0 is a constant or, with `drive`, a random walk.
    variance : ndarray, shape (n_process,)
        Variance at the start [rad^2/s^2], which for rate > 0 is the stationary one.
    drive : ndarray, shape (n_process,)
        Density of the white noise that drives each [rad^2/s^3].
    error_db, corner_error_db : float
        Largest misfit of the whole density, white part included, from three times the lowest frequency up, and
        anywhere [dB].
    """

    rate: FloatArray
    variance: FloatArray
    drive: FloatArray
    error_db: float = 0.0
    corner_error_db: float = 0.0

    def density(self, freq_hz: FloatArray) -> FloatArray:
        """Return the two-sided density of the sum [rad^2/s], shape (n_freq,), at frequencies above zero [Hz]."""
        turn = 2.0 * np.pi * np.asarray(freq_hz)[:, None]
        value: FloatArray = (self.drive / (self.rate**2 + turn**2)).sum(axis=1)
        return value


_NOTHING = MarkovFit(np.zeros(0), np.zeros(0), np.zeros(0))


def fit_markov(
    slow: Callable[[FloatArray], FloatArray], white: float, lowest_hz: float, *, per_decade: float = 1.0
) -> MarkovFit:
    r"""Fit Markov processes to a slow density beside white noise, by non-negative least squares.

    .. math:: \min_{\sigma_j^2 \ge 0} \int \left(\frac{W + \sum_j S_j(f)}{W + S(f)} - 1\right)^2 d \ln f

    The corners stand evenly in logarithm from `lowest_hz` to half the frequency where the slow part is 3 % of the white
    one, at least `per_decade` of them in a decade.

    Parameters
    ----------
    slow : callable
        Two-sided density, Hz -> rad^2/s, falling from `lowest_hz` on.
    white : float
        Density W of the white noise beside it [rad^2/s], above 0.
    lowest_hz : float
        Below this the slow density is constant [Hz].
    per_decade : float, optional
        Corners in a decade [-].

    Returns
    -------
    MarkovFit
        Without processes if the slow part is nowhere 3 % of the white one.

    Raises
    ------
    ValueError
        If there is no white noise, since the processes then never end.
    """
    from scipy.optimize import nnls

    if not np.any(slow(np.array([lowest_hz])) > 0.0):
        return _NOTHING
    if not white > 0.0:
        msg = f"white noise: expected more than 0 beside 1/f noise, got {white:g} rad^2/s; the fit would have no end"
        raise ValueError(msg)
    decades = math.log10(_HIGHEST_HZ / lowest_hz)
    band = np.logspace(math.log10(lowest_hz), math.log10(_HIGHEST_HZ), max(round(_PER_DECADE * decades), 2))
    above = band[slow(band) > _LEAST_SHARE * white]
    if not above.size:
        return _NOTHING
    last = max(_LAST * above[-1], lowest_hz)
    corners = np.geomspace(lowest_hz, last, math.ceil(math.log10(last / lowest_hz) * per_decade) + 1)
    low, high = 0.5 * lowest_hz, 5.0 * above[-1]
    freq = np.geomspace(low, high, max(round(_PER_DECADE * math.log10(high / low)), 2))
    rate = 2.0 * np.pi * corners
    shapes = 2.0 * rate / (rate**2 + (2.0 * np.pi * freq[:, None]) ** 2)
    whole = white + slow(freq)
    variance, _ = nnls(shapes / whole[:, None], slow(freq) / whole)
    misfit = np.abs(10.0 * np.log10((white + shapes @ variance) / whole))
    kept = variance > 0.0
    return MarkovFit(
        rate[kept],
        variance[kept],
        2.0 * (rate * variance)[kept],
        float(misfit[freq >= _CORNER * lowest_hz].max()),
        float(misfit.max()),
    )


@dataclass(frozen=True)
class SlowNoise:
    """The slow noise of one sensor: what passes its dynamics with the rate, and what lies on the reading.

    Parameters
    ----------
    inner, outer : MarkovFit
        Before and behind the dynamics.
    """

    inner: MarkovFit
    outer: MarkovFit

    @property
    def error_db(self) -> float:
        """Largest misfit of either fit from three times the lowest frequency up [dB]."""
        return max(self.inner.error_db, self.outer.error_db)

    @property
    def size(self) -> int:
        """Number of states."""
        return self.inner.rate.size + self.outer.rate.size


def slow_noise(belief: SensorBelief) -> SlowNoise:
    """Return the states for a belief's bias instability, rate random walk, turn-on bias and 1/f noise of the reading.

    Turn-on bias and a rate random walk that matters above `lowest_frequency` are one state, a random walk from an
    unknown value.

    Parameters
    ----------
    belief : SensorBelief
        Dynamics and noise.

    Raises
    ------
    ValueError
        If there is 1/f noise and no white noise beside it.
    """
    lowest = belief.lowest_frequency
    white = belief.input_noise**2 + (belief.output_noise / belief.largest_gain()) ** 2
    inner = fit_markov(belief.inner_slow_density, white, lowest)
    outer = fit_markov(belief.outer_slow_density, belief.output_noise**2, lowest)
    walk = belief.rate_random_walk**2
    at_lowest = white + float(belief.inner_slow_density(np.array([lowest]))[0])
    if belief.turn_on_bias > 0.0 or walk > _LEAST_SHARE * at_lowest * (2.0 * np.pi * lowest) ** 2:
        inner = MarkovFit(
            np.append(inner.rate, 0.0),
            np.append(inner.variance, belief.turn_on_bias**2),
            np.append(inner.drive, walk),
            inner.error_db,
            inner.corner_error_db,
        )
    return SlowNoise(inner, outer)
