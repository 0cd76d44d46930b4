"""What a run leaves: groups of signals by name, and the metrics."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Self

import numpy as np

from testbed.errors import Problem, ScenarioError
from testbed.runs.attributes import unit_of
from testbed.runs.block import clock_of, columns
from testbed.runs.folder import ESSENTIAL, SIGNALS
from testbed.runs.leftovers import heal
from testbed.runs.metrics import RunMetrics, read_metrics
from testbed.runs.outputs import writes
from testbed.runs.signals import NONE, Signals, kept

if TYPE_CHECKING:
    from collections.abc import Mapping

    from testbed.runs.block import PlayedBlock, RunBlock
    from testbed.signals import FloatArray


@dataclass(frozen=True, repr=False)
class RunRecord:
    """A finished run: signals in SI and metrics.

    `commanded` and `truth` are on the base clock, each sensor of `sensors` on its own, each filter of `fusion` on that
    of its fastest sensor; `pointing` has, by filter, what is left of the line of sight. `metrics` is what metrics.json
    holds; `folder` is where the run is stored, None if it is in memory only. Of a replayed recording `commanded` is
    empty, and `truth` is its reference, empty if there is none.
    """

    commanded: Signals
    truth: Signals
    sensors: Mapping[str, Signals]
    fusion: Mapping[str, Signals]
    metrics: RunMetrics
    folder: Path | None = None
    pointing: Mapping[str, Signals] = field(default_factory=dict)

    @classmethod
    def of(cls, groups: Mapping[str, Signals], metrics: RunMetrics, folder: Path | None = None) -> Self:
        """Return the run made of `groups` named as in run.nc."""

        def below(prefix: str) -> dict[str, Signals]:
            return {
                group.removeprefix(prefix): signals for group, signals in groups.items() if group.startswith(prefix)
            }

        return cls(
            groups.get("commanded", NONE),
            groups.get("truth", NONE),
            below("sensors/"),
            below("fusion/"),
            metrics,
            folder,
            below("pointing/"),
        )

    @classmethod
    def open(cls, folder: str | Path, *, signals: bool = True) -> Self:
        """Open a run folder; its signals are read when they are asked for.

        Parameters
        ----------
        folder : str or Path
            A run folder.
        signals : bool, optional
            Refuse a run that was told to keep none; otherwise its groups are empty.

        Raises
        ------
        ScenarioError
            If it is no run folder, or a file in it is damaged.
        """
        path = Path(folder).absolute()
        heal(path)
        missing = [name for name in ESSENTIAL if not (path / name).is_file()]
        if missing == [SIGNALS] and not writes(path, "netcdf"):
            if not signals:
                return cls.of(dict.fromkeys(("commanded", "truth"), NONE), read_metrics(path / "metrics.json"), path)
            problem = "holds no signals: it was run without netcdf among its outputs; run it again with it"
            raise ScenarioError([Problem(problem, file=str(folder))])
        if missing:
            problem = f"expected a run folder, but {', '.join(str(Path(folder) / name) for name in missing)} is missing"
            raise ScenarioError([Problem(problem, file=str(folder))])
        from testbed.runs.reading import read_groups

        metrics, groups = read_metrics(path / "metrics.json"), read_groups(path / SIGNALS)
        for group in () if metrics.replay else ("commanded", "truth"):
            if group not in groups:
                raise ScenarioError([Problem("expected this group, got none", group, str(path / "run.nc"))])
        return cls.of(groups, metrics, path)

    @property
    def groups(self) -> dict[str, Signals]:
        """Every group of signals by its path in run.nc, such as ``fusion/kalman``."""
        return {
            **{name: one for name, one in (("commanded", self.commanded), ("truth", self.truth)) if one.n_time},
            **{f"sensors/{name}": signals for name, signals in self.sensors.items()},
            **{f"fusion/{name}": signals for name, signals in self.fusion.items()},
            **{f"pointing/{name}": signals for name, signals in self.pointing.items()},
        }

    def __repr__(self) -> str:
        known = {name: source.rmse_deg_s for name, source in self.metrics.fusion.items()}
        errors = [f"{name} {'undefined' if rmse is None else f'{rmse:.4g} deg/s'}" for name, rmse in known.items()]
        place = [] if self.folder is None else [str(self.folder)]
        made = "replayed" if self.metrics.seed is None else f"seed {self.metrics.seed}"
        head = f"{self.metrics.scenario}, {self.metrics.duration_s:g} s, {made}"
        return f"<Run {'; '.join([head, *([', '.join(errors)] if errors else []), *place])}>"


class MemoryStore:
    """Keeps every signal of a run in memory.

    Parameters
    ----------
    rates : mapping
        Sample rate [Hz] of ``base`` and of every sensor and filter by its name.
    times : mapping of str to ndarray, shape (n_time,), optional
        As for `NetcdfStore`.
    """

    def __init__(self, rates: Mapping[str, float], times: Mapping[str, FloatArray] | None = None) -> None:
        self._rates, self._times = rates, times
        self._parts: dict[str, dict[str, list[FloatArray]]] = {}
        self._rate_of: dict[str, float] = {}

    def write(self, block: RunBlock | PlayedBlock) -> None:
        """Keep a block."""
        for group, name, _, rate, values in columns(block, self._rates):
            self._parts.setdefault(group, {}).setdefault(name, []).append(values)
            self._rate_of[group] = rate

    def groups(self) -> dict[str, Signals]:
        """Return what was kept, by group."""
        return {group: self._signals(group) for group in self._parts}

    def _signals(self, group: str) -> Signals:
        arrays = {name: np.concatenate(parts) for name, parts in self._parts[group].items()}
        stamps = None if self._times is None else self._times.get(clock_of(group))
        return kept(arrays, {name: unit_of(group, name) for name in arrays}, self._rate_of[group], stamps)
