"""Motion read from a CSV file."""

from __future__ import annotations

import csv
import hashlib
import io
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import numpy as np
from pydantic import AfterValidator, Field, FieldSerializationInfo, ValidationInfo, field_serializer, model_validator
from scipy.interpolate import CubicSpline

from testbed import units
from testbed.errors import Problem, ScenarioError
from testbed.models.motion import Motion, RateFunction
from testbed.parts import Part

if TYPE_CHECKING:
    from collections.abc import Iterator
    from typing import Self

    from testbed.signals import FloatArray

_JITTER = 1e-3
_BAND_POWER = 1e-6


def _beside_scenario(path: Path, info: ValidationInfo) -> Path:
    """Take a relative path from the scenario's folder, not from where the command is typed."""
    folder = (info.context or {}).get("folder")
    return (Path(folder) / path).resolve() if folder else path


class Column(Part):
    """One column of the file.

    Parameters
    ----------
    column : str
        Its name in the header line.
    unit : str
        Unit of its numbers.
    """

    column: Annotated[str, Field(min_length=1)]
    unit: Annotated[str, Field(min_length=1)]


class Recorded(Motion):
    """Rate measured elsewhere, from a CSV file with a header line, joined by a cubic spline (continuous acceleration).

    Uneven or missing samples are refused with their line: a step may differ from the median step by 0.1 %.

    Parameters
    ----------
    file : Path
        The CSV file; relative to the scenario.
    time, rate : Column
        Name and unit of both columns.
    sha256 : str, optional
        SHA-256 of the file, in hexadecimal; a file that has another is refused. A run folder holds the file itself and
        gives it.

    Raises
    ------
    ScenarioError
        If the file cannot be read, a value is missing or not finite, or the samples are uneven.
    """

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
        """Return the term that reads a copy of its file in `folder`, and nothing else than that."""
        content = self._content()
        copy = folder / f"{name}{self.file.suffix}"
        copy.write_bytes(content)
        return self.model_copy(update={"file": copy, "sha256": hashlib.sha256(content).hexdigest()})

    @model_validator(mode="after")
    def _units(self) -> Self:
        units.parse(f"1 {self.time.unit}", "s", example="s")
        units.parse(f"1 {self.rate.unit}", "rad/s", example="deg/s")
        return self

    def start(self, duration: float, rng: np.random.Generator) -> RateFunction:
        """Return the rate [rad/s] as a function of time [s]; ScenarioError if the record is shorter than `duration`."""
        t, rate = self._read()
        if t[-1] - t[0] < duration:
            msg = f"the record lasts {t[-1] - t[0]:g} s, shorter than the run's {duration:g} s: shorten duration"
            raise ScenarioError([Problem(msg, file=str(self.file))])
        spline = CubicSpline(t - t[0], rate)

        def value(time: FloatArray) -> FloatArray:
            result: FloatArray = spline(time)
            return result

        return value

    def top_frequency(self) -> float:
        """Return the frequency [Hz] above which less than 1e-6 of the power of the rate lies."""
        t, rate = self._read()
        power = np.abs(np.fft.rfft(rate)) ** 2
        below = np.cumsum(power) / max(float(np.sum(power)), np.finfo(float).tiny)
        return float(np.searchsorted(below, 1.0 - _BAND_POWER) / (t[-1] - t[0]))

    def _read(self) -> tuple[FloatArray, FloatArray]:
        """Return time [s] and rate [rad/s], even and finite."""
        lines: list[int] = []
        rows: list[tuple[float, float]] = []
        try:
            for line, pair in self._rows(io.StringIO(self._content().decode("utf-8-sig"), newline="")):
                lines.append(line)
                rows.append(pair)
        except (UnicodeDecodeError, csv.Error) as error:
            self._refuse(f"cannot be read: {error}")
        if len(rows) < 4:
            self._refuse(f"expected at least 4 samples, got {len(rows)}")
        t, rate = np.array(rows).T
        step = float(np.median(np.diff(t)))
        uneven = np.flatnonzero(~(np.abs(np.diff(t) - step) <= _JITTER * abs(step))) if step > 0 else np.array([0])
        if uneven.size:
            i = int(uneven[0])
            self._refuse(
                (
                    f"uneven or missing sample: time goes from {t[i]:g} s to {t[i + 1]:g} s where the usual step is "
                    f"{step:g} s; resample the record"
                ),
                lines[i + 1],
            )
        return t, rate

    def _content(self) -> bytes:
        try:
            content = self.file.read_bytes()
        except OSError as error:
            self._refuse(f"cannot be read: {error}")
        found = hashlib.sha256(content).hexdigest()
        if self.sha256 not in {None, found}:
            self._refuse(f"expected the file whose SHA-256 is {self.sha256}, got {found}: it has changed since")
        return content

    def _rows(self, stream: Any) -> Iterator[tuple[int, tuple[float, float]]]:
        reader = csv.DictReader(stream)
        names = reader.fieldnames or []
        for column in (self.time.column, self.rate.column):
            if column not in names:
                self._refuse(f"no column {column!r}; the header has {', '.join(map(repr, names)) or 'nothing'}", 1)
        second = units.parse(f"1 {self.time.unit}", "s")
        radian = units.parse(f"1 {self.rate.unit}", "rad/s")
        for row in reader:
            try:
                pair = float(row[self.time.column]) * second, float(row[self.rate.column]) * radian
            except (TypeError, ValueError):
                self._refuse("expected a number in both columns", reader.line_num)
            if not all(map(math.isfinite, pair)):
                self._refuse("expected finite numbers", reader.line_num)
            yield reader.line_num, pair

    def _refuse(self, message: str, line: int | None = None) -> NoReturn:
        raise ScenarioError([Problem(message, file=str(self.file), line=line)])
