"""What a user says of a recording: the options of every command that reads one. Imports here are light."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path  # noqa: TC003 - the command line reads the types of the fields
from typing import Any, ClassVar


def _words(name: str, text: str, metavar: str | None = None) -> dict[str, Any]:
    return {"option": name, "help": text, "metavar": metavar}


@dataclass(frozen=True)
class TextOptions:
    """What is known of a text file beforehand; None: found in the file.

    Parameters
    ----------
    separator : str, optional
        ``,``, ``;``, ``|``, ``tab`` or ``blank``.
    decimal : str, optional
        ``.`` or ``,``.
    encoding : str, optional
        Such as ``utf-8``, ``utf-16``, ``cp1252``.
    skip : int, optional
        Lines to leave out before the header, or before the first row where there is none.
    missing : str, optional
        Word that stands for a missing value, beside an empty field, ``nan`` and the like.
    only : str, optional
        Word that a line must hold to be read, such as ``$GYR`` or ``IMU``.
    drop_faulty : bool
        Leave out lines that are not like the others, and say how many.
    """

    PANEL: ClassVar[str] = "Text file"

    separator: str | None = field(
        default=None,
        metadata=_words("--separator", "Between the fields of a text: one of , ; | or the words tab and blank."),
    )
    decimal: str | None = field(
        default=None, metadata=_words("--decimal", "Decimal mark of a text, a point or a comma.")
    )
    encoding: str | None = field(default=None, metadata=_words("--encoding", "Encoding of a text, such as cp1252."))
    skip: int | None = field(
        default=None, metadata=_words("--skip", "Lines of a text to leave out at its head.", "LINES")
    )
    missing: str | None = field(
        default=None, metadata=_words("--missing", "Word of a text that stands for a missing value.", "WORD")
    )
    only: str | None = field(
        default=None, metadata=_words("--only", "Read the lines of a text that hold this word, such as $GYR.", "WORD")
    )
    drop_faulty: bool = field(
        default=False,
        metadata=_words("--drop-faulty", "Leave out lines of a text that are not like the others; they are counted."),
    )


@dataclass(frozen=True)
class Selection:
    """What the options of a command say of a recording.

    Parameters
    ----------
    column : list of str, optional
        By name or number; left out: all that are rates by their unit, or the only one.
    unit, scale, kind : str, optional
        As in a map.
    rate, time, time_unit : str, optional
        Sample rate, in hertz or with its unit; column of the time, and its unit.
    average : int, optional
        Samples of which the mean is kept; left out: 1, of over 8 million samples as many as memory asks for.
    map : Path, optional
        The map, instead of all these but `column`, which then are its channels, and `average`.
    """

    PANEL: ClassVar[str] = "Channel"

    column: list[str] | None = field(
        default=None,
        metadata=_words(
            "--column", "Column by name, or by number from 1 on; may be given several times. Default: all rates."
        ),
    )
    unit: str | None = field(
        default=None, metadata=_words("--unit", "Unit of the column, such as deg/s; default that in the file.")
    )
    scale: str | None = field(
        default=None, metadata=_words("--scale", "What a count is, instead of the unit, such as '0.07 deg/s'.")
    )
    kind: str | None = field(
        default=None,
        metadata=_words("--kind", "What the column is: rate, increment (angle since the sample before) or angle."),
    )
    rate: str | None = field(
        default=None, metadata=_words("--rate", "Sample rate of even samples, instead of --time.", "FREQUENCY")
    )
    time: str | None = field(
        default=None, metadata=_words("--time", "Column of the time; default the one whose name says so.")
    )
    time_unit: str | None = field(
        default=None, metadata=_words("--time-unit", "Unit of the time; default that in the file, or s.")
    )
    average: int | None = field(
        default=None,
        metadata=_words(
            "--average",
            "Keep the means of this many samples; default 1, of over 8 million samples as many as memory asks for.",
        ),
    )
    map: Path | None = field(
        default=None, metadata=_words("--map", "Map of the recording, instead of these.", "LOG.yaml")
    )

    @property
    def given(self) -> list[str]:
        """The options of a single column that were given."""
        names = ("unit", "scale", "kind", "rate", "time", "time_unit")
        return [f"--{name.replace('_', '-')}" for name in names if getattr(self, name)]

    @property
    def of_files(self) -> list[str]:
        """The options that were given and make no sense of a run folder."""
        return ["--map"] * (self.map is not None) + ["--average"] * (self.average is not None) + self.given
