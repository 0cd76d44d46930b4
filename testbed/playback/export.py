"""A run as a recording: readings and truth in a format of other tools, with the map that reads them back."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ruamel.yaml import YAML

from testbed.errors import Problem, ScenarioError, UnknownNameError
from testbed.playback.track import Track
from testbed.runs.folder import RunFolder, failing_as_run_error
from testbed.runs.results import RunRecord

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

MAP = "log.yaml"
REFERENCE = "reference"
# Module below `writers`, and the library that has to be there beside those of every installation.
FORMATS = {
    "csv": ("text", None),
    "hdf5": ("hdf5", None),
    "mcap": ("mcap", "mcap"),
    "mdf": ("mdf", "asammdf"),
    "parquet": ("parquet", None),
    "tdms": ("tdms", "nptdms"),
}


def export(run_dir: str | Path, format: str, out: str | Path | None = None) -> Path:
    """Write the readings of a run, and its truth as the reference, as a recording with its map.

    Parameters
    ----------
    run_dir : str or Path
        Run folder, with its signals.
    format : str
        One of `FORMATS`.
    out : str or Path, optional
        Folder to write, ``runs/<name of the run folder>_<format>`` if not given; an earlier one is replaced.

    Returns
    -------
    Path
        The folder: data, ``log.yaml`` for `testbed.replay` and `testbed.read_log`, ``manifest.json``.

    Raises
    ------
    ScenarioError
        If it is no run, the format is not known or its library missing, or `out` holds something else.
    RunError
        If the disk is full.

    Examples
    --------
    >>> export("nowhere", "csv")
    Traceback (most recent call last):
    testbed.errors.ScenarioError: nowhere: expected a run folder, but nowhere/scenario.yaml, ... is missing
    """
    write = _writer(format)
    run = RunRecord.open(run_dir)
    if REFERENCE in run.sensors:
        message = f"a sensor is called {REFERENCE!r}, as the truth of a recording is: give it another name"
        raise ScenarioError([Problem(message, f"sensors.{REFERENCE}", str(run_dir))])
    # In the order of the scenario, which the sums inside a filter follow; run.nc sorts its groups.
    tracks = [Track(name, run.sensors[name]) for name in run.metrics.sensors]
    if "rate" in run.truth:
        tracks.append(Track(REFERENCE, run.truth))
    if not tracks:
        raise ScenarioError([Problem("has no readings to write", file=str(run_dir))])
    target = Path("runs") / f"{Path(run_dir).resolve().name}_{format}" if out is None else Path(out)
    with RunFolder(target) as folder, failing_as_run_error(str(target)):
        places = write(folder.path, tracks)
        _write_map(folder.path / MAP, run, tracks, places)
        folder.finish({"run": str(run_dir), "format": format})
    return target


def _writer(format: str) -> Callable[..., dict[str, dict[str, str]]]:
    if format not in FORMATS:
        kind = "format"
        raise ScenarioError([Problem(str(UnknownNameError(kind, format, FORMATS)), "--format")])
    module, library = FORMATS[format]
    if library is not None:
        try:
            import_module(library)
        except ImportError as error:
            message = f"{format} needs {library}: pip install 'angular-rate-testbed[logs]'"
            raise ScenarioError([Problem(message, "--format")]) from error
    found: Callable[..., dict[str, dict[str, str]]] = getattr(
        import_module(f"testbed.playback.writers.{module}"), f"write_{format}"
    )
    return found


def _write_map(path: Path, run: RunRecord, tracks: list[Track], places: Mapping[str, dict[str, str]]) -> None:
    """Write the map; the sample rate of an even clock stands in it in all its digits, for stamps are rounded to
    nanoseconds.
    """
    channels: dict[str, Any] = {}
    for track in tracks:
        place = dict(places[track.name])
        stamps = {"column": place.pop("stamps"), "unit": "s" if place["file"].endswith(".mf4") else "ns"}
        time = stamps if track.signals.stamped else {"rate": f"{track.signals.sample_rate_hz!r} Hz"}
        channels[track.name] = {**place, "unit": "rad/s", "time": time}
    yaml = YAML(typ="safe", pure=True)
    yaml.default_flow_style = False
    yaml.sort_base_mapping_type_on_output = False
    head = f"# readings of {run.metrics.scenario}; testbed replay {MAP} --filter kalman\n"
    with path.open("w", encoding="utf-8") as stream:
        stream.write(head)
        yaml.dump({"channels": channels}, stream)
