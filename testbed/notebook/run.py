"""A run that shows itself: one line, a table, figures, and its signals for xarray and pandas."""

from __future__ import annotations

from typing import TYPE_CHECKING

from testbed.notebook.page import error_page
from testbed.runs.results import RunRecord

if TYPE_CHECKING:
    from pathlib import Path

    import pandas as pd
    import xarray as xr

    from testbed.notebook.figures import Figures


class Run(RunRecord):
    """A finished run: its signals in SI, its metrics, and what it looks like.

    `commanded` and `truth` are on the base clock, each sensor of `sensors` on its own, each filter of `fusion` on that
    of its fastest sensor. `metrics` is what metrics.json holds; `folder` is where the run is stored, None if it is
    in memory only. A run copies and pickles; one on disk stays a reference to its folder.
    """

    def plot(self) -> Figures:
        """Return the figures of the report by name: `rates`, `errors`, `spectrum`, and `thermal`, `budget` where there
        is something to draw. Each is a matplotlib figure; a notebook shows them all.
        """
        # Drawing is heavy, and of no use to a run that is only computed.
        from testbed.notebook.figures import Figures
        from testbed.report import run_figures

        return Figures(run_figures(self))

    def to_xarray(self) -> xr.DataTree:
        """Return the signals as a tree with the groups of run.nc, each variable with its unit and long name.

        Of a run on disk they are read when they are asked for.

        Raises
        ------
        ImportError
            If xarray is not installed; says how to install it.
        """
        from testbed.notebook.tables import tree

        return tree(self)

    def to_pandas(self) -> pd.DataFrame:
        """Return the metrics, one row per sensor and filter, one column per number, named as in metrics.json.

        Raises
        ------
        ImportError
            If pandas is not installed; says how to install it.
        """
        from testbed.notebook.tables import frame

        return frame(self.metrics)

    def _repr_html_(self) -> str:
        return error_page(self.metrics)


def open_run(folder: str | Path) -> Run:
    """Open a run folder; its signals are read when they are asked for. A run without `netcdf` among its outputs has
    metrics only.

    Parameters
    ----------
    folder : str or Path
        A run folder.

    Raises
    ------
    ScenarioError
        If it is no run folder, or a file in it is damaged.

    Examples
    --------
    >>> open_run("nowhere")
    Traceback (most recent call last):
    testbed.errors.ScenarioError: nowhere: expected a run folder, but nowhere/scenario.yaml, ... is missing
    """
    return Run.open(folder, signals=False)
