"""The run folder: written beside its place, then renamed, so that it appears whole or not at all."""

from __future__ import annotations

import contextlib
import errno
import io
import json
import shutil
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import h5netcdf
import h5py
import numpy as np
from ruamel.yaml import YAML

from testbed.errors import Problem, RunError, ScenarioError
from testbed.fusion.base import diagnostic_unit
from testbed.results import Run, Signals, assemble, columns

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from typing import Self

    from testbed.pipeline import RunBlock
    from testbed.signals import FloatArray

ESSENTIAL = ("scenario.yaml", "run.nc", "metrics.json")
_CHUNK = 20_000
_UNITS = {"rate": "rad/s", "std": "rad/s", "angle": "rad", "time": "s"}


class RunFolder:
    """A run folder in the making; leaving the context without `finish` removes all traces.

    Parameters
    ----------
    target : Path
        Where the folder will appear. An earlier run folder there is replaced whole.

    Raises
    ------
    ScenarioError
        If something else is there, or the place cannot be written.
    """

    def __init__(self, target: Path) -> None:
        self.target = target.absolute()
        self._finished = False
        if self.target.exists() and not is_replaceable(self.target):
            msg = "exists and is no run folder of the testbed: choose another --out, or remove it yourself"
            raise ScenarioError([Problem(msg, file=str(target))])
        try:
            self.target.parent.mkdir(parents=True, exist_ok=True)
            self.path = Path(
                tempfile.mkdtemp(prefix=f".{self.target.name}.", suffix=".partial", dir=self.target.parent)
            )
            self.path.chmod(0o755)
        except OSError as error:
            raise ScenarioError(
                [Problem(f"cannot be written: {error.strerror or error}; choose another --out", file=str(target))]
            ) from error

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if not self._finished:
            shutil.rmtree(self.path, ignore_errors=True)

    def finish(self) -> Path:
        """Put the folder in its place."""
        if self.target.exists():
            old = Path(tempfile.mkdtemp(prefix=f".{self.target.name}.", suffix=".old", dir=self.target.parent))
            self.target.rename(old / "run")
            self.path.rename(self.target)
            shutil.rmtree(old, ignore_errors=True)
        else:
            self.path.rename(self.target)
        self._finished = True
        return self.target


def is_replaceable(path: Path) -> bool:
    """Return whether `path` is an earlier run folder or an empty folder."""
    return path.is_dir() and (all((path / name).is_file() for name in ESSENTIAL) or not any(path.iterdir()))


class _ShieldedFile(io.FileIO):
    """A file whose failures HDF5 never sees: it crashes the process when a write fails while it closes. `error` is the first one."""

    error: OSError | None = None

    def write(self, data: Any) -> int:
        view = memoryview(data).cast("B")
        done = 0
        try:
            while self.error is None and done < view.nbytes:
                done += super().write(view[done:])
        except OSError as error:
            self.error = error
        return int(view.nbytes)

    def truncate(self, size: int | None = None) -> int:
        try:
            return super().truncate(size)
        except OSError as error:
            self.error = self.error or error
            return size or 0

    def check(self) -> None:
        """Raise the first failure."""
        if self.error is not None:
            raise self.error


