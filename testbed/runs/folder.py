"""The run folder: written beside its place, then renamed, so that it appears whole or not at all."""

from __future__ import annotations

import contextlib
import errno
import json
import shutil
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ruamel.yaml import YAML

from testbed.errors import Problem, RunError, ScenarioError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping
    from typing import Self


ESSENTIAL = ("scenario.yaml", "run.nc", "metrics.json")


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
def failing_as_run_error(what: str) -> Iterator[Callable[[float], None]]:
    """Turn failures of the file system (disk full, quota, read-only) inside the context into RunError.

    Yields a function that notes how far the run got [s], for the message.
    """
    reached: float | None = None

    def note(seconds: float) -> None:
        nonlocal reached
        reached = seconds

    try:
        yield note
    except OSError as error:
        reason = "the disk is full" if error.errno in {errno.ENOSPC, errno.EDQUOT} else str(error)
        far = "" if reached is None else f"; the run got as far as t = {reached:g} s"
        msg = f"{what} could not be written: {reason}{far}"
        raise RunError(msg) from error
