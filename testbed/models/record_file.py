"""Two columns of a CSV text."""

# mypy: disable-error-code="untyped-decorator"

from __future__ import annotations

import csv
import functools
import io
import math
from typing import TYPE_CHECKING, NoReturn

import numpy as np

from testbed.errors import quoted

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from testbed.signals import FloatArray


class CellError(ValueError):
    """A cell is no finite number, or the header has not the columns; nothing else of the file is repeated."""

    def __init__(self, message: str, line: int) -> None:
        super().__init__(message)
        self.line = line


# The record is asked for by the check and by every start of the motion.
@functools.lru_cache(2)
def read_columns(
    text: str, columns: tuple[str, str], factors: tuple[float, float]
) -> tuple[NDArray[np.int64], FloatArray]:
    """Read two columns of a CSV text with a header line.

    Parameters
    ----------
    text : str
        The whole text.
    columns : tuple of 2 str
        Their names in the header.
    factors : tuple of 2 float
        What their numbers are multiplied by.

    Returns
    -------
    lines : ndarray, shape (n_row,)
        Line of each row in the text.
    values : ndarray, shape (n_row, 2)
        Both columns, times the factors [unit of the factors].

    Raises
    ------
    CellError
        If a column is missing or a cell is no finite number.
    """
    reader = csv.reader(io.StringIO(text, newline=""))
    lines: list[int] = []
    cells: list[str] = []
    try:
        names = next(reader, [])
        places = [_place(column, names) for column in columns]
        for row in reader:
            if row:
                cells += [row[i] if i < len(row) else "" for i in places]
                lines.append(reader.line_num)
    except csv.Error as error:
        msg = f"not CSV: {error}"
        raise CellError(msg, reader.line_num) from error
    try:
        values = np.array(cells, dtype=float).reshape(-1, 2) * factors
    except ValueError:
        values = np.full((len(lines), 2), np.nan)
    finite = np.isfinite(values).all(axis=1)
    if not finite.all():
        _refuse_cell(cells, lines)
    return np.array(lines), values


def _place(column: str, names: list[str]) -> int:
    if column not in names:
        msg = f"no column {quoted(column)} among the {len(names)} of the header"
        raise CellError(msg, 1)
    return names.index(column)


def _refuse_cell(cells: list[str], lines: list[int]) -> NoReturn:
    """Name the first cell that is no finite number."""
    for i, cell in enumerate(cells):
        try:
            good = math.isfinite(float(cell))
        except ValueError:
            good = False
        if not good:
            msg = f"expected a finite number in both columns, got {quoted(cell)}"
            raise CellError(msg, lines[i // 2])
    msg = "expected numbers that stay finite in their unit"
    raise CellError(msg, lines[0])
