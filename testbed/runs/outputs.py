"""What a run writes into its folder, chosen by name."""

from __future__ import annotations

from typing import TYPE_CHECKING

from testbed.errors import Problem, ScenarioError, UnknownNameError
from testbed.runs.manifest import read_manifest

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

# By name; metrics.json and scenario.yaml are always there.
OUTPUTS = ("metrics", "netcdf", "recording", "report")


def chosen(outputs: Iterable[str] | None) -> tuple[str, ...]:
    """Return the outputs that were asked for in the order of `OUTPUTS`, metrics always among them; all for None.

    Parameters
    ----------
    outputs : iterable of str, optional
        Names.

    Raises
    ------
    ScenarioError
        If there is no such output, or the report, which is drawn from run.nc, is asked for without it.
    """
    wanted = OUTPUTS if outputs is None else ("metrics", *outputs)
    problems = [str(UnknownNameError("output", name, OUTPUTS)) for name in wanted if name not in OUTPUTS]
    if "report" in wanted and "netcdf" not in wanted:
        problems.append("the report is drawn from run.nc: add netcdf, or leave it out")
    if problems:
        raise ScenarioError([Problem(problem, "outputs") for problem in problems])
    return tuple(name for name in OUTPUTS if name in wanted)


def require_place(outputs: Iterable[str] | None, out: str | Path | None) -> None:
    """Raise ValueError if outputs are asked for without the folder that they go to.

    Parameters
    ----------
    outputs : iterable of str, optional
        Names.
    out : str or Path, optional
        The folder.
    """
    if out is None and outputs is not None:
        msg = "outputs: expected only beside out, the folder that they go to"
        raise ValueError(msg)


def writes(folder: Path, output: str) -> bool:
    """Return whether the run in a folder was to write an output, by its manifest; every one if that does not say.

    Parameters
    ----------
    folder : Path
        Run folder.
    output : str
        Of `OUTPUTS`.
    """
    manifest = read_manifest(folder) or {}
    return output in manifest.get("outputs", OUTPUTS)
