"""Readings with stamps: the steps at which there is a reading of any sensor, and which of them are shown."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from testbed.errors import quoted
from testbed.fusion.kernels.merging import merge_stamps
from testbed.fusion.schedule import nearest_clock, odd_sensor

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import ArrayLike, NDArray

    from testbed.signals import FloatArray

_SECOND = 1_000_000_000
# Intervals that a rate is the median of, each over so many readings: what a coarse clock rounds matters less.
_OVER = 16
_LONGEST_NS = 2**62


class Timing(NamedTuple):
    """When the readings of a block came.

    Parameters
    ----------
    length : ndarray, shape (n_step,)
        How long each step is, in regular ones (`testbed.fusion.transitions.steps_of`).
    shown : ndarray of bool, shape (n_step,)
        Where the fastest sensor has a reading: there the estimate is shown.
    late : ndarray of int, shape (n_sensor,)
        Readings that came too late, so far.
    time_ns : ndarray of int, shape (n_shown,)
        Stamps of what is shown [ns].
    """

    length: FloatArray
    shown: NDArray[np.bool_]
    late: NDArray[np.int64]
    time_ns: NDArray[np.int64]


class Stamps:
    """Merges the readings of several sensors, each on its own clock, into steps, block after block.

    A reading older than the last step is dropped and counted. A sensor silent for 1.5 of its periods has a reading
    missing.

    Parameters
    ----------
    sample_rate_hz : mapping of str to float
        About how often each is read [Hz], in any ratio; the fastest, the first of them, sets the regular step.
    """

    def __init__(self, sample_rate_hz: Mapping[str, float]) -> None:
        self.sensors = tuple(sample_rate_hz)
        nearest_clock(sample_rate_hz)
        rates = np.array(list(sample_rate_hz.values()), float)
        self._rates, self._period, self._fastest = rates, _SECOND / rates, int(np.argmax(rates))
        zeros = np.zeros(rates.size, np.int64)
        self._memory = np.zeros(2, np.int64), zeros, zeros.copy(), zeros.copy()
        self._counted = zeros.copy()

    def implied(self, readings: Mapping[str, ArrayLike]) -> dict[str, NDArray[np.int64]]:
        """Return the stamps of readings that come at exactly their rates from t = 0 on [ns], by sensor.

        Parameters
        ----------
        readings : mapping of str to array_like, shape (n_sensor_samples,)
            All that are due before the next one of the fastest sensor.

        Raises
        ------
        ValueError
            If a sensor is missing or unknown, or has not as many readings as are due.
        """
        sizes = np.array([np.size(readings[name]) for name in self._known(readings)])
        stop = self._counted + sizes
        end = stop[self._fastest] / self._rates[self._fastest]
        # A reading at the very end is due with the next block; a nanosecond is none.
        due = np.ceil(end * self._rates - 1e-9 * self._rates).astype(np.int64)
        for name, have, wanted, before in zip(self.sensors, stop, due, self._counted, strict=True):
            if have != wanted:
                msg = f"readings: expected {wanted - before} of {quoted(name)} in {end:g} s, got {have - before}"
                raise ValueError(msg)
        starts, self._counted = self._counted, stop
        return {
            name: np.rint(np.arange(a, b) * (_SECOND / rate)).astype(np.int64)
            for name, a, b, rate in zip(self.sensors, starts, stop, self._rates, strict=True)
        }

    def spread(self, readings: Mapping[str, ArrayLike], time_ns: Mapping[str, ArrayLike]) -> tuple[FloatArray, Timing]:
        """Return the readings of a block as rows over its steps, NaN where none is, infinite where one is missing.

        Parameters
        ----------
        readings : mapping of str to array_like, shape (n_sensor_samples,)
            Readings of every sensor in this block [rad/s].
        time_ns : mapping of str to array_like of int, shape (n_sensor_samples,)
            Their stamps [ns], from any epoch that all sensors share.

        Returns
        -------
        Z : ndarray, shape (n_sensor, n_step)
            Readings [rad/s], a copy.
        timing : Timing
            When they came.

        Raises
        ------
        ValueError
            If a sensor is missing or unknown, or stamps are no whole numbers, one for each reading.
        """
        self._known(time_ns, "time_ns")
        values = [np.asarray(readings[name], dtype=float) for name in self._known(readings)]
        stamps = [_whole(name, time_ns[name], one.shape) for name, one in zip(self.sensors, values, strict=True)]
        for i, one in enumerate(stamps):
            if one.size and np.any(one[1:] < one[:-1]):
                order = np.argsort(one, kind="stable")
                stamps[i], values[i] = one[order], values[i][order]
        bounds = np.concatenate([[0], np.cumsum([one.size for one in stamps])]).astype(np.int64)
        given = (np.concatenate(stamps), np.concatenate(values), bounds, self._period, self._fastest, self._memory)
        room = _room(len(values), 2 * int(bounds[-1]))
        before = self._memory[3].copy()
        n_step = merge_stamps(*given, room)
        Z, length, shown = (one[..., :n_step] for one in room)
        late = self._memory[3].copy()
        # Those that came too late are the first ones.
        in_time = stamps[self._fastest][(late - before)[self._fastest] :]
        return Z, Timing(length, shown, late, in_time.copy())

    def _known(self, given: Mapping[str, ArrayLike], what: str = "readings") -> tuple[str, ...]:
        if set(given) != set(self.sensors):
            msg = f"{what}: expected the sensors {sorted(self.sensors)}, got {sorted(given)}"
            raise ValueError(msg)
        return self.sensors


def _whole(name: str, stamps: ArrayLike, shape: tuple[int, ...]) -> NDArray[np.int64]:
    found = np.asarray(stamps)
    if found.size == 0:
        found = found.astype(np.int64)
    if found.dtype.kind not in "iu" or found.shape != shape or len(shape) != 1:
        msg = (
            f"time_ns: expected a whole number of nanoseconds for each of the readings of {quoted(name)}, "
            f"shape {shape}, got {found.dtype} of shape {found.shape}"
        )
        raise ValueError(msg)
    if found.size and max(abs(int(found.min())), abs(int(found.max()))) > _LONGEST_NS:
        msg = f"time_ns: expected stamps of {quoted(name)} within 146 years of their epoch, got {int(found.max())}"
        raise ValueError(msg)
    return np.ascontiguousarray(found, dtype=np.int64)


# Not touched, memory that was asked for costs nothing.
def _room(n_sensor: int, n_step: int) -> tuple[np.ndarray, ...]:
    return np.empty((n_sensor, n_step)), np.empty(n_step), np.empty(n_step, np.bool_)


def rates_of(time_ns: Mapping[str, ArrayLike]) -> dict[str, float]:
    """Return about how often each sensor is read [Hz]: over the median of the mean intervals of 16 readings.

    Gaps and a coarse clock hardly change it.

    Parameters
    ----------
    time_ns : mapping of str to array_like of int, shape (n_sensor_samples,)
        Stamps [ns], rising.

    Raises
    ------
    ValueError
        If a sensor has fewer than two stamps, or all of one time.
    """
    return {name: _rate_of(name, np.asarray(stamps)) for name, stamps in time_ns.items()}


def _rate_of(name: str, stamps: NDArray[np.int64]) -> float:
    over = max(min(_OVER, stamps.size - 1), 1)
    spans = (stamps[over:] - stamps[:-over])[::over]
    period = float(np.median(spans)) / over if spans.size else 0.0
    if not period > 0.0:
        msg = f"time_ns: expected at least two different stamps of {quoted(name)}, or its rate in sample_rate_hz"
        raise ValueError(msg)
    return _SECOND / period


def sorted_by_time(
    readings: Mapping[str, ArrayLike], time_ns: Mapping[str, ArrayLike]
) -> tuple[dict[str, FloatArray], dict[str, NDArray[np.int64]]]:
    """Return readings and stamps of each sensor in the order of the stamps; those of one time keep theirs.

    Parameters
    ----------
    readings, time_ns : mapping of str to array_like, shape (n_sensor_samples,)
        Readings [rad/s] and stamps [ns], of the same sensors.

    Raises
    ------
    ValueError
        If they are not of the same sensors, or stamps are no whole numbers, one for each reading.
    """
    if set(readings) != set(time_ns):
        msg = f"time_ns: expected the sensors {sorted(readings)}, got {sorted(time_ns)}"
        raise ValueError(msg)
    values = {name: np.asarray(one, dtype=float) for name, one in readings.items()}
    stamps = {name: _whole(name, time_ns[name], one.shape) for name, one in values.items()}
    for name, one in stamps.items():
        if np.any(one[1:] < one[:-1]):
            order = np.argsort(one, kind="stable")
            values[name], stamps[name] = values[name][order], one[order]
    return values, stamps


def regular(time_ns: Mapping[str, NDArray[np.int64]], sample_rate_hz: Mapping[str, float]) -> bool:
    """Return whether readings come as those without stamps do: at exactly their rates, to the rounding of a stamp, all
    from the first one of the fastest sensor on, which is read a whole number of times as often as each other.

    Then a filter gives the same bits without stamps, and one that takes none can be used.

    Parameters
    ----------
    time_ns : mapping of str to ndarray of int, shape (n_sensor_samples,)
        Stamps [ns], rising.
    sample_rate_hz : mapping of str to float
        Rate of each sensor [Hz].
    """
    if odd_sensor(sample_rate_hz) or not all(one.size for one in time_ns.values()):
        return False
    fastest, strides = nearest_clock(sample_rate_hz)
    n_time = time_ns[tuple(sample_rate_hz)[strides.index(1)]].size
    begin = time_ns[tuple(sample_rate_hz)[strides.index(1)]][0]
    for name, stride in zip(sample_rate_hz, strides, strict=True):
        there = np.arange(-(-n_time // stride)) * (stride * _SECOND / fastest)
        if time_ns[name].size != there.size or np.any(np.abs(time_ns[name] - begin - there) > 1.0):
            return False
    return True