class NetcdfStore:
    """Writes every signal of a run to run.nc (NetCDF-4, compressed), block by block.

    Rates and angles are float64, diagnostics float32; every group has the coordinate `time` in seconds.

    Parameters
    ----------
    path : Path
        The file.
    rates : mapping
        Sample rate [Hz] of ``base`` and of every sensor and filter by its name.
    duration : float
        Length of the run [s].
    attributes : mapping
        Provenance, written as global attributes.

    Raises
    ------
    OSError
        From `write` and `close`, if the disk is full or the file cannot be written.
    """

    def __init__(self, path: Path, rates: Mapping[str, float], duration: float, attributes: Mapping[str, Any]) -> None:
        self._rates = rates
        self._n_base = round(duration * rates["base"])
        self._raw = _ShieldedFile(path, "w+")
        self._file = h5netcdf.File(self._raw, "w")
        self._variables: dict[tuple[str, str], Any] = {}
        for name, value in attributes.items():
            self._file.attrs[name] = value

    def write(self, block: RunBlock) -> None:
        """Append a block."""
        for group, name, start, rate, values in columns(block, self._rates):
            if (group, name) not in self._variables:
                self._create(group, name, rate)
            if values.size:
                self._variables[group, name][start : start + values.size] = values
        self._raw.check()

    def close(self) -> None:
        """Finish the file; OSError if anything could not be written."""
        if not self._raw.closed:
            self._file.close()
            self._raw.close()
            self._raw.check()

    def _create(self, group: str, name: str, rate: float) -> None:
        n = -(-self._n_base // round(self._rates["base"] / rate))
        node = self._group(group)
        if "time" not in node.variables:
            node.dimensions["time"] = n
            time = self._variable(node, "time", n, np.float64)
            for start in range(0, n, _CHUNK):
                stop = min(start + _CHUNK, n)
                time[start:stop] = np.arange(start, stop) / rate
            node.attrs["sample_rate_hz"] = rate
        precise = name in _UNITS or is_sensor_truth(name)
        self._variables[group, name] = self._variable(node, name, n, np.float64 if precise else np.float32)

    def _group(self, path: str) -> Any:
        node = self._file
        for name in path.split("/"):
            node = node.groups[name] if name in node.groups else node.create_group(name)
        return node

    def _variable(self, node: Any, name: str, n: int, kind: type) -> Any:
        variable = node.create_variable(
            name,
            ("time",),
            kind,
            chunks=(min(_CHUNK, n),),
            compression="gzip",
            compression_opts=1,
            shuffle=True,
            fillvalue=np.nan,
        )
        variable.attrs["units"] = unit_of(name)
        return variable


def unit_of(name: str) -> str:
    """Return the SI unit of a signal by its name."""
    if name in _UNITS:
        return _UNITS[name]
    return _UNITS["rate"] if is_sensor_truth(name) else diagnostic_unit(name)


def is_sensor_truth(name: str) -> bool:
    """Return whether a signal is what a sensor's axis feels, named ``<sensor>_rate``."""
    return name.endswith("_rate") and name != "Q_rate"


def write_text(path: Path, text: str) -> None:
    """Write a text file whole or not at all."""
    write_bytes(path, text.encode())


def write_bytes(path: Path, content: bytes) -> None:
    """Write a file whole or not at all."""
    beside = path.with_name(f".{path.name}.partial")
    try:
        beside.write_bytes(content)
        beside.replace(path)
    finally:
        beside.unlink(missing_ok=True)


def write_metrics(folder: Path, metrics: dict[str, Any]) -> None:
    """Write metrics.json; NaN is refused (null where undefined)."""
    write_text(folder / "metrics.json", json.dumps(metrics, indent=2, allow_nan=False) + "\n")


def write_scenario(folder: Path, resolved: dict[str, Any], versions: Mapping[str, str]) -> None:
    """Write the resolved scenario in SI, with the versions in its head."""
    head = "# resolved scenario in SI; made with " + ", ".join(
        f"{name} {version}" for name, version in versions.items()
    )
    yaml = YAML(typ="safe", pure=True)
    yaml.default_flow_style = False
    yaml.sort_base_mapping_type_on_output = False
    yaml.width = 4096
    with (folder / "scenario.yaml").open("w", encoding="utf-8") as stream:
        stream.write(head + "\n")
        yaml.dump(resolved, stream)


@contextlib.contextmanager
def failing_as_run_error(what: str) -> Iterator[None]:
    """Turn failures of the file system (disk full, quota, read-only) inside the context into RunError."""
    try:
        yield
    except OSError as error:
        reason = "the disk is full" if error.errno in {errno.ENOSPC, errno.EDQUOT} else str(error)
        msg = f"{what} could not be written: {reason}"
        raise RunError(msg) from error


def open_run(folder: str | Path) -> Run:
    """Open a run folder; its signals are read when they are asked for.

    Parameters
    ----------
    folder : str or Path
        A run folder.

    Raises
    ------
    ScenarioError
        If it is no run folder.
    """
    path = Path(folder)
    missing = [name for name in ESSENTIAL if not (path / name).is_file()]
    if missing:
        msg = f"expected a run folder, but {', '.join(missing)} is missing"
        raise ScenarioError([Problem(msg, file=str(folder))])
    metrics = json.loads((path / "metrics.json").read_text(encoding="utf-8"))
    return assemble(dict(_groups(path / "run.nc")), metrics, path)


def _groups(path: Path) -> Iterator[tuple[str, Signals]]:
    found: list[tuple[str, tuple[str, ...]]] = []

    def visit(name: str, node: Any) -> None:
        if isinstance(node, h5py.Group):
            names = tuple(key for key, item in node.items() if isinstance(item, h5py.Dataset))
            if names:
                found.append((name, names))

    try:
        with h5py.File(path) as file:
            file.visititems(visit)
    except OSError as error:
        raise ScenarioError([Problem(f"is no readable run: {error}", file=str(path))]) from error
    for group, names in found:
        yield group, Signals(names, _reader(path, group))


def _reader(path: Path, group: str) -> Any:
    def read(name: str) -> FloatArray:
        with h5py.File(path) as file:
            values: FloatArray = file[f"{group}/{name}"][:]
        return values

    return read
