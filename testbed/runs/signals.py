"""Signals of one group of a run, by attribute and by name, each with its unit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from testbed.errors import quoted

if TYPE_CHECKING:
    from collections.abc import Iterator

    from testbed.signals import FloatArray


class Source(Protocol):
    """Where the samples of a group are: in memory or in a file."""

    def __call__(self, name: str, rows: slice) -> FloatArray:
        """Return those `rows` of the signal `name`, SI."""


class Signals(Mapping[str, "FloatArray"]):
    """Signals of one group as attributes and items: ``group.rate``, ``group["rate"]``, ``group.time``.

    Each is a NumPy array in SI; of a run on disk it is read when it is asked for. Lost readings are NaN.

    Parameters
    ----------
    units : mapping of str to str
        Unit of every signal by its name, such as ``rad/s``; `time` is one of them.
    sample_rate_hz : float
        Rate of the samples [Hz].
    n_time : int
        Number of samples.
    source : callable
        (name, rows) -> samples.
    stamped : bool, optional
        Whether `time` is stamps of a recording, and no multiple of one step.

    Examples
    --------
    >>> group = kept({"rate": np.array([0.0, 0.1, 0.2])}, {"rate": "rad/s"}, sample_rate_hz=10.0)
    >>> group
    Signals(time [s], rate [rad/s]; 3 samples at 10 Hz)
    >>> float(group.rate[-1]) == float(group["rate"][-1]) == 0.2
    True
    >>> group.units["rate"]
    'rad/s'
    """

    def __init__(
        self, units: Mapping[str, str], sample_rate_hz: float, n_time: int, source: Source, *, stamped: bool = False
    ) -> None:
        self.units, self.sample_rate_hz, self.n_time, self.stamped = dict(units), sample_rate_hz, n_time, stamped
        self._source = source

    def read(self, name: str, start: int = 0, stop: int | None = None) -> FloatArray:
        """Return samples `start` <= k < `stop` of a signal in SI, without reading the rest.

        Parameters
        ----------
        name : str
            Which signal.
        start, stop : int, optional
            First sample and the one after the last; all if not given.
        """
        if name not in self.units:
            raise KeyError(name)
        return self._source(name, slice(start, stop))

    def __getitem__(self, name: str) -> FloatArray:
        return self.read(name)

    def __getattr__(self, name: str) -> FloatArray:
        # What is private is no signal: copying and unpickling ask for it before there is anything.
        if name.startswith("_") or name == "units":
            raise AttributeError(name)
        if name not in self.units:
            msg = f"no signal {quoted(name)} (there are {', '.join(self.units)})"
            raise AttributeError(msg)
        return self.read(name)

    def __iter__(self) -> Iterator[str]:
        return iter(self.units)

    def __len__(self) -> int:
        return len(self.units)

    # Arrays have no single truth value, so two groups are the same if they are one.
    __eq__ = object.__eq__
    __hash__ = object.__hash__

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self.units]

    def __repr__(self) -> str:
        named = ", ".join(f"{name} [{unit or '-'}]" for name, unit in self.units.items())
        return f"Signals({named}; {self.n_time} samples at {self.sample_rate_hz:g} Hz)"


@dataclass(frozen=True)
class OneSignal:
    """One signal of a group, read in blocks.

    Parameters
    ----------
    signals : Signals
        The group.
    name : str
        Of the signal.
    """

    signals: Signals
    name: str

    @property
    def n_time(self) -> int:
        """Number of samples."""
        return self.signals.n_time

    @property
    def sample_rate_hz(self) -> float:
        """Rate of the samples [Hz]."""
        return self.signals.sample_rate_hz

    def read(self, start: int, stop: int) -> FloatArray:
        """Return samples `start` <= k < `stop` [SI] in double precision."""
        return np.asarray(self.signals.read(self.name, start, stop), np.float64)

    def blocks(self, size: int) -> Iterator[tuple[int, FloatArray]]:
        """Yield the first sample of each block of `size` samples, and the block [SI]."""
        for start in range(0, self.n_time, size):
            yield start, self.read(start, min(start + size, self.n_time))


class _Kept:
    """Arrays in memory, read-only, also after a copy."""

    def __init__(self, arrays: dict[str, FloatArray]) -> None:
        self._arrays = arrays
        for array in arrays.values():
            array.flags.writeable = False

    def __call__(self, name: str, rows: slice) -> FloatArray:
        return self._arrays[name][rows]

    def __reduce__(self) -> tuple[Any, ...]:
        return _Kept, (self._arrays,)


def kept(
    arrays: Mapping[str, FloatArray],
    units: Mapping[str, str],
    sample_rate_hz: float,
    stamps: FloatArray | None = None,
) -> Signals:
    """Return the group made of arrays in memory, with the coordinate `time` [s] from zero on.

    Parameters
    ----------
    arrays : mapping of str to ndarray, shape (n_time,)
        Samples in SI; they become read-only.
    units : mapping of str to str
        Of each array.
    sample_rate_hz : float
        Rate of the samples [Hz].
    stamps : ndarray, shape (n_time,), optional
        When they were taken, instead of multiples of one step [s].
    """
    n_time = next(iter(arrays.values())).size
    return Signals(
        {"time": "s"} | {name: units[name] for name in arrays},
        sample_rate_hz,
        n_time,
        _Kept({"time": np.arange(n_time) / sample_rate_hz if stamps is None else stamps, **arrays}),
        stamped=stamps is not None,
    )


# What a run has that was told to keep no signals.
NONE = Signals({}, 0.0, 0, _Kept({}))
