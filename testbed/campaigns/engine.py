"""Who plays the tasks: this process, workers of a cluster on this machine, or those of a scheduler elsewhere."""

from __future__ import annotations

import contextlib
from typing import TYPE_CHECKING, Any

from testbed.campaigns.agenda import Agenda, Task, play
from testbed.errors import RunError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    Take = Callable[[Task, list[dict[str, Any]]], None]

# Tasks that are under way for each worker: one runs, the others wait beside it.
_AHEAD = 3
# How long a scheduler is waited for [s].
_PATIENCE = 30.0
LOOPBACK = "127.0.0.1"


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
    from distributed import as_completed
    from distributed.client import FutureCancelledError

    from testbed.campaigns.size import warm

    if scheduler is None:
        warm(agenda.study)  # once, here: else every worker compiles for itself
    with _client(workers, scheduler) as client:
        ahead = _AHEAD * max(len(client.scheduler_info()["workers"]), workers, 1)
        running: dict[Any, Task] = {}
        results = as_completed()
        try:
            _submit(client, agenda, running, results, ahead)
            while running:
                future = next(results)
                task = running.pop(future)
                rows = future.result()
                future.release()
                agenda.finish(task, rows)
                take(task, rows)
                _submit(client, agenda, running, results, ahead)
        except (OSError, TimeoutError, FutureCancelledError, StopIteration) as error:
            msg = f"the scheduler was lost ({type(error).__name__}: {error}): run the same command again to go on"
            raise RunError(msg) from error


def _submit(client: Any, agenda: Agenda, running: dict[Any, Task], results: Any, ahead: int) -> None:
    while len(running) < ahead and (task := agenda.next()) is not None:
        future = client.submit(play, task, pure=False)
        running[future] = task
        results.add(future)


@contextlib.contextmanager
def _client(workers: int, scheduler: str | None) -> Iterator[Any]:
    """Yield a client of the scheduler, or of a cluster of one's own that goes with it."""
    import dask
    from distributed import Client, SubprocessCluster

    # Nothing of Dask's is published, and no worker is given up for what it holds.
    quiet = {"distributed.worker.memory.terminate": False, "distributed.comm.timeouts.connect": _PATIENCE}
    with dask.config.set(quiet), contextlib.ExitStack() as stack:
        try:
            if scheduler is None:
                cluster = stack.enter_context(
                    SubprocessCluster(
                        host=LOOPBACK,
                        dashboard_address=f"{LOOPBACK}:0",
                        n_workers=workers,
                        threads_per_worker=1,
                        worker_kwargs={"dashboard": False},
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
