r"""The front part of every filter: readings that are none, told by themselves and before any estimate.

A reading counts as missing

- at the end of the range, less one step;
- from its n-th exact repetition on, :math:`n = \ln 10^{-12} / \ln p`, p the largest probability of one word of the
  converter given the reading before: a sensor that works repeats itself that often once in 10^12 readings;
- where it jumps by more than 20 standard deviations out of a calm sequence, until one comes that differs from it.

What is smaller only a comparison with an estimate can tell: that is the filter's own gate.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numba import njit

from testbed.signals import van_loan

if TYPE_CHECKING:
    from collections.abc import Mapping

    from testbed.fusion.belief import SensorBelief
    from testbed.fusion.schedule import Schedule
    from testbed.signals import FloatArray

_CHANCE = 1e-12
# Sensors whose words are so coarse that they repeat for longer are not tested for it.
_MOST_REPEATS = 1000
# A jump, in standard deviations of the increments: the larger of the noise's and of the last readings'.
JUMP_SQUARE = 20.0**2
# Readings that the second is averaged over, and that must have come in a row before a jump is judged.
CALM = 20.0

# Entries of the state of a sensor.
LAST, REPEATS, SQUARE, SEEN, WAITING, GATED, ENTRIES = range(7)
# Entries of its setting.
LIMIT, MOST_REPEATS, NOISE = range(3)


def step_std(belief: SensorBelief, sample_rate_hz: float) -> float:
    """Return the standard deviation of a reading given all before it, rate and states known [rad/s].

    Parameters
    ----------
    belief : SensorBelief
        Dynamics and noise.
    sample_rate_hz : float
        Of the readings [Hz].
    """
    one = belief.realisation()
    of_reading = belief.reading_noise**2 * sample_rate_hz
    if not one.B.size:
        return math.sqrt(of_reading)
    _, Q = van_loan(one.A, belief.input_noise**2 * np.outer(one.B, one.B), 1.0 / sample_rate_hz)
    return math.sqrt(float(one.C @ Q @ one.C) + of_reading)


def most_repeats(std: float, resolution: float | None) -> int:
    r"""Return how many exact repetitions in a row make a sensor stuck, 0 for never.

    .. math:: p = \mathrm{erf}\left(\frac{\Delta}{2 \sqrt 2\, \sigma}\right)

    Parameters
    ----------
    std : float
        Standard deviation of a reading given those before it [rad/s].
    resolution : float or None
        Step of the readings [rad/s]; None where unknown or none.
    """
    if resolution is None or not std > 0.0:
        return 0
    p = math.erf(resolution / (2.0 * math.sqrt(2.0) * std))
    n = math.ceil(math.log(_CHANCE) / math.log(p)) if p < 1.0 else _MOST_REPEATS + 1
    return n if n <= _MOST_REPEATS else 0


class Gate:
    """Strikes out of the readings of a block what is none, and counts it.

    Parameters
    ----------
    belief : mapping of str to SensorBelief
        Noise, range and resolution of each sensor.
    schedule : Schedule
        Sensors and rates.
    """

    def __init__(self, belief: Mapping[str, SensorBelief], schedule: Schedule) -> None:
        rates = schedule.rates_hz
        self._setting = np.array(
            [_setting(belief[name], rate) for name, rate in zip(schedule.sensors, rates, strict=True)]
        )
        self._state = np.zeros((len(rates), ENTRIES))
        self._state[:, [LAST, WAITING]], self._state[:, SEEN] = np.nan, -1.0

    def key(self) -> bytes:
        """Return what tells the setting from another one."""
        return self._setting.tobytes()

    def process(self, Z: FloatArray) -> FloatArray:
        """Set the readings that are none to infinite; return how many of each sensor there have been so far.

        Parameters
        ----------
        Z : ndarray, shape (n_sensor, n_time)
            Readings [rad/s], NaN where none is due, infinite where one is missing; changed.

        Returns
        -------
        ndarray, shape (n_sensor, n_time)
            Number of readings struck out up to each step.
        """
        counts = np.empty(Z.shape)
        strike(Z, self._state, self._setting, counts)
        return counts


def _setting(belief: SensorBelief, sample_rate_hz: float) -> tuple[float, float, float]:
    std = step_std(belief, sample_rate_hz)
    limit = math.inf if belief.range is None else belief.range - 1.5 * (belief.resolution or 0.0)
    return limit, most_repeats(std, belief.resolution), std


@njit(cache=True, error_model="numpy")
def strike(Z, state, setting, counts):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Do what `Gate.process` says, one sensor after the other."""
    for i in range(Z.shape[0]):
        # In variables: through the array each reading would wait for what the last one stored.
        last, repeats, square, seen = state[i, LAST], state[i, REPEATS], state[i, SQUARE], state[i, SEEN]
        waiting, gated = state[i, WAITING], state[i, GATED]
        limit, most, noise = setting[i, LIMIT], setting[i, MOST_REPEATS], setting[i, NOISE]
        for k in range(Z.shape[1]):
            z = Z[i, k]
            if np.isinf(z):
                # What comes after a gap is no jump.
                seen = -1.0
            elif not np.isnan(z):
                repeats = repeats + 1.0 if z == last else 0.0
                step, last = z - last, z
                good = False
                if abs(z) >= limit or 0.0 < most <= repeats:
                    # Nor is what comes after this.
                    seen = -1.0
                elif z != waiting:
                    if not np.isnan(waiting):
                        waiting, seen = np.nan, -1.0
                    calm = max(2.0 * noise * noise, square)
                    if noise > 0.0 and seen > CALM and step * step > JUMP_SQUARE * calm:
                        waiting = z
                    else:
                        good = True
                        seen += 1.0
                        if seen > 0.0:
                            square += (step * step - square) / min(seen, CALM)
                if not good:
                    gated += 1.0
                    Z[i, k] = np.inf
            counts[i, k] = gated
        state[i, LAST], state[i, REPEATS], state[i, SQUARE], state[i, SEEN] = last, repeats, square, seen
        state[i, WAITING], state[i, GATED] = waiting, gated
