"""The map of a recording: which column is what, in which unit, and when it was sampled."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Field, ValidationInfo, model_validator

from testbed import units
from testbed.document import Document
from testbed.errors import MOST_QUOTED, quoted
from testbed.logs.names import QUANTITIES, quantity_of, second
from testbed.logs.options import quantity
from testbed.logs.selection import TextOptions
from testbed.parts import Part

Kind = Literal["rate", "increment", "angle"]
_COUNTS = {"lsb", "count", "counts", "digit", "digits"}


def _beside_map(path: Path, info: ValidationInfo) -> Path:
    """Take a relative path from the map's folder."""
    folder = (info.context or {}).get("folder")
    return Path(folder) / path if folder else path


def _plain_frequency(value: Any) -> Any:
    """Read a frequency in hertz or with its unit, as the option does."""
    return quantity(value, "Hz", "100 Hz", "rate") if isinstance(value, str) else value


def _by_number(value: Any) -> Any:
    """Take a column's number as its text."""
    return str(value) if type(value) is int else value


# What a unit, a range or an encoding takes at the most; messages repeat it.
Words = Annotated[str, Field(max_length=MOST_QUOTED)]
ColumnText = Annotated[str, BeforeValidator(_by_number)]
Location = Annotated[Path, AfterValidator(_beside_map)]


class TimeMap(Part):
    """When the samples of a channel were taken.

    Parameters
    ----------
    column : str, optional
        Column of the stamps.
    unit : str, optional
        Their unit, such as ``us`` or ``0.1 ms``; dates need none.
    epoch : str, optional
        What zero is, in ISO 8601, where the stamps do not count from 1970.
    rate : float, optional
        Sample rate [Hz] of even samples, instead of stamps.
    offset : float
        Added to the time [s].
    """

    column: ColumnText | None = None
    unit: Words | None = None
    epoch: Words | None = None
    rate: Annotated[float, Field(gt=0.0, allow_inf_nan=False), BeforeValidator(_plain_frequency)] | None = None
    offset: Annotated[float, units.Quantity("s", "1 ms")] = 0.0

    @model_validator(mode="after")
    def _one_of_both(self) -> TimeMap:
        if (self.column is None) == (self.rate is None):
            msg = f"expected either column or rate, got {'neither' if self.column is None else 'both'}"
            raise ValueError(msg)
        if self.unit is not None:
            time_factor(self.unit)
        _ = self.epoch_ns
        return self

    @property
    def epoch_ns(self) -> int:
        """Zero of the stamps in nanoseconds from 1970 on."""
        if self.epoch is None:
            return 0
        try:
            return int(np.datetime64(self.epoch.removesuffix("Z"), "ns").astype(np.int64))
        except ValueError as error:
            msg = f"expected an epoch in ISO 8601, such as '2024-05-01T12:00:00', got {quoted(self.epoch)}"
            raise ValueError(msg) from error


class ChannelMap(Part):
    """A channel of a recording.

    Parameters
    ----------
    column : str
        Name of the column, or its number from 1 on.
    file : Path, optional
        Where it stands, if not in the map's file.
    topic : str, optional
        Group or topic of the column in files that have them.
    unit : str, optional
        Unit of the numbers; that in the column's name or beside it if left out.
    scale : str, optional
        What a count is, such as ``0.07 deg/s``, instead of the unit.
    kind : str, optional
        ``rate``, ``increment`` (angle since the sample before) or ``angle``.
    sign : int
        -1 turns the axis round.
    axis : str, optional
        For the reader.
    time : TimeMap, optional
        Left out: what the file says.
    range : str, optional
        Largest value of the sensor with its unit, such as ``2000 deg/s``.
    """

    column: ColumnText
    file: Location | None = None
    topic: str | None = None
    unit: Words | None = None
    scale: Words | None = None
    kind: Kind | None = None
    sign: Literal[1, -1] = 1
    axis: Words | None = None
    time: TimeMap | None = None
    range: Words | None = None

    @model_validator(mode="after")
    def _units(self) -> ChannelMap:
        if self.scale is not None and self.unit is not None and self.unit.lower() not in _COUNTS:
            msg = f"expected either unit or scale, got both ({self.unit}, {self.scale})"
            raise ValueError(msg)
        for text in (self.scale, self.range):
            if text is not None:
                measure(text)
        if self.unit is not None and self.scale is None:
            unit_quantity(self.unit)
        return self


class LogMap(Part):
    """The map of a recording.

    Parameters
    ----------
    file : Path or list of Path, optional
        The recording, or its consecutive parts; relative to the map.
    channels : dict
        Channels by their name.
    separator, decimal, encoding, skip, missing, only, drop_faulty : optional
        How a text file is written, where that can be read in two ways, and which of its lines are rows.
    """

    file: Location | list[Location] | None = None
    channels: Annotated[dict[str, ChannelMap], Field(min_length=1)]
    separator: Words | None = None
    decimal: Words | None = None
    encoding: Words | None = None
    skip: Annotated[int, Field(ge=0)] | None = None
    missing: Words | None = None
    only: Words | None = None
    drop_faulty: bool = False

    @property
    def text(self) -> TextOptions:
        """How a text file is written."""
        return TextOptions(**{part.name: getattr(self, part.name) for part in fields(TextOptions)})


def load_map(path: Path) -> LogMap:
    """Return the map that a YAML file holds.

    Parameters
    ----------
    path : Path
        The map.

    Returns
    -------
    LogMap
        With the paths in it taken from its own folder.

    Raises
    ------
    ScenarioError
        If it cannot be read, or something in it is wrong, with the line.
    """
    document = Document(path, "map (file: ..., channels: ...)")
    found = document.validate(LogMap, document.data, (), path.parent)
    document.refuse()
    assert found is not None
    return found


def time_factor(unit: str) -> float:
    """Return what one `unit` of time is in seconds; it may carry a number, as ``0.1 ms``."""
    text = second(unit.strip())
    return units.parse(text if text[:1].isdigit() else f"1 {text}", "s", example="us")


def unit_quantity(unit: str) -> str:
    """Return the quantity that a unit measures.

    Raises
    ------
    ValueError
        If it is no unit that a channel may have.
    """
    found = quantity_of(unit)
    if not found:
        msg = f"{quoted(unit)} is no unit of a channel; expected one such as 'deg/s', 'arcsec' or 'degC'"
        raise ValueError(msg)
    return found


def measure(text: str) -> tuple[float, str]:
    """Return a value with its unit in SI, and its quantity.

    Raises
    ------
    ValueError
        If it is none.
    """
    number, _, unit = text.strip().partition(" ")
    try:
        value = float(number)
    except ValueError as error:
        msg = f"expected a number and a unit, such as '0.07 deg/s', got {quoted(text)}"
        raise ValueError(msg) from error
    if not unit.strip():
        msg = f"expected a number and a unit, such as '0.07 deg/s', got {quoted(text)}: the unit is missing"
        raise ValueError(msg)
    kind = unit_quantity(unit.strip())
    return value * units.parse(f"1 {unit}", QUANTITIES[kind]), kind
