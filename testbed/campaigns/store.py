"""``cases.parquet``: rows on the disk, whole after an interrupt, a kill or a loss of power."""

from __future__ import annotations

import io
import json
import os
import shutil
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from testbed.errors import Problem, ScenarioError
from testbed.runs.atomic import exchange, sync_tree, write_bytes, write_text
from testbed.runs.leftovers import beside

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from types import TracebackType

    import pyarrow as pa

CASES, STUDY = "cases.parquet", "study.json"
# Seconds between two parts at the least.
_PAUSE = 1.0


class CaseStore:
    """The rows of a study in its folder, and which of them are there already.

    Parameters
    ----------
    folder : Path
        Of the sweep; made if it is not there.
    study : mapping
        What the study is (`Study.document`).
    schema : pyarrow.Schema
        Of the rows.

    Raises
    ------
    ScenarioError
        If the folder holds another study, with the difference, something else, or is in use by another process.
    """

    def __init__(self, folder: Path, study: Mapping[str, Any], schema: pa.Schema) -> None:
        self._folder, self._schema = folder, schema
        self._waiting: list[dict[str, Any]] = []
        self._written, self._parts = 0.0, 0
        refuse_others(folder, study)
        folder.mkdir(parents=True, exist_ok=True)
        self._lock = _locked(folder)
        (folder / CASES).mkdir(exist_ok=True)
        if not (folder / STUDY).exists():
            write_text(folder / STUDY, json.dumps(study, indent=1) + "\n")
        known = read_cases(folder, ["case", "seed", "launch"])
        self.done = set(zip(known["case"].to_pylist(), known["seed"].to_pylist(), strict=True))
        self.launch = 1 + max(known["launch"].to_pylist(), default=0)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self.flush()
        finally:
            os.close(self._lock)

    def add(self, rows: Iterable[Mapping[str, Any]]) -> None:
        """Take the rows of a finished case and seed; they are on the disk a second later."""
        for row in rows:
            self._waiting.append({**row, "launch": self.launch})
            self.done.add((row["case"], row["seed"]))
        if time.monotonic() - self._written > _PAUSE:
            self.flush()

    def flush(self) -> None:
        """Put everything that waits on the disk, as one part."""
        if not self._waiting:
            return
        import pyarrow as pa

        self._parts += 1
        _write_part(
            self._folder / CASES / f"part-{self.launch:04d}-{self._parts:06d}.parquet",
            pa.Table.from_pylist(self._waiting, schema=self._schema),
        )
        self._waiting, self._written = [], time.monotonic()

    def compact(self) -> None:
        """Make one part of all, in one step: the folder of parts is exchanged."""
        self.flush()
        place = self._folder / CASES
        if len(list(place.glob("part-*.parquet"))) < 2:
            return
        table = read_cases(self._folder).sort_by([("case", "ascending"), ("seed", "ascending"), ("kind", "descending")])
        with beside(place, folder=True) as partial:
            new = partial / CASES
            new.mkdir()
            _write_part(new / f"part-{self.launch:04d}-{self._parts + 1:06d}.parquet", table)
            sync_tree(new)
            if not exchange(new, place):
                return  # the parts stay as they are
            shutil.rmtree(new)


def read_cases(folder: Path, columns: list[str] | None = None) -> pa.Table:
    """Return the rows of a sweep, as far as it has come.

    Parameters
    ----------
    folder : Path
        Of the sweep.
    columns : list of str, optional
        Which; all if not given.

    Raises
    ------
    ScenarioError
        If it is no such folder, or a part is damaged.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    place = Path(folder) / CASES
    if not place.is_dir():
        raise ScenarioError([Problem(f"expected the folder of a sweep, with {CASES}", file=str(folder))])
    tables = []
    for part in sorted(place.glob("part-*.parquet")):
        try:
            tables.append(pq.read_table(part, columns=columns))
        except (OSError, pa.ArrowInvalid) as error:
            raise ScenarioError(
                [Problem(f"a damaged part: {error}; remove it and run again", file=str(part))]
            ) from error
    if not tables:
        names = columns or []
        return pa.table({name: pa.array([], pa.int64()) for name in names})
    return pa.concat_tables(tables)


def _write_part(path: Path, table: pa.Table) -> None:
    import pyarrow.parquet as pq

    content = io.BytesIO()
    pq.write_table(table, content)
    write_bytes(path, content.getvalue())


def refuse_others(folder: Path, study: Mapping[str, Any]) -> None:
    """Refuse a folder of another study, or of something else.

    Parameters
    ----------
    folder : Path
        Where a sweep is to go.
    study : mapping
        What it is (`Study.document`).

    Raises
    ------
    ScenarioError
        If the folder holds another study, with the difference, or something else.
    """
    if folder.exists() and not folder.is_dir():
        raise ScenarioError([Problem("exists and is no folder: choose another --out", file=str(folder))])
    if not folder.exists() or not any(folder.iterdir()):
        return
    try:
        known = json.loads((folder / STUDY).read_text("utf-8"))
    except (OSError, ValueError):
        if sorted(entry.name for entry in folder.iterdir()) in ([".lock"], [".lock", CASES]):
            return  # it was stopped before it began
        msg = f"exists and is no sweep (it has no {STUDY}): choose another --out, or move it away"
        raise ScenarioError([Problem(msg, file=str(folder))]) from None
    difference = _difference(known, json.loads(json.dumps(study)))
    if difference:
        msg = f"holds another study: {difference}; choose another --out, or move it away"
        raise ScenarioError([Problem(msg, file=str(folder))])


def _difference(known: dict[str, Any], study: dict[str, Any]) -> str:
    """Return in words where two studies differ, "" if they do not."""
    for key in ("name", "axes", "seeds", "precision"):
        if known.get(key) != study[key]:
            return f"{key} was {_short(known.get(key))} and is {_short(study[key])}"
    before, after = known.get("cases", []), study["cases"]
    if len(before) != len(after):
        return f"it had {len(before)} cases and has {len(after)}"
    for i, (one, other) in enumerate(zip(before, after, strict=True)):
        if one["values"] != other["values"]:
            return f"case {i} was {_short(one['values'])} and is {_short(other['values'])}"
        if one["scenario_sha256"] != other["scenario_sha256"]:
            return f"the scenario of case {i} ({_short(other['values'])}) is another: its base has changed"
    return ""


def _short(value: Any) -> str:
    text = json.dumps(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def _locked(folder: Path) -> int:
    handle = os.open(folder / ".lock", os.O_RDWR | os.O_CREAT, 0o644)
    if os.name == "posix":
        import fcntl

        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            os.close(handle)
            msg = "is in use by another sweep: wait for it, or choose another --out"
            raise ScenarioError([Problem(msg, file=str(folder))]) from None
    return handle
