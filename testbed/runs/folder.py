"""The run folder: written beside its place, then exchanged, so that it appears whole or not at all."""

from __future__ import annotations

import contextlib
import errno
import itertools
import json
import os
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NoReturn

from ruamel.yaml import YAML

from testbed.errors import Problem, RunError, ScenarioError
from testbed.runs.atomic import put, sync_tree, write_text
from testbed.runs.leftovers import alone_in, beside, heal
from testbed.runs.manifest import MANIFEST, read_manifest, strangers, write_manifest

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping
    from typing import Self


SIGNALS = "run.nc"
ESSENTIAL = ("scenario.yaml", SIGNALS, "metrics.json")


class RunFolder:
    """A folder of the testbed in the making (a run, an audit, a paper): it replaces an earlier one in one step, or
    leaves no trace.

    Parameters
    ----------
    target : Path
        Where the folder will appear, a link's target if it is one. An earlier run folder there is replaced, but for
        one that holds anything that its manifest does not list.

    Raises
    ------
    ScenarioError
        From the context's start: if something else is there, or the place cannot be written.
    """

    def __init__(self, target: Path) -> None:
        self.target = target.absolute()
        self._stack = contextlib.ExitStack()

    def __enter__(self) -> Self:
        try:
            self._place = Path(os.path.realpath(self.target))
            heal(self._place)
            with alone_in(self._place.parent):
                found = in_the_way(self._place)
            if found:
                raise _taken(found, self.target)
            self._place.parent.mkdir(parents=True, exist_ok=True)
            self.path = self._stack.enter_context(beside(self._place, folder=True)) / "run"
            self.path.mkdir()
        except OSError as error:
            self._stack.close()
            msg = f"cannot be written: {error.strerror or error}; choose another --out"
            raise ScenarioError([Problem(msg, file=str(self.target))]) from error
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def finish(self, about: Mapping[str, Any] = MappingProxyType({})) -> Path:
        """Write the manifest and put the folder in its place.

        Parameters
        ----------
        about : mapping, optional
            What the manifest says beside the list of files.

        Raises
        ------
        RunError
            If something else has come to lie there meanwhile; the run is kept beside it.
        """
        write_manifest(self.path, about)
        sync_tree(self.path)
        # Alone, or the folder that another run puts there meanwhile is half the one and half the other.
        with alone_in(self._place.parent):
            found = in_the_way(self._place)
            if found:
                self._keep(found)
            put(self.path, self._place)
        return self.target

    def _keep(self, found: str) -> NoReturn:
        others = (self._place.with_name(f"{self._place.name}.{i}") for i in itertools.count(2))
        free = next(other for other in others if not other.exists())
        put(self.path, free)
        msg = f"{self.target}: {found}, since the run began; the finished run is in {free}"
        raise RunError(msg)


def check_free(target: Path) -> None:
    """Raise ScenarioError if a run folder cannot be put at `target`, for who has long to work before it makes one."""
    found = in_the_way(Path(os.path.realpath(target)))
    if found:
        raise _taken(found, target)


def _taken(found: str, target: Path) -> ScenarioError:
    return ScenarioError([Problem(f"{found}: choose another --out, or move it away", file=str(target))])


def in_the_way(place: Path) -> str:
    """Return what forbids to put a run folder at `place`, nothing if it may be."""
    if not os.path.lexists(place):
        return ""
    if not place.is_dir():
        return "exists and is no folder of the testbed"
    if place.is_mount():
        return "is a mounted file system, which cannot be replaced (a folder inside it can)"
    found = strangers(place)
    if found and read_manifest(place) is None:
        return f"exists and is no folder of the testbed (it has no {MANIFEST})"
    shown = ", ".join(found[:3]) + (f" and {len(found) - 3} more" if len(found) > 3 else "")
    return f"holds what its {MANIFEST} does not list, or not as it is now: {shown}" if found else ""


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
