"""Columns of numbers in a text file, and the options that say what they mean."""

from __future__ import annotations

import csv
import math
import re
import warnings
from typing import TYPE_CHECKING, NoReturn

import numpy as np

from testbed import units
from testbed.errors import Problem, ScenarioError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from testbed.signals import FloatArray

# Of a step: time stamps are often rounded, and a missing sample is off by a whole one.
_JITTER = 0.25


def quantity(text: str, si: str, example: str, key: str) -> float:
    """Return the positive quantity that `text` gives, with its unit or as a number in SI.

    Parameters
    ----------
    text : str
        Such as ``100`` or ``2 kHz``.
    si, example, key : str
        SI unit of the result, a good text, and the option that gave it, for the message.

    Raises
    ------
    ScenarioError
        If it is none above zero.
    """
    try:
        value = float(text) if _is_number(text) else units.parse(text, si, example=example)
    except ValueError as error:
        raise ScenarioError([Problem(str(error), key=key)]) from error
    if not (value > 0.0 and math.isfinite(value)):
        raise ScenarioError([Problem(f"expected more than 0 {si}, got {text}", key=key)])
    return value


def unit_factor(unit: str, si: str, example: str, key: str) -> float:
    """Return what one `unit` is in the unit `si` [-].

    Parameters
    ----------
    unit, si : str
        Such as ``deg/s`` and ``rad/s``.
    example, key : str
        A good unit, and the option that gave it, for the message.

    Raises
    ------
    ScenarioError
        If it is no unit of that kind.
    """
    try:
        return units.parse(f"1 {unit}", si, example=f"1 {example}")
    except ValueError as error:
        raise ScenarioError([Problem(str(error), key=key)]) from error


def refusal(path: Path, message: str, key: str = "", line: int | None = None) -> ScenarioError:
    """Return the error that says what is wrong with `path`, at which option and line."""
    return ScenarioError([Problem(message, key=key, file=str(path), line=line)])


class ColumnFile:
    """Columns of numbers in a text file.

    Parameters
    ----------
    path : Path
        Commas, semicolons, tabs or spaces between them; ``#`` starts a comment; with a header or not.

    Raises
    ------
    ScenarioError
        If it is empty or cannot be read; as do the methods, with the line, if something in it is not as it should be.
    """

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
        if not (re.fullmatch("[0-9]{1,9}", column) and 1 <= int(column) <= self._n_columns):
            known = (
                f"the header has {', '.join(map(repr, self._names))}"
                if self._names
                else f"there are {self._n_columns} and no header: give a number from 1 on"
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
        """Return the name of a column for the reader."""
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
            self._refuse(f"expected times that increase, got a usual step of {usual:g} s; sort the rows", key="--time")
        uneven = np.flatnonzero(np.abs(steps - usual) > _JITTER * usual)
        if uneven.size:
            i = int(uneven[0])
            message = (
                f"uneven or missing sample: time goes from {t[i]:g} s to {t[i + 1]:g} s where the usual step "
                f"is {usual:g} s; fill the gap or cut the record"
            )
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
                    remedy = "write a decimal point" if "," in value else "fill it or cut the record"
                    self._refuse(f"expected a finite number in {self.label(index)}, got {value!r}; {remedy}", line)

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
        raise refusal(self._path, message, key, line)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
