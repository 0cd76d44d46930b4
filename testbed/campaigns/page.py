"""``sweep.html``: curves with intervals, maps and the order of the filters; it grows while the sweep runs."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import TYPE_CHECKING

from testbed.campaigns.axes import as_written
from testbed.campaigns.curves import summarise
from testbed.campaigns.figures import figures_of
from testbed.campaigns.rows import unit_at
from testbed.campaigns.store import read_cases
from testbed.pages.template import render
from testbed.runs.atomic import write_text
from testbed.runs.table import metric_text

if TYPE_CHECKING:
    from pathlib import Path

    from testbed.campaigns.curves import Summary
    from testbed.campaigns.study import Study

PAGE = "sweep.html"
# Seconds between two pages while it runs, at the least; and how many times longer than the page itself took.
_PAUSE, _SHARE = 10.0, 50.0


class Page:
    """The page of a sweep.

    Parameters
    ----------
    folder : Path
        Of the sweep.
    study : Study
        What it plays.
    """

    def __init__(self, folder: Path, study: Study) -> None:
        self._folder, self._study = folder, study
        self._next = time.monotonic() + _PAUSE

    def grow(self) -> None:
        """Write it again if it has become old."""
        if time.monotonic() > self._next:
            begun = time.monotonic()
            self.write()
            self._next = time.monotonic() + max(_PAUSE, _SHARE * (time.monotonic() - begun))

    def write(self) -> None:
        """Write it from the rows that are on the disk."""
        study = self._study
        table = read_cases(self._folder)
        found, units = in_units_of(study, summarise(table, study.axes))
        aimed = [name for points in found.points.values() for point in points for name in point.sight]
        seeds = sum(point.n_seed for point in next(iter(found.points.values()), ()))
        text = render(
            "sweep.html.j2",
            figures_of(found, units),
            study=study,
            units=units,
            found=found,
            sights=list(dict.fromkeys(aimed)),
            metric_text=metric_text,
            n_done=seeds,
            n_runs=len(study.cases) * len(study.seeds),
            repeat=f"{study.command} --only",
        )
        write_text(self._folder / PAGE, text)


def in_units_of(study: Study, found: Summary) -> tuple[Summary, dict[str, str]]:
    """Return what the rows say with the axes in the units in which the study has them, and these units.

    Axes whose values have no unit in common, or are no numbers, stay in SI.

    Parameters
    ----------
    study : Study
        What is played.
    found : Summary
        Axes in SI.
    """
    units, columns = {}, {}
    for key in study.axes:
        written = as_written([case.values[key] for case in study.cases])
        units[key] = (written[1] or "-") if written else unit_at(study.cases[0].scenario, key)
        if written:
            columns[key] = written[0]
    points = {
        source: [
            replace(one, axes={**one.axes, **{key: column[one.case] for key, column in columns.items()}}) for one in of
        ]
        for source, of in found.points.items()
    }
    return replace(found, points=points), units
