"""``sweep.html``: curves with intervals, maps and the order of the filters; it grows while the sweep runs."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from testbed.campaigns.curves import summarise
from testbed.campaigns.figures import figures_of
from testbed.campaigns.rows import unit_at
from testbed.campaigns.store import read_cases
from testbed.pages.template import render
from testbed.runs.atomic import write_text
from testbed.runs.table import metric_text

if TYPE_CHECKING:
    from pathlib import Path

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
        found = summarise(table, study.axes)
        aimed = [name for points in found.points.values() for point in points for name in point.sight]
        seeds = sum(point.n_seed for point in next(iter(found.points.values()), ()))
        text = render(
            "sweep.html.j2",
            figures_of(found, {key: unit_at(study.cases[0].scenario, key) for key in study.axes}),
            study=study,
            found=found,
            sights=list(dict.fromkeys(aimed)),
            metric_text=metric_text,
            n_done=seeds,
            n_runs=len(study.cases) * len(study.seeds),
            repeat=f"{study.command} --only",
        )
        write_text(self._folder / PAGE, text)
