"""Motion read from a recording."""

from __future__ import annotations

import hashlib
import re
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import numpy as np
from pydantic import AfterValidator, Field, FieldSerializationInfo, ValidationInfo, field_serializer, model_validator

from testbed import units
from testbed.errors import Problem, ScenarioError
from testbed.inputs.files import beside_scenario, read_bytes
from testbed.logs.clock import NANO
from testbed.logs.formats import open_table
from testbed.logs.logmap import ChannelMap, TimeMap
from testbed.logs.options import refusal
from testbed.logs.plan import plan
from testbed.logs.reader import read_plans
from testbed.models.motion import Motion, RateFunction
from testbed.models.turntable.realisation import SPLINE_COST
from testbed.parts import Part

if TYPE_CHECKING:
    from typing import Self

    from testbed.logs.channel import LogChannel
    from testbed.signals import FloatArray

_JITTER = 1e-3
_BAND_POWER = 1e-6
_MOST_BYTES = 1 << 25
_ECHO = re.compile(r"""; the header has|, got ['"]|: ['"]""")


def _beside_scenario(path: Path, info: ValidationInfo) -> Path:
    return beside_scenario(path, info.context or {})


class Column(Part):
    """One column of the file.

    Parameters
    ----------
    column : str
        Its name in the header, or its number from 1 on.
    unit : str
        Unit of its numbers.
    """

    column: Annotated[str, Field(min_length=1)]
    unit: Annotated[str, Field(min_length=1)]


class Recorded(Motion):
    """Rate measured elsewhere, from a recording of any format, joined by a cubic spline (continuous acceleration).

    Uneven or missing samples are refused with their line: a step may differ from the usual one by 0.1 % and what the
    stamps are rounded to.

    Parameters
    ----------
    file : Path
        The recording; relative to the scenario.
    time, rate : Column
        Name and unit of both columns.
    sha256 : str, optional
        SHA-256 of the file, in hexadecimal; a file that has another is refused. A run folder holds the file itself and
        gives it.

    Raises
    ------
    ScenarioError
        If the file cannot be read or is larger than 32 MiB, a value is missing or not finite, or the samples are
        uneven.
    """

    example: ClassVar[dict[str, Any]] = {
        "file": "record.csv",
        "time": {"column": "t", "unit": "s"},
        "rate": {"column": "w", "unit": "deg/s"},
    }
    lasting = False

    file: Annotated[Path, AfterValidator(_beside_scenario)]
    time: Column
    rate: Column
    sha256: Annotated[str, Field(pattern="^[0-9a-f]{64}$")] | None = None

    @field_serializer("file")
    def _from_folder(self, file: Path, info: FieldSerializationInfo) -> str:
        """Write the path from the folder on that the scenario will stand in, if the file lies in it."""
        folder = (info.context or {}).get("folder")
        return str(file.relative_to(folder) if folder and file.is_relative_to(folder) else file)

    def kept_in(self, folder: Path, name: str) -> Self:
        """Return the term that reads a copy of its file in `folder`, and nothing else than that; ScenarioError if
        another file has the copy's name.
        """
        content = self._content()
        copy = folder / f"{name}{self.file.suffix}"
        if not copy.exists():
            copy.write_bytes(content)
        elif copy.stat().st_size != len(content) or copy.read_bytes() != content:
            raise refusal(
                copy, f"a copy of {self.file.name} would replace this file: move it away, or take another folder"
            )
        return self.model_copy(update={"file": copy, "sha256": hashlib.sha256(content).hexdigest()})

    @model_validator(mode="after")
    def _units(self) -> Self:
        units.parse(f"1 {self.time.unit}", "s", example="s")
        units.parse(f"1 {self.rate.unit}", "rad/s", example="deg/s")
        return self

    @property
    def draws(self) -> bool:
        """Whether it is random; see `Motion.draws`."""
        return False

    def start(self, duration: float, rng: np.random.Generator) -> RateFunction:
        """Return the rate [rad/s] as a function of time [s]; ScenarioError if the record is shorter than `duration`."""
        from scipy.interpolate import CubicSpline

        t, rate = self._read()
        if t[-1] - t[0] < duration:
            msg = f"the record lasts {t[-1] - t[0]:g} s, shorter than the run's {duration:g} s: shorten duration"
            raise ScenarioError([Problem(msg, file=str(self.file))])
        spline = CubicSpline(t - t[0], rate)

        def value(time: FloatArray) -> FloatArray:
            result: FloatArray = spline(time)
            return result

        return value

    def n_term(self) -> int:
        """Return how many sines cost as much time as the spline."""
        return SPLINE_COST

    def top_frequency(self) -> float:
        """Return the frequency [Hz] above which less than 1e-6 of the power of the rate lies."""
        t, rate = self._read()
        power = np.abs(np.fft.rfft(rate)) ** 2
        below = np.cumsum(power) / max(float(np.sum(power)), np.finfo(float).tiny)
        return float(np.searchsorted(below, 1.0 - _BAND_POWER) / (t[-1] - t[0]))

    def _read(self) -> tuple[FloatArray, FloatArray]:
        """Return time [s] and rate [rad/s], even and finite."""
        self._content()
        time = TimeMap(column=self.time.column, unit=self.time.unit)
        mapped = ChannelMap(column=self.rate.column, unit=self.rate.unit, kind="rate", time=time)
        try:
            table = open_table(self.file)
            channel = read_plans([plan("rate", mapped, table, lambda field: field.partition(".")[0])])["rate"]
            rate = channel.whole()
        except ScenarioError as error:
            raise ScenarioError([_discreet(problem) for problem in error.problems]) from error
        _refuse_jitter(channel)
        return np.arange(rate.size) / channel.rate_hz, rate

    def _content(self) -> bytes:
        content = read_bytes(self.file, _MOST_BYTES, "a record")
        found = hashlib.sha256(content).hexdigest()
        if self.sha256 not in {None, found}:
            message = f"expected the file whose SHA-256 is {self.sha256}, got {found}: it has changed since"
            raise refusal(self.file, message)
        return content


def _discreet(problem: Problem) -> Problem:
    """Return a finding without what else stands in the file: a scenario names it, so its reader may not know it."""
    if problem.line is not None and "fields" not in problem.message:
        return problem
    return replace(problem, message=_ECHO.split(problem.message, maxsplit=1)[0])


def _refuse_jitter(channel: LogChannel) -> None:
    """Refuse steps that differ by more than a spline bears and the rounding of the stamps explains."""
    assert channel.clock is not None
    assert channel.stamps_ns is not None
    steps, step = np.diff(channel.stamps_ns), channel.clock.step_ns
    uneven = np.flatnonzero(np.abs(steps - step) > _JITTER * step + channel.clock.quantum_ns)
    if uneven.size:
        i = int(uneven[0])
        start, stop = (NANO * float(channel.stamps_ns[k] - channel.stamps_ns[0]) for k in (i, i + 1))
        place = f"time goes from {start:g} s to {stop:g} s after the start"
        message = f"uneven or missing sample: {place} where the usual step is {NANO * step:g} s; resample the record"
        raise refusal(channel.table.path, message, line=channel.table.line(i + 1))
