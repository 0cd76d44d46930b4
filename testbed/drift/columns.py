"""Which columns of a text file are rate, temperature and time: options of every command that reads one."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Any


def _option(default: Any, option: str, text: str) -> Any:
    return field(default=default, metadata={"option": option, "help": text})


@dataclass(frozen=True)
class Columns:
    """How to read a text file; a run folder needs none of it but, where it has several such gyros, `sensor`.

    The metadata of each field are its option on the command line.

    Parameters
    ----------
    rate, temperature : str
        Columns, by their name in the header or their number from 1 on.
    rate_unit, temperature_unit : str
        Their units, such as ``deg/h`` and ``degC``.
    sample_rate : str, optional
        In hertz or with its unit, unless `time` is given.
    time : str, optional
        Column of the time.
    time_unit : str
        Its unit.
    sensor : str, optional
        Of a run folder.
    """

    rate: str = _option("rate", "--column", "Column of the rate, by name or number from 1 on.")
    rate_unit: str = _option("deg/h", "--unit", "Unit of the rate.")
    temperature: str = _option("temperature", "--temperature", "Column of the temperature.")
    temperature_unit: str = _option("degC", "--temperature-unit", "Unit of the temperature, degC or K.")
    sample_rate: str | None = _option(None, "--rate", "Sample rate of a file, as 1 or '1 Hz'.")
    time: str | None = _option(None, "--time", "Column of the time, instead of the sample rate.")
    time_unit: str = _option("s", "--time-unit", "Unit of the time.")
    sensor: str | None = _option(None, "--sensor", "Sensor of a run folder that has several with a thermometer.")


# Of a text file, by the field of `Columns`.
OPTIONS = {part.name: part.metadata["option"] for part in fields(Columns) if part.name != "sensor"}
