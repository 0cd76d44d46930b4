"""Records of rate and temperature to train on or to correct: of a run's fibre-optic gyro, or two columns of a text
file.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from testbed.compensation.record import GyroRecord
from testbed.drift.columns import OPTIONS, Columns
from testbed.errors import UnknownNameError, quoted
from testbed.logs.choice import channel_map, time_map
from testbed.logs.formats import open_table
from testbed.logs.names import quantity_of
from testbed.logs.options import quantity, refusal
from testbed.logs.plan import find_column, labels, option_keys, plan
from testbed.logs.reader import read_plans
from testbed.units import CELSIUS, DEG_H

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from testbed.logs.logmap import TimeMap
    from testbed.logs.plan import Plan
    from testbed.logs.table import Table
    from testbed.signals import FloatArray


@dataclass(frozen=True)
class ThermalRecord:
    """A record and where it comes from.

    Parameters
    ----------
    name : str
        For titles.
    record : GyroRecord
        Rate [rad/s] and temperature [K].
    drift : ndarray, shape (n_time,), or None
        True thermal drift [rad/s], which only a simulation knows.
    """

    name: str
    record: GyroRecord
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


def read_thermal(source: Path, columns: Columns) -> ThermalRecord:
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
        return read_thermal_run(source, columns.sensor)
    if not source.is_file():
        raise refusal(source, "expected a recording or a run folder, got neither")
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


def read_thermal_run(folder: Path, sensor: str | None = None) -> ThermalRecord:
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
    """Return two columns of a recording of any format.

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
    if columns.sample_rate is not None and columns.time is not None:
        raise refusal(path, "expected either the sample rate (--rate) or the column of the time (--time), got both")
    table = open_table(path)
    time = time_map(
        columns.time,
        columns.time_unit,
        quantity(columns.sample_rate, "Hz", "100 Hz", "--rate") if columns.sample_rate else None,
    )
    plans = [
        _planned(table, "rate", columns.rate, columns.rate_unit, "deg/h", time),
        _planned(table, "temperature", columns.temperature, columns.temperature_unit, "degC", time),
    ]
    rate, temperature = read_plans(plans).values()
    return ThermalRecord(path.name, _record(path, rate.whole(), temperature.whole(), rate.rate_hz), None)


def _planned(table: Table, name: str, column: str, unit: str | None, usual: str, time: TimeMap | None) -> Plan:
    """Return how the rate or the temperature is read, in the unit said, that of the file, or the usual one."""
    rate = name == "rate"

    def keys(field: str) -> str:
        return (
            option_keys(field) if rate or field not in {"column", "unit"} else f"--{name}{'-unit' * (field == 'unit')}"
        )

    found = labels(table)[find_column(table, column, keys("column"))].unit
    chosen = unit or found or usual
    if quantity_of(chosen) != name:
        quantity = "K" if name == "temperature" else "rad/s"
        raise refusal(
            table.path, f"expected a quantity in {quantity}, such as '1 {usual}', got {quoted(chosen)}", keys("unit")
        )
    return plan(name, channel_map(column=column, unit=chosen, time=time), table, keys)


def _record(source: Path, rate: FloatArray, temperature: FloatArray, sample_rate_hz: float) -> GyroRecord:
    try:
        return GyroRecord(rate=np.asarray(rate), temperature=np.asarray(temperature), sample_rate_hz=sample_rate_hz)
    except ValueError as error:
        raise refusal(source, str(error)) from error
