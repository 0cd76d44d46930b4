"""Who plays the tasks: this process, workers of a cluster on this machine, or those of a scheduler elsewhere."""

from __future__ import annotations

import contextlib
import pickle
from typing import TYPE_CHECKING, Any

from testbed.campaigns.agenda import Agenda, Task, play, play_packed
from testbed.campaigns.rows import failed_row
from testbed.errors import RunError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    Take = Callable[[Task, list[dict[str, Any]]], None]

# Tasks that are under way for each worker: one runs, the others wait beside it.
_AHEAD = 3
# How long a scheduler is waited for [s].
_PATIENCE = 30.0
LOOPBACK = "127.0.0.1"
# A worker publishes nothing, imports what plays while it starts, and is neither held up nor given up for the memory
# that it holds. A profile of it, which Dask keeps for an hour, would grow all the while.
_WORKER = {
    "dashboard": False,
    "preload": ["testbed.campaigns.evaluate"],
    "memory_limit": 0,
    "config": {"distributed.worker.profile.enabled": False},
}


def play_here(agenda: Agenda, take: Take) -> None:
    """Play all tasks in this process.

    Parameters
    ----------
    agenda : Agenda
        Hands out the tasks.
    take : callable
        Gets every task with its rows.
    """
    while (task := agenda.next()) is not None:
        rows = play(task)
        agenda.finish(task, rows)
        take(task, rows)


def play_on_cluster(agenda: Agenda, take: Take, *, workers: int = 0, scheduler: str | None = None) -> None:
    """Play the tasks on workers of Dask.

    Parameters
    ----------
    agenda : Agenda
        Hands out the tasks.
    take : callable
        Gets every task with its rows, in whatever order they finish.
    workers : int, optional
        Of a cluster on this machine, one thread each, reached over loopback only.
    scheduler : str, optional
        Address of a running scheduler instead, such as ``tcp://10.0.0.1:8786``.

    Raises
    ------
    RunError
        If the scheduler cannot be reached, or is lost; what is finished is kept.
    """
    from testbed.campaigns.size import warm

    if scheduler is None:
        warm(agenda.study)  # once, here: else every worker compiles for itself
    with _client(workers, scheduler) as client:
        ahead = _AHEAD * max(len(client.scheduler_info()["workers"]), workers, 1)
        for task, rows in _finished(client, agenda, ahead):
            agenda.finish(task, rows)
            take(task, rows)


def _finished(client: Any, agenda: Agenda, ahead: int) -> Iterator[tuple[Task, list[dict[str, Any]]]]:
    """Yield the tasks with their rows, in whatever order they finish.

    A task whose workers died again and again may have had bad company on them: it is played once more, alone, at the
    end, and fails if they die again.
    """
    from distributed import KilledWorker, as_completed

    running: dict[Any, Task] = {}
    suspects: list[Task] = []
    results, alone = as_completed(), False

    def submit(task: Task) -> None:
        # Packed, so that the scheduler neither opens it nor imports what it is made of.
        future = client.submit(play_packed, pickle.dumps(task), pure=False)
        running[future] = task
        results.add(future)

    while True:
        while len(running) < ahead and (task := agenda.next()) is not None:
            submit(task)
        if not running:
            if not suspects:
                return
            alone = True
            submit(suspects.pop())
        with _lost_as_error():
            future = next(results)
            task = running.pop(future)
            try:
                rows = future.result()
            except KilledWorker as error:
                if not alone:
                    suspects.append(task)
                    continue
                why = f"{1 + error.allowed_failures} workers died of it: out of memory, or a crash of compiled code"
                rows = [failed_row(task.case, seed, why) for seed in task.seeds]
            future.release()
        yield task, rows


@contextlib.contextmanager
def _lost_as_error() -> Iterator[None]:
    """Turn what Dask raises where the scheduler is gone into an error of the run."""
    from distributed.client import FutureCancelledError

    try:
        yield
    except (OSError, TimeoutError, FutureCancelledError, StopIteration) as error:
        msg = f"the scheduler was lost ({type(error).__name__}: {error}): run the same command again to go on"
        raise RunError(msg) from error


@contextlib.contextmanager
def _client(workers: int, scheduler: str | None) -> Iterator[Any]:
    """Yield a client of the scheduler, or of a cluster of one's own that goes with it."""
    import dask
    from distributed import Client, SubprocessCluster

    with dask.config.set({"distributed.comm.timeouts.connect": _PATIENCE}), contextlib.ExitStack() as stack:
        try:
            if scheduler is None:
                cluster = stack.enter_context(
                    SubprocessCluster(
                        host=LOOPBACK,
                        dashboard_address=f"{LOOPBACK}:0",
                        n_workers=workers,
                        threads_per_worker=1,
                        worker_kwargs=_WORKER,
                    )
                )
                client = stack.enter_context(Client(cluster))
            else:
                client = stack.enter_context(Client(scheduler, timeout=_PATIENCE))
        except (OSError, TimeoutError, ValueError) as error:
            where = "a cluster on this machine" if scheduler is None else scheduler
            msg = f"{where} cannot be reached: {error}"
            raise RunError(msg) from error
        yield client
