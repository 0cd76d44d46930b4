"""Rate records to look at: a column of a text file, or what the sensors of a run read beyond the motion."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from testbed.errors import UnknownNameError
from testbed.runs.text import ColumnFile, quantity, refusal, unit_factor

if TYPE_CHECKING:
    from pathlib import Path

    from testbed.scenario.model import Scenario
    from testbed.signals import FloatArray


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
                raise refusal(source, "expected a file with it; a run folder knows its signals", key)
        return read_run(source, sensor)
    if sensor is not None:
        raise refusal(source, "expected a run folder with it", "--sensor")
    if not source.is_file():
        raise refusal(source, "expected a text file or a run folder, got neither")
    if unit is None:
        raise refusal(source, "expected the unit of the column, such as deg/s", "--unit")
    rate_hz = None if rate is None else quantity(rate, "Hz", "100 Hz", "--rate")
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
    from testbed.runs.results import RunRecord
    from testbed.scenario.loader import load_scenario

    run = RunRecord.open(folder)
    scenario = load_scenario(folder / "scenario.yaml")
    if sensor is not None and sensor not in scenario.sensors:
        raise refusal(folder, str(UnknownNameError("sensor", sensor, scenario.sensors)), "--sensor")
    records = []
    for name in scenario.sensors if sensor is None else [sensor]:
        instrument = scenario.sensors[name]
        noise = run.sensors[name].rate - _silent_readings(scenario, name, run.truth[f"{name}_rate"])
        noise = noise[math.ceil(scenario.frame.settle * instrument.sample_rate) :]
        if not np.isfinite(noise).all():
            missing = int(np.sum(~np.isfinite(noise)))
            raise refusal(folder, f"expected readings without gaps, got {missing} that are missing", f"sensors.{name}")
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
    factor = unit_factor(unit, "rad/s", "deg/s", "--unit")
    second = unit_factor(time_unit, "s", "ms", "--time-unit")
    if (sample_rate_hz is None) == (time is None):
        raise refusal(path, "expected either the sample rate (--rate) or the column of the time (--time)")
    table = ColumnFile(path)
    clock = None if time is None else table.index(time, "--time")
    wanted = table.index(column, "--column") if column is not None else table.only_but(clock)
    values = table.read([wanted] if clock is None else [wanted, clock])
    rate_hz = sample_rate_hz or 0.0
    if clock is not None:
        rate_hz = 1.0 / table.step(values[:, 1] * second)
    return Record(path.stem, values[:, 0] * factor, rate_hz, f"{table.label(wanted)} of {path}")
