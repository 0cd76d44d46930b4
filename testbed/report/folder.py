"""A finished run folder: its metrics, its scenario and its signals, read in blocks."""

from __future__ import annotations

import json
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np
from pydantic import AliasChoices, BaseModel, ConfigDict, Field, ValidationError

from testbed.errors import Problem, ScenarioError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from testbed.signals import FloatArray


class _Metrics(BaseModel):
    model_config = ConfigDict(extra="allow", frozen=True)


class LineMetrics(_Metrics):
    """Gain [-] and phase [deg] of an estimate over the truth at one commanded frequency [Hz]."""

    frequency_hz: float
    gain: float | None = None
    phase_deg: float | None = None
    error_deg_s: float | None = None
    optimum_deg_s: float | None = None


class ConsistencyMetrics(_Metrics):
    """How a filter's claims hold [-]: normalised error squared, per sensor (further keys) innovations and their
    whiteness, and the verdict.
    """

    nees: float | None = None
    verdict: str | None = None


class SourceMetrics(_Metrics):
    """Errors of one sensor or filter [deg/s]; None where undefined."""

    rmse_deg_s: float | None = None
    rmse_aligned_deg_s: float | None = None
    peak_error_deg_s: float | None = None
    floor_rmse_deg_s: float | None = None
    optimum_rmse_deg_s: float | None = None
    mean_std_deg_s: float | None = None
    inside_2_std: float | None = None
    consistency: ConsistencyMetrics | None = None
    belief: str | None = None
    lines: list[LineMetrics] | None = None


class Expectation(_Metrics):
    """A bound of the scenario on a sensor or filter, the value that was reached and whether it was met."""

    subject: str = Field(validation_alias=AliasChoices("subject", "filter"))
    metric: str
    bound: str | float
    value: float | None = None
    met: bool


class FloorDensity(_Metrics):
    """Two-sided root density of the noise floor [deg/s/sqrt(Hz)] against frequency [Hz]."""

    frequency_hz: list[float]
    density: list[float]


class Band(_Metrics):
    """What each sensor, and all together, leave in the best combination between two frequencies [deg/s]."""

    low_hz: float
    high_hz: float
    floor_deg_s: float
    sensors_deg_s: dict[str, float]


class Budget(_Metrics):
    """Crossovers [Hz], bands, and root densities of the sensors' noise [deg/s/sqrt(Hz)] against frequency [Hz]."""

    crossovers_hz: list[float]
    bands: list[Band]
    frequency_hz: list[float]
    densities: dict[str, list[float | None]]

    def combined(self) -> FloatArray:
        """Return the root density of the best combination [deg/s/sqrt(Hz)], shape (n_freq,)."""
        information = np.zeros(len(self.frequency_hz))
        for density in self.densities.values():
            information += [0.0 if one is None else one**-2 for one in density]
        with np.errstate(divide="ignore"):
            return np.asarray(information**-0.5)


class RunMetrics(_Metrics):
    """Content of ``metrics.json``."""

    scenario: str
    seed: int
    duration_s: float = Field(gt=0)
    settle_s: float = Field(ge=0)
    bandwidth_hz: float | None = None
    versions: dict[str, Any] = {}
    sensors: dict[str, SourceMetrics]
    fusion: dict[str, SourceMetrics]
    turntable: SourceMetrics | None = None
    expectations: list[Expectation] = []
    floor_density: FloorDensity | None = None
    budget: Budget | None = None

    @property
    def line_freq_hz(self) -> list[float]:
        """Frequencies of the commanded lines [Hz], increasing."""
        sources = [*self.sensors.values(), *self.fusion.values()]
        return sorted({line.frequency_hz for source in sources for line in source.lines or []})


def _bad(path: Path, key: str, message: str) -> ScenarioError:
    return ScenarioError([Problem(message, key=key, file=str(path))])


def read_text(path: Path, content: str) -> str:
    """Return the text of `path`; `content` says in the error message what it should hold."""
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise _bad(path, "", f"expected {content}, got {error}") from error


