"""Which columns of a recording are rate, temperature and time: options of every command that reads one."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Any, ClassVar


def _option(default: Any, option: str, text: str) -> Any:
    return field(default=default, metadata={"option": option, "help": text})


@dataclass(frozen=True)
class Columns:
    """How to read a recording; a run folder needs none of it but, where it has several such gyros, `sensor`.

    The metadata of each field are its option on the command line.

    Parameters
    ----------
    rate, temperature : str
        Columns, by their name in the header or their number from 1 on.
    rate_unit, temperature_unit : str, optional
        Their units; those in the file if left out, or deg/h and degC where it says none.
    sample_rate : str, optional
        In hertz or with its unit, unless `time` is given.
    time : str, optional
        Column of the time.
    time_unit : str, optional
        Its unit; that in the file if left out, or seconds.
    sensor : str, optional
        Of a run folder.
    """

    PANEL: ClassVar[str] = "Columns"

    rate: str = _option("rate", "--column", "Column of the rate, by name or number from 1 on.")
    rate_unit: str | None = _option(None, "--unit", "Unit of the rate; default that in the file, or deg/h.")
    temperature: str = _option("temperature", "--temperature", "Column of the temperature.")
    temperature_unit: str | None = _option(
        None, "--temperature-unit", "Unit of the temperature; default that in the file, or degC."
    )
    sample_rate: str | None = _option(None, "--rate", "Sample rate of a file, as 1 or '1 Hz'.")
    time: str | None = _option(None, "--time", "Column of the time, instead of the sample rate.")
    time_unit: str | None = _option(None, "--time-unit", "Unit of the time; default that in the file, or s.")
    sensor: str | None = _option(None, "--sensor", "Sensor of a run folder that has several with a thermometer.")


# Of a recording, by the field of `Columns`.
OPTIONS = {part.name: part.metadata["option"] for part in fields(Columns) if part.name != "sensor"}
