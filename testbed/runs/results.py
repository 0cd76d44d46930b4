"""What a run leaves: groups of signals by name, and the metrics."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.runs.block import columns

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping
    from pathlib import Path

    from testbed.runs.block import RunBlock
    from testbed.signals import FloatArray


class Signals:
    """Signals of one group as attributes and items: ``group.rate``, ``group["rate"]``, ``group.time``.

    Each is a NumPy array; of a run on disk it is read when it is asked for.

    Parameters
    ----------
    names : tuple of str
        What there is.
    read : callable
        Name -> array.
    """

    def __init__(self, names: tuple[str, ...], read: Callable[[str], FloatArray]) -> None:
        self._names = names
        self._read = read

    def __getitem__(self, name: str) -> FloatArray:
        if name not in self._names:
            raise KeyError(name)
        return self._read(name)

    def __getattr__(self, name: str) -> FloatArray:
        if name.startswith("_") or name not in self._names:
            msg = f"no signal {name!r} (there are {', '.join(self._names)})"
            raise AttributeError(msg)
        return self._read(name)

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self._names]

    def __repr__(self) -> str:
        return f"Signals({', '.join(self._names)})"


@dataclass(frozen=True)
class Run:
    """A finished run: signals in SI and metrics.

    `commanded` and `truth` are on the base clock, each sensor of `sensors` on its own, each filter of `fusion` on that
    of its fastest sensor. `metrics` is the content of metrics.json; `folder` is where the run is stored, None if it is
    in memory only.
    """

    commanded: Signals
    truth: Signals
    sensors: Mapping[str, Signals]
    fusion: Mapping[str, Signals]
    metrics: dict[str, Any]
    folder: Path | None = None


class MemoryStore:
    """Keeps every signal of a run in memory.

    Parameters
    ----------
    rates : mapping
        Sample rate [Hz] of ``base`` and of every sensor and filter by its name.
    """

    def __init__(self, rates: Mapping[str, float]) -> None:
        self._rates = rates
        self._parts: dict[str, dict[str, list[FloatArray]]] = {}
        self._rate_of: dict[str, float] = {}

    def write(self, block: RunBlock) -> None:
        """Keep a block."""
        for group, name, _, rate, values in columns(block, self._rates):
            self._parts.setdefault(group, {}).setdefault(name, []).append(values)
            self._rate_of[group] = rate

    def groups(self) -> dict[str, Signals]:
        """Return what was kept, by group."""
        return {group: self._signals(group) for group in self._parts}

    def _signals(self, group: str) -> Signals:
        arrays = {name: np.concatenate(parts) for name, parts in self._parts[group].items()}
        arrays = {"time": np.arange(next(iter(arrays.values())).size) / self._rate_of[group], **arrays}
        for array in arrays.values():
            array.flags.writeable = False
        return Signals(tuple(arrays), arrays.__getitem__)


def assemble(groups: Mapping[str, Signals], metrics: dict[str, Any], folder: Path | None = None) -> Run:
    """Return the run made of `groups` named as in run.nc."""

    def below(prefix: str) -> dict[str, Signals]:
        return {group.removeprefix(prefix): signals for group, signals in groups.items() if group.startswith(prefix)}

    return Run(groups["commanded"], groups["truth"], below("sensors/"), below("fusion/"), metrics, folder)