def read_metrics(path: Path) -> RunMetrics:
    """Return the checked content of ``metrics.json``.

    Raises
    ------
    ScenarioError
        If the file cannot be read, is no JSON, or lacks something; every finding with its key.
    """
    text = read_text(path, "the metrics of a run (JSON)")
    try:
        return RunMetrics.model_validate(json.loads(text))
    except json.JSONDecodeError as error:
        problem = Problem(f"expected JSON, got {error.msg}", file=str(path), line=error.lineno)
        raise ScenarioError([problem]) from error
    except ValidationError as error:
        problems = [
            Problem(f"{found['msg']}, got {found['input']!r:.80}", ".".join(map(str, found["loc"])), str(path))
            for found in error.errors()
        ]
        raise ScenarioError(problems) from error


@dataclass(frozen=True)
class Signal:
    """One variable of ``run.nc``, read when asked for."""

    values: Any
    sample_rate_hz: float

    @property
    def n_time(self) -> int:
        """Number of samples."""
        return int(self.values.shape[0])

    def read(self, start: int, stop: int) -> FloatArray:
        """Return the samples `start` <= k < `stop`, shape (n_time,), SI."""
        return np.asarray(self.values[start:stop], dtype=np.float64)


class RunData:
    """Signals of an open ``run.nc`` by the path of their group, as in ``fusion/kalman``."""

    def __init__(self, path: Path, file: Any) -> None:
        self._path, self._file = path, file

    def signal(self, group: str, name: str, units: str = "rad/s") -> Signal:
        """Return a variable, its units and its time base checked.

        Parameters
        ----------
        group, name : str
            Where it is, as in ``fusion/kalman`` and ``std``.
        units : str
            Units that it must have.

        Raises
        ------
        ScenarioError
            If it is missing, has other units, or its time is not uniform from zero.
        """
        key = f"{group}/{name}"
        if key not in self._file or f"{group}/time" not in self._file:
            raise _bad(self._path, key, "expected a variable with the coordinate time, got none")
        values, time = self._file[key], self._file[f"{group}/time"]
        found = _text(values.attrs.get("units"))
        if found != units:
            raise _bad(self._path, key, f"expected units {units!r}, got {found!r}")
        if values.shape != time.shape or values.ndim != 1 or values.shape[0] < 2:
            raise _bad(self._path, key, f"expected at least 2 samples along time {time.shape}, got {values.shape}")
        return Signal(values, self._sample_rate(f"{group}/time", time))

    def has(self, group: str, name: str) -> bool:
        """Return whether there is a variable `name` in `group`."""
        return f"{group}/{name}" in self._file

    def _sample_rate(self, key: str, time: Any) -> float:
        first, last = float(time[0]), float(time[-1])
        if first != 0.0 or not last > 0.0:
            raise _bad(self._path, key, f"expected time from 0 s on, increasing, got {first} s to {last} s")
        return float((time.shape[0] - 1) / last)

    def stride(self, group: str, signal: Signal, reference: Signal) -> int:
        """Return how many samples of `reference` lie in one step of `signal`; it must be a whole number."""
        ratio = reference.sample_rate_hz / signal.sample_rate_hz
        stride = round(ratio)
        # Rates come from the last time stamp: rounding leaves a relative error of about 1e-12, a drift of one sample
        # over the run is 1 / n.
        if stride < 1 or abs(ratio - stride) * signal.n_time > 0.5 or (signal.n_time - 1) * stride >= reference.n_time:
            message = (
                f"expected a time that steps by whole samples of truth inside its span, got a ratio of {ratio:.9g}"
            )
            raise _bad(self._path, f"{group}/time", message)
        return stride


def _text(attribute: Any) -> str:
    return attribute.decode() if isinstance(attribute, bytes) else str(attribute)


@contextmanager
def open_run(path: Path) -> Iterator[RunData]:
    """Open ``run.nc`` for reading in blocks.

    Raises
    ------
    ScenarioError
        If it is missing or no NetCDF-4 file, or if it breaks off inside (also while it is read in the ``with`` block).
    """
    try:
        with h5py.File(path, "r") as file:
            yield RunData(path, file)
    except OSError as error:
        raise _bad(path, "", f"expected a complete NetCDF-4 file, got: {error}") from error
