"""A sweep: every case of a study under its seeds, into one folder that another launch goes on with."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from testbed.campaigns.agenda import Agenda, Task
from testbed.campaigns.engine import play_here, play_on_cluster
from testbed.campaigns.page import Page
from testbed.campaigns.rows import FAILED, schema_of
from testbed.campaigns.store import CaseStore, read_cases
from testbed.campaigns.study import Study, load_study
from testbed.errors import Problem, ScenarioError

if TYPE_CHECKING:
    from collections.abc import Callable

    import pyarrow as pa

    Told = Callable[["Progress"], None]


class Progress:
    """How far a sweep has come.

    Parameters
    ----------
    runs : int
        Of the study at the most.
    done : int
        That were there before.
    """

    def __init__(self, runs: int, done: int) -> None:
        self.runs, self.done, self.failed = runs, done, 0
        self.best: tuple[float, str] | None = None
        self.worst: tuple[float, str] | None = None

    def add(self, rows: list[dict[str, Any]]) -> None:
        """Count the rows of a task.

        Parameters
        ----------
        rows : list of dict
            Of some seeds of a case.
        """
        self.done += len({row["seed"] for row in rows})
        for row in rows:
            if row["status"] == FAILED:
                self.failed += 1
            elif row["kind"] == "filter" and row["rmse_deg_s"] is not None:
                one = (row["rmse_deg_s"], f"{row['source']} in case {row['case']}")
                self.best = min(self.best or one, one)
                self.worst = max(self.worst or one, one)


def sweep(
    study: Study | str | Path,
    *,
    workers: int = 1,
    scheduler: str | None = None,
    out: str | Path | None = None,
    progress: Told | None = None,
) -> Path:
    """Play every case of a study under its seeds, and return the folder with ``cases.parquet`` and ``sweep.html``.

    What is in the folder already is not done again; a study that has changed since is refused. Results do not depend
    on the number of workers, nor on the order in which they finish.

    Parameters
    ----------
    study : Study, str or Path
        A study, or its file.
    workers : int, optional
        Processes; 1 is this one.
    scheduler : str, optional
        Address of a running Dask scheduler instead.
    out : str or Path, optional
        Folder; ``runs/<name>`` if not given.
    progress : callable, optional
        Gets how far it has come after every task.

    Returns
    -------
    Path
        The folder.

    Raises
    ------
    ScenarioError
        If the study is bad, or the folder holds another one.
    RunError
        If the scheduler is lost; what is finished is kept.

    Examples
    --------
    >>> base = "{name: base, duration: 0.1 s, motion: [{static: {}}], sensors: {mems_gyro: {preset: adis16505}}}"
    >>> walks = "vary: {sensors.mems_gyro.angle_random_walk: [0.1 deg/sqrt(h), 1 deg/sqrt(h)]}"
    >>> _ = Path("base.yaml").write_text(base)
    >>> _ = Path("study.yaml").write_text(f"{{name: noises, base: base.yaml, {walks}, seeds: 3}}")
    >>> folder = sweep("study.yaml")
    >>> sorted(path.name for path in folder.iterdir() if not path.name.startswith("."))
    ['cases.parquet', 'study.json', 'sweep.html']
    """
    loaded = study if isinstance(study, Study) else load_study(study)
    if workers < 1:
        raise ScenarioError([Problem(f"expected at least 1, got {workers}", "workers")])
    folder = folder_of(loaded, out)
    with CaseStore(folder, loaded.document(), schema_of(loaded)) as store:
        agenda = Agenda(loaded, store.done, *(_known(folder) if loaded.precision is not None else ()))
        told, page = Progress(agenda.runs, len(store.done)), Page(folder, loaded)

        def take(_task: Task, rows: list[dict[str, Any]]) -> None:
            store.add(rows)
            told.add(rows)
            page.grow()
            if progress is not None:
                progress(told)

        if workers == 1 and scheduler is None:
            play_here(agenda, take)
        else:
            play_on_cluster(agenda, take, workers=0 if scheduler else workers, scheduler=scheduler)
        if progress is not None and told.done < told.runs:
            told.runs = told.done  # no error needs further seeds
            progress(told)
        store.compact()
        page.write()
    return folder


def folder_of(study: Study, out: str | Path | None) -> Path:
    """Return the folder of a study.

    Parameters
    ----------
    study : Study
        Which.
    out : str, Path or None
        As `sweep` takes it.
    """
    return Path("runs") / study.name if out is None else Path(out)


def open_sweep(folder: str | Path) -> pa.Table:
    """Return the rows of a sweep, one per case, seed and source; also of one that has not come to its end.

    Parameters
    ----------
    folder : str or Path
        That `sweep` returned.

    Raises
    ------
    ScenarioError
        If it is no such folder.

    Examples
    --------
    >>> open_sweep("nowhere")
    Traceback (most recent call last):
    testbed.errors.ScenarioError: nowhere: expected the folder of a sweep, with cases.parquet
    """
    return read_cases(Path(folder))


def _known(folder: Path) -> tuple[dict[tuple[int, int], dict[str, float]], set[int]]:
    """Return the mean squares of the filters that are there already, by case and seed, and the cases that failed."""
    columns = ["case", "seed", "kind", "source", "status", "rmse_deg_s"]
    rows = read_cases(folder, columns).to_pylist()
    squares: dict[tuple[int, int], dict[str, float]] = {}
    for row in rows:
        if row["kind"] == "filter" and row["rmse_deg_s"] is not None:
            squares.setdefault((row["case"], row["seed"]), {})[row["source"]] = row["rmse_deg_s"] ** 2
    return squares, {row["case"] for row in rows if row["status"] == FAILED}
