"""When each sensor has a reading: several sample rates on the clock of the fastest."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from testbed.errors import quoted

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import ArrayLike

    from testbed.signals import FloatArray

# A reading beyond this [rad/s] is no rate but a missing reading: its square would overflow.
LARGEST_RATE = 1e6
# Steps after which the readings repeat, of what is designed or bounded over that cycle: seconds and 0.5 GB at the most.
MOST_STEPS = 500


def nearest_clock(sample_rate_hz: Mapping[str, float]) -> tuple[float, tuple[int, ...]]:
    """Return the fastest rate [Hz] and the whole number nearest to the stride of each sensor on that clock.

    Parameters
    ----------
    sample_rate_hz : mapping of str to float
        Rate of each sensor [Hz], in any ratio.

    Raises
    ------
    ValueError
        If a rate is not positive.
    """
    for name, value in sample_rate_hz.items():
        if not (math.isfinite(value) and value > 0.0):
            msg = f"sample_rate_hz: expected more than 0 Hz for {quoted(name)}, got {quoted(value)}"
            raise ValueError(msg)
    fastest = float(max(sample_rate_hz.values()))
    return fastest, tuple(round(fastest / value) for value in sample_rate_hz.values())


def odd_sensor(sample_rate_hz: Mapping[str, float], within: float = 1e-9) -> str:
    """Return the first sensor whose rate does not divide the fastest one, "" if all do.

    Parameters
    ----------
    sample_rate_hz : mapping of str to float
        Rate of each sensor [Hz].
    within : float, optional
        By how much of itself the ratio may be off; a nanosecond of drift per second of record is below any logger's
        clock.
    """
    fastest, strides = nearest_clock(sample_rate_hz)
    pairs = zip(sample_rate_hz.items(), strides, strict=True)
    return next((name for (name, value), n in pairs if not math.isclose(n * value, fastest, rel_tol=within)), "")


def even_rates(sample_rate_hz: Mapping[str, float]) -> dict[str, float]:
    """Return the rates that divide the fastest one and are nearest to these [Hz].

    Parameters
    ----------
    sample_rate_hz : mapping of str to float
        Rate of each sensor [Hz], in any ratio.
    """
    fastest, strides = nearest_clock(sample_rate_hz)
    return {name: fastest / stride for name, stride in zip(sample_rate_hz, strides, strict=True)}


def common_clock(sample_rate_hz: Mapping[str, float]) -> tuple[float, tuple[int, ...]]:
    """Return the fastest rate [Hz] and the stride of each sensor on that clock.

    Parameters
    ----------
    sample_rate_hz : mapping of str to float
        Rate of each sensor [Hz].

    Raises
    ------
    ValueError
        If a rate is not positive or does not divide the fastest one.
    """
    fastest, strides = nearest_clock(sample_rate_hz)
    if name := odd_sensor(sample_rate_hz):
        value = sample_rate_hz[name]
        msg = f"sample_rate_hz: expected {fastest:g} Hz to be an integer multiple of {quoted(name)}, got {value:g} Hz"
        raise ValueError(msg)
    return fastest, strides


def long_cycle(strides: Sequence[int]) -> str:
    """Return why nothing is designed over the cycle in which readings repeat, "" if it can be.

    Parameters
    ----------
    strides : sequence of int
        Of each sensor on the clock of the fastest.
    """
    steps = math.lcm(*strides)
    return "" if steps <= MOST_STEPS else f"the readings repeat after {steps} steps of the fastest sensor only"


class Schedule:
    """Spreads the readings of several sensors over the clock of the fastest, block after block.

    Parameters
    ----------
    sample_rate_hz : mapping of str to float
        Rate of each sensor [Hz]; the fastest is an integer multiple of every other. All start at t = 0.
    any_ratio : bool, optional
        Take rates that do not divide the fastest one too: `strides` are the nearest whole numbers then, and nothing can
        be spread.

    Raises
    ------
    ValueError
        If a rate is not positive or, unless `any_ratio`, does not divide the fastest one.
    """

    def __init__(self, sample_rate_hz: Mapping[str, float], *, any_ratio: bool = False) -> None:
        self.sensors = tuple(sample_rate_hz)
        self.sample_rate_hz, self.strides = (nearest_clock if any_ratio else common_clock)(sample_rate_hz)
        self.even = not odd_sensor(sample_rate_hz)
        self.rates_hz = tuple(even_rates(sample_rate_hz).values()) if self.even else tuple(sample_rate_hz.values())
        self._sample = 0

    @property
    def begun(self) -> bool:
        """Whether a reading was spread."""
        return self._sample > 0

    def spread(self, readings: Mapping[str, ArrayLike]) -> FloatArray:
        """Return the readings of the next block as rows at the fastest rate, NaN where none is due, infinite where one
        is missing or no rate.

        Parameters
        ----------
        readings : mapping of str to array_like, shape (n_sensor_samples,)
            Readings of every sensor in this block [rad/s].

        Returns
        -------
        ndarray, shape (n_sensor, n_time)
            Readings [rad/s], a copy.

        Raises
        ------
        ValueError
            If a sensor is missing or unknown, or has not as many readings as are due in the block.
        """
        if set(readings) != set(self.sensors):
            msg = f"readings: expected the sensors {sorted(self.sensors)}, got {sorted(readings)}"
            raise ValueError(msg)
        arrays = [np.asarray(readings[name], dtype=float) for name in self.sensors]
        n_time = arrays[self.strides.index(1)].size
        Z = np.full((len(arrays), n_time), np.nan)
        for name, stride, values, row in zip(self.sensors, self.strides, arrays, Z, strict=True):
            due = row[-self._sample % stride :: stride]
            if values.shape != due.shape:
                msg = (
                    f"readings: expected {due.size} of {quoted(name)} (every {stride}th of the {n_time} samples from "
                    f"{self._sample} on), got shape {values.shape}"
                )
                raise ValueError(msg)
            due[:] = np.where(np.abs(values) <= LARGEST_RATE, values, np.inf)
        self._sample += n_time
        return Z
