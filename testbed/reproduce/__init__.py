"""Measurements of the papers repeated on the simulated sensors, the papers' numbers beside ours."""

from __future__ import annotations

import csv
import importlib
import math
from typing import TYPE_CHECKING

from testbed._version import __version__
from testbed.errors import ScenarioError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

PAPERS = {
    "paper1": "testbed.reproduce.paper1",
    "paper2": "testbed.reproduce.paper2",
    "paper3": "testbed.reproduce.paper3",
}
# The tables of each paper, as CSV files in its folder; figures have files of their own.
TABLES = {
    "paper1": ("table_ii", "table_ii_defects"),
    "paper2": ("scale_factor", "linearity", "linearity_bent", "rivals"),
    "paper3": ("table_2", "table_2_seeds"),
}
# Seeds if none are asked for: the spread of Table II is over ten, what the others measure hardly scatters.
SEEDS = {"paper1": 10, "paper2": 1, "paper3": 1}


def run_paper(name: str, seeds: int | None, out: Path) -> Iterator[str]:
    """Repeat the measurements of a paper, write its tables and figures and yield the lines to print.

    Parameters
    ----------
    name : str
        One of `PAPERS`.
    seeds : int or None
        Seeds 1 to this, of which each result is the median [-]; None takes those of `SEEDS`.
    out : Path
        Folder to write; an earlier one of the testbed's is replaced whole.

    Yields
    ------
    str
        One line of the report.

    Raises
    ------
    ScenarioError
        If there is no such paper, or the folder cannot be written or holds something else.
    RunError
        If the disk is full.
    """
    if name not in PAPERS:
        known = f"there is: {', '.join(PAPERS)}"
        problem = f"{name}: unknown paper, {known}"
        raise ScenarioError(problem)
    from testbed.runs.folder import RunFolder, failing_as_run_error

    seeds = seeds or SEEDS[name]
    with RunFolder(out) as folder, failing_as_run_error(str(out)):
        yield from importlib.import_module(PAPERS[name]).report(seeds, folder.path)
        folder.finish({"paper": name, "seeds": seeds, "version": __version__})


def paper_tables(name: str, folder: Path) -> dict[str, list[dict[str, float | str | None]]]:
    """Return the tables of a paper that `run_paper` wrote.

    Parameters
    ----------
    name : str
        One of `PAPERS`.
    folder : Path
        Where they are.

    Returns
    -------
    dict of str to list of dict
        Rows of each table by its name, columns as in its file; None where there is no number.
    """
    tables = {}
    for table in TABLES[name]:
        with (folder / f"{table}.csv").open(newline="", encoding="utf-8") as file:
            tables[table] = [{key: _value(text) for key, text in row.items()} for row in csv.DictReader(file)]
    return tables


def _value(text: str) -> float | str | None:
    try:
        value = float(text)
    except ValueError:
        return text or None
    return value if math.isfinite(value) else None
