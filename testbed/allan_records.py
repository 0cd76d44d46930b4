"""Rate records to look at: a column of a text file, or what the sensors of a run read beyond the motion."""

from __future__ import annotations

import csv
import math
import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING, NoReturn

import numpy as np

from testbed import units
from testbed.errors import Problem, ScenarioError, UnknownNameError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from testbed.scenario import Scenario
    from testbed.signals import FloatArray

# Of a step: time stamps are often rounded, and a missing sample is off by a whole one.
_JITTER = 0.25


@dataclass(frozen=True)
class Record:
    """A rate record.

    Parameters
    ----------
    name : str
        For titles and file names.
    rate : ndarray, shape (n_time,)
        Rate [rad/s].
    sample_rate_hz : float
        Its sample rate [Hz].
    content : str
        What it is, for the reader.
    """

    name: str
    rate: FloatArray
    sample_rate_hz: float
    content: str


def read(
    source: Path,
    *,
    column: str | None = None,
    unit: str | None = None,
    rate: str | None = None,
    time: str | None = None,
    time_unit: str = "s",
    sensor: str | None = None,
) -> list[Record]:
    """Return the records that the command line asks for.

    Parameters
    ----------
    source : Path
        Text file or run folder.
    column, unit, rate, time, time_unit : str, optional
        Of a file, as `read_file`; the rate as text, in hertz or with its unit.
    sensor : str, optional
        Of a run, as `read_run`.

    Raises
    ------
    ScenarioError
        If something is missing, not understood or belongs to the other kind of source.
    """
    of_file = {"--column": column, "--unit": unit, "--rate": rate, "--time": time}
    if source.is_dir():
        for key, value in of_file.items():
            if value is not None:
                raise _bad(source, "expected a file with it; a run folder knows its signals", key)
        return read_run(source, sensor)
    if sensor is not None:
        raise _bad(source, "expected a run folder with it", "--sensor")
    if not source.is_file():
        raise _bad(source, "expected a text file or a run folder, got neither")
    if unit is None:
        raise _bad(source, "expected the unit of the column, such as deg/s", "--unit")
    rate_hz = None if rate is None else _frequency(rate)
    return [read_file(source, unit=unit, column=column, sample_rate_hz=rate_hz, time=time, time_unit=time_unit)]


def read_run(folder: Path, sensor: str | None = None) -> list[Record]:
    """Return what each sensor of a run read after settling, less what it reads of the same truth without noise.

    So neither the motion nor the sensor's dynamics show, on a moving table as at standstill.

    Parameters
    ----------
    folder : Path
        Run folder.
    sensor : str, optional
        Only this one.

    Returns
    -------
    list of Record
        In the order of the scenario.

    Raises
    ------
    ScenarioError
        If it is no run folder, the sensor is not in it or its readings have gaps.
    """
    from testbed.loader import load_scenario
    from testbed.store import open_run

    run = open_run(folder)
    scenario = load_scenario(folder / "scenario.yaml")
    if sensor is not None and sensor not in scenario.sensors:
        raise _bad(folder, str(UnknownNameError("sensor", sensor, scenario.sensors)), "--sensor")
    records = []
    for name in scenario.sensors if sensor is None else [sensor]:
        instrument = scenario.sensors[name]
        noise = run.sensors[name].rate - _silent_readings(scenario, name, run.truth[f"{name}_rate"])
        noise = noise[math.ceil(scenario.frame.settle * instrument.sample_rate) :]
        if not np.isfinite(noise).all():
            missing = int(np.sum(~np.isfinite(noise)))
            raise _bad(folder, f"expected readings without gaps, got {missing} that are missing", f"sensors.{name}")
        content = f"{name} of {scenario.name}, less its noise-free reading, from {scenario.frame.settle:g} s on"
        records.append(Record(f"{scenario.name}_{name}", noise, instrument.sample_rate, content))
    return records


def _silent_readings(scenario: Scenario, name: str, true_rate: FloatArray) -> FloatArray:
    """Return what a sensor reads of the true rate without noise, level, at the temperature of the run."""
    from testbed.sensors.base import ExposedStage, Surroundings

    instrument, base = scenario.sensors[name], scenario.base_rate_hz
    stage = instrument.model_copy(update={"noise": False}).start(base, scenario.frame.seed, name)
    if not isinstance(stage, ExposedStage):
        return stage.process(true_rate)
    temperature = scenario.frame.temperature.at(0, true_rate.size, base)
    return stage.process_in(true_rate, Surroundings(temperature=temperature))


def read_file(
    path: Path,
    *,
    unit: str,
    column: str | None = None,
    sample_rate_hz: float | None = None,
    time: str | None = None,
    time_unit: str = "s",
) -> Record:
    """Return a column of a text file (commas, semicolons, tabs or spaces; ``#`` starts a comment; header or not).

    Parameters
    ----------
    path : Path
        The file.
    unit : str
        Unit of the column, such as ``deg/s``.
    column : str, optional
        Its name in the header, or its number from 1 on; may be left out if there is but one beside the time.
    sample_rate_hz : float, optional
        Sample rate [Hz], unless `time` is given.
    time : str, optional
        Column of the time, instead of the sample rate.
    time_unit : str, optional
        Its unit.

    Returns
    -------
    Record
        The record in SI.

    Raises
    ------
    ScenarioError
        If something is missing, not understood, no number, or uneven in time; with the line.
    """
    factor = _factor(unit, "rad/s", "deg/s", "--unit")
    second = _factor(time_unit, "s", "ms", "--time-unit")
    if (sample_rate_hz is None) == (time is None):
        raise _bad(path, "expected either the sample rate (--rate) or the column of the time (--time)")
    table = _Table(path)
    clock = None if time is None else table.index(time, "--time")
    wanted = table.index(column, "--column") if column is not None else table.only_but(clock)
    values = table.read([wanted] if clock is None else [wanted, clock])
    rate_hz = sample_rate_hz or 0.0
    if clock is not None:
        rate_hz = 1.0 / table.step(values[:, 1] * second)
    return Record(path.stem, values[:, 0] * factor, rate_hz, f"{table.label(wanted)} of {path}")


