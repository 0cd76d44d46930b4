"""Records of rate and temperature to train on or to correct: of a run's fibre-optic gyro, or two columns of a text
file.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from testbed import units
from testbed.compensation.record import Record
from testbed.drift.columns import OPTIONS, Columns
from testbed.errors import Problem, ScenarioError, UnknownNameError
from testbed.runs.text import ColumnFile, quantity, refusal, unit_factor
from testbed.units import CELSIUS, DEG_H

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from testbed.signals import FloatArray


@dataclass(frozen=True)
class ThermalRecord:
    """A record and where it comes from.

    Parameters
    ----------
    name : str
        For titles.
    record : Record
        Rate [rad/s] and temperature [K].
    drift : ndarray, shape (n_time,), or None
        True thermal drift [rad/s], which only a simulation knows.
    """

    name: str
    record: Record
    drift: FloatArray | None

    @property
    def fingerprint(self) -> str:
        """Digest of the samples, by which a record is known again."""
        return hashlib.sha256(self.record.rate.tobytes() + self.record.temperature.tobytes()).hexdigest()

    def __str__(self) -> str:
        """Say how long it is and what it spans: swapped columns and wrong units show."""
        record = self.record
        rate, heat = record.rate / DEG_H, record.temperature - CELSIUS
        return (
            f"{self.name}, {record.duration / 3600.0:.2f} h at {record.sample_rate_hz:g} Hz, "
            f"rate {rate.min():.4g} to {rate.max():.4g} deg/h, temperature {heat.min():.1f} to {heat.max():.1f} degC"
        )


def read(source: Path, columns: Columns) -> ThermalRecord:
    """Return the record of a run folder or of a text file.

    Parameters
    ----------
    source : Path
        Either.
    columns : Columns
        How to read it.

    Returns
    -------
    ThermalRecord
        In SI.

    Raises
    ------
    ScenarioError
        If something is missing, not understood, no number or uneven in time.
    """
    if source.is_dir():
        return read_run(source, columns.sensor)
    if not source.is_file():
        raise refusal(source, "expected a text file or a run folder, got neither")
    return read_file(source, columns)


def check_options(sources: Sequence[Path], columns: Columns) -> None:
    """Refuse an option that none of the sources needs: it would be ignored.

    Parameters
    ----------
    sources : sequence of Path
        Run folders and text files.
    columns : Columns
        How to read them.

    Raises
    ------
    ScenarioError
        If all are run folders and a column is named, or none is and a sensor is.
    """
    if columns.sensor is not None and not any(source.is_dir() for source in sources):
        raise refusal(sources[0], "expected a run folder with it", "--sensor")
    if all(source.is_dir() for source in sources):
        for name, option in OPTIONS.items():
            if getattr(columns, name) != getattr(Columns, name):
                raise refusal(sources[0], "expected a text file with it; a run folder knows its signals", option)


def read_run(folder: Path, sensor: str | None = None) -> ThermalRecord:
    """Return the readings of a gyro with a thermometer.

    Parameters
    ----------
    folder : Path
        Run folder.
    sensor : str, optional
        Which one, if the run has several.

    Returns
    -------
    ThermalRecord
        With the true drift.

    Raises
    ------
    ScenarioError
        If it is no run folder, or has no such gyro or several.
    """
    from testbed.runs.results import RunRecord

    run = RunRecord.open(folder)
    known = [name for name, signals in run.sensors.items() if "temperature" in signals]
    if sensor is not None and sensor not in known:
        raise refusal(folder, str(UnknownNameError("sensor with a thermometer", sensor, known)), "--sensor")
    if sensor is None and len(known) != 1:
        raise refusal(folder, f"expected one sensor with a thermometer, got {known or 'none'}", "--sensor")
    name = sensor or known[0]
    signals = run.sensors[name]
    drift = np.asarray(run.truth[f"{name}_drift"])
    rate_hz = 1.0 / float(signals.time[1] - signals.time[0])
    stride = round((drift.size - 1) / (signals.rate.size - 1))
    record = _record(folder, signals.rate, signals.temperature, rate_hz)
    return ThermalRecord(f"{folder.resolve().name}, {name}", record, drift[::stride][: record.rate.size])


def read_file(path: Path, columns: Columns) -> ThermalRecord:
    """Return two columns of a text file (commas, semicolons, tabs or spaces; ``#`` starts a comment; header or not).

    Parameters
    ----------
    path : Path
        The file.
    columns : Columns
        How to read it.

    Returns
    -------
    ThermalRecord
        In SI, without a true drift.

    Raises
    ------
    ScenarioError
        If something is missing, not understood, no number or uneven in time; with the line.
    """
    rate_factor = unit_factor(columns.rate_unit, "rad/s", "deg/h", "--unit")
    zero, kelvin = _temperature_scale(columns.temperature_unit)
    second = unit_factor(columns.time_unit, "s", "h", "--time-unit")
    if (columns.sample_rate is None) == (columns.time is None):
        got = "neither" if columns.time is None else "both"
        raise refusal(path, f"expected either the sample rate (--rate) or the column of the time (--time), got {got}")
    table = ColumnFile(path)
    wanted = [table.index(columns.rate, "--column"), table.index(columns.temperature, "--temperature")]
    clock = [] if columns.time is None else [table.index(columns.time, "--time")]
    values = table.read(wanted + clock)
    rate_hz = (
        quantity(columns.sample_rate, "Hz", "100 Hz", "--rate")
        if columns.sample_rate
        else 1.0 / table.step(values[:, 2] * second)
    )
    record = _record(path, values[:, 0] * rate_factor, zero + kelvin * values[:, 1], rate_hz)
    return ThermalRecord(path.name, record, None)


def _temperature_scale(unit: str) -> tuple[float, float]:
    """Return 0 of the unit in kelvin, and its size."""
    try:
        zero, one = (units.parse(f"{value} {unit}", "K", example=f"{value} degC") for value in (0, 1))
    except ValueError as error:
        raise ScenarioError([Problem(str(error), key="--temperature-unit")]) from error
    return zero, one - zero


def _record(source: Path, rate: FloatArray, temperature: FloatArray, sample_rate_hz: float) -> Record:
    try:
        return Record(rate=np.asarray(rate), temperature=np.asarray(temperature), sample_rate_hz=sample_rate_hz)
    except ValueError as error:
        raise refusal(source, str(error)) from error
