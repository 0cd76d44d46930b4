"""A run for xarray and pandas, which are an extra: the base install works without them."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from testbed.runs.attributes import attributes, provenance

if TYPE_CHECKING:
    from types import ModuleType

    import pandas as pd
    import xarray as xr

    from testbed.runs.metrics import RunMetrics, SourceMetrics
    from testbed.runs.results import RunRecord
    from testbed.runs.signals import Signals

INSTALL = "pip install 'angular-rate-testbed[notebook]'"


def tree(run: RunRecord) -> xr.DataTree:
    """Return the signals of a run as run.nc holds them; read when asked for if it is on disk.

    Parameters
    ----------
    run : RunRecord
        In memory or on disk.

    Raises
    ------
    ImportError
        If xarray is not installed; says how to install it.
    """
    xarray = _library("xarray")
    if run.folder is not None:
        opened: xr.DataTree = xarray.open_datatree(run.folder / "run.nc", engine="h5netcdf")
        return opened
    top = xarray.Dataset(attrs=provenance(run.metrics.scenario, run.metrics.seed, run.metrics.versions))
    groups = {group: _dataset(xarray, group, signals) for group, signals in run.groups.items()}
    built: xr.DataTree = xarray.DataTree.from_dict({"/": top, **groups})
    return built


def frame(metrics: RunMetrics) -> pd.DataFrame:
    """Return one row per sensor and filter, indexed by its name, and one column per number of metrics.json.

    Parameters
    ----------
    metrics : RunMetrics
        Of the run.

    Raises
    ------
    ImportError
        If pandas is not installed; says how to install it.
    """
    pandas = _library("pandas")
    rows = [_numbers(source) for kind in (metrics.sensors, metrics.fusion) for source in kind.values()]
    index = pandas.Index([*metrics.sensors, *metrics.fusion], name="source")
    built: pd.DataFrame = pandas.DataFrame(rows, index=index, dtype=float)
    return built


def _dataset(xarray: ModuleType, group: str, signals: Signals) -> xr.Dataset:
    variables = {name: ("time", signals[name], attributes(group, name)) for name in signals}
    made: xr.Dataset = xarray.Dataset(variables, attrs={"sample_rate_hz": signals.sample_rate_hz})
    return made.set_coords("time")


def _numbers(source: SourceMetrics) -> dict[str, float | None]:
    return {key: value for key, value in source.items() if value is None or isinstance(value, int | float)}


def _library(name: str) -> Any:
    """Import a library of the extra `notebook`."""
    try:
        return import_module(name)
    except ImportError as error:
        msg = f"{name} is not installed; install it with: {INSTALL}"
        raise ImportError(msg) from error