def _frequency(text: str) -> float:
    try:
        value = float(text) if _is_number(text) else units.parse(text, "Hz", example="100 Hz")
    except ValueError as error:
        raise ScenarioError([Problem(str(error), key="--rate")]) from error
    if not (value > 0.0 and math.isfinite(value)):
        raise ScenarioError([Problem(f"expected more than 0 Hz, got {text}", key="--rate")])
    return value


def _factor(unit: str, si: str, example: str, key: str) -> float:
    try:
        return units.parse(f"1 {unit}", si, example=f"1 {example}")
    except ValueError as error:
        raise ScenarioError([Problem(str(error), key=key)]) from error


def _bad(path: Path, message: str, key: str = "", line: int | None = None) -> ScenarioError:
    return ScenarioError([Problem(message, key=key, file=str(path), line=line)])


class _Table:
    """Columns of numbers in a text file."""

    def __init__(self, path: Path) -> None:
        self._path = path
        first = next(self._lines(), None)
        if first is None:
            self._refuse("expected a column of numbers, got nothing")
        line, text = first
        self._delimiter = next((mark for mark in ",;\t" if mark in text), None)
        fields = self._split(text)
        has_header = not all(map(_is_number, fields))
        self._names = fields if has_header else []
        self._n_columns, self._skip = len(fields), line if has_header else line - 1

    def index(self, column: str, key: str) -> int:
        """Return the place of a column given by its name or its number."""
        if column in self._names:
            return self._names.index(column)
        if not (column.isdigit() and 1 <= int(column) <= self._n_columns):
            known = (
                f"the header has {', '.join(map(repr, self._names))}" if self._names else f"there are {self._n_columns}"
            )
            self._refuse(f"no column {column!r}; {known}", key=key)
        return int(column) - 1

    def only_but(self, clock: int | None) -> int:
        """Return the only column beside the one of the time."""
        rest = [i for i in range(self._n_columns) if i != clock]
        if len(rest) != 1:
            self._refuse(f"expected one of {', '.join(map(self.label, rest)) or 'several columns'}", key="--column")
        return rest[0]

    def label(self, index: int) -> str:
        return repr(self._names[index]) if self._names else f"column {index + 1}"

    def read(self, columns: list[int]) -> FloatArray:
        """Return the columns, finite; the fast way, and line by line only to find a fault."""
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", UserWarning)  # of an empty file
                values: FloatArray = np.loadtxt(
                    self._path,
                    delimiter=self._delimiter,
                    skiprows=self._skip,
                    usecols=columns,
                    ndmin=2,
                    encoding="utf-8-sig",
                    quotechar='"',
                )
        except ValueError as error:
            self._refuse_fault(columns)
            self._refuse(f"cannot be read: {error}")
        if not np.isfinite(values).all():
            self._refuse_fault(columns)
        if len(values) < 4:
            self._refuse(f"expected at least 4 samples, got {len(values)}")
        return values

    def step(self, t: FloatArray) -> float:
        """Return the mean step [s] of even times."""
        steps = np.diff(t)
        usual = float(np.median(steps))
        if not usual > 0.0:
            self._refuse("expected times that increase", key="--time")
        uneven = np.flatnonzero(np.abs(steps - usual) > _JITTER * usual)
        if uneven.size:
            i = int(uneven[0])
            message = f"uneven or missing sample: time goes from {t[i]:g} s to {t[i + 1]:g} s where the usual step is {usual:g} s"
            rows = (line for line, _ in self._lines() if line > self._skip)
            line = next(line for row, line in enumerate(rows) if row == i + 1)
            self._refuse(message, line)
        return float((t[-1] - t[0]) / (t.size - 1))

    def _refuse_fault(self, columns: list[int]) -> None:
        for line, text in self._lines():
            if line <= self._skip:
                continue
            fields = self._split(text)
            for index in columns:
                value = fields[index] if index < len(fields) else ""
                if not _is_number(value) or not math.isfinite(float(value)):
                    self._refuse(f"expected a finite number in {self.label(index)}, got {value!r}", line)

    def _split(self, text: str) -> list[str]:
        if self._delimiter is None:
            return text.split()
        return [field.strip() for field in next(csv.reader([text], delimiter=self._delimiter))]

    def _lines(self) -> Iterator[tuple[int, str]]:
        """Yield number and text of the lines that hold something."""
        try:
            with self._path.open(encoding="utf-8-sig") as stream:
                for line, text in enumerate(stream, 1):
                    content = text.split("#", 1)[0].strip()
                    if content:
                        yield line, content
        except (OSError, UnicodeDecodeError) as error:
            self._refuse(f"cannot be read: {error}")

    def _refuse(self, message: str, line: int | None = None, key: str = "") -> NoReturn:
        raise _bad(self._path, message, key, line)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
