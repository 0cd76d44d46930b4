"""What is to be done of a study, in pieces that are always cut the same way."""

from __future__ import annotations

import pickle
from collections import deque
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.campaigns.rows import FAILED, failed_row, rows_of
from testbed.campaigns.statistics import relative_half_width

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from testbed.campaigns.study import Study, Variation

# Seeds of a task. They share a truth, and what is finished of them is kept when the process dies.
CHUNK = 10


@dataclass(frozen=True)
class Task:
    """A case and the seeds of one chunk of it that are still to be done."""

    case: Variation
    chunk: int
    seeds: tuple[int, ...]


def play(task: Task) -> list[dict[str, Any]]:
    """Return the rows of a task; one that fails is a row that says why.

    Parameters
    ----------
    task : Task
        What to do; it and its rows can be pickled.
    """
    from testbed.campaigns.evaluate import evaluate

    try:
        found = evaluate(task.case.scenario, task.seeds)
    except Exception as error:  # noqa: BLE001 - whatever a case does must not stop the others
        if len(task.seeds) > 1:
            return [row for seed in task.seeds for row in play(Task(task.case, task.chunk, (seed,)))]
        return [failed_row(task.case, task.seeds[0], f"{type(error).__name__}: {error}")]
    return [row for seed, one in zip(task.seeds, found, strict=True) for row in rows_of(task.case, seed, one)]


def play_packed(packed: bytes) -> list[dict[str, Any]]:
    """Return the rows of a task that was packed by `pickle`, which a scheduler passes on without opening it.

    Parameters
    ----------
    packed : bytes
        The task.
    """
    task: Task = pickle.loads(packed)
    return play(task)


class Agenda:
    """Hands out tasks until every case is done; a case with a precision gets chunk after chunk until it has it.

    What is handed out next depends on the rows of the case alone, never on the order in which others finish.

    Parameters
    ----------
    study : Study
        What is wanted.
    done : collection of (int, int)
        Cases and seeds whose rows are there already.
    squares : mapping of (int, int) to mapping of str to float, optional
        Mean square errors of the filters [deg^2/s^2] so far, by case and seed, then by source.
    failed : iterable of int, optional
        Cases of which a run has failed already: they get no further chunk.
    """

    def __init__(
        self,
        study: Study,
        done: Iterable[tuple[int, int]],
        squares: Mapping[tuple[int, int], Mapping[str, float]] | None = None,
        failed: Iterable[int] = (),
    ) -> None:
        self.study = study
        self._done: dict[int, set[int]] = {}
        for number, seed in done:
            self._done.setdefault(number, set()).add(seed)
        self._squares = {key: dict(known) for key, known in (squares or {}).items()}
        self._failed = set(failed)
        self._waiting: deque[Task] = deque()
        for case in study.cases:
            self._continue(case, 0)

    @property
    def runs(self) -> int:
        """Runs of the whole study at the most."""
        return len(self.study.cases) * len(self.study.seeds)

    def next(self) -> Task | None:
        """Return a task, None if none waits now."""
        return self._waiting.popleft() if self._waiting else None

    def finish(self, task: Task, rows: Iterable[Mapping[str, Any]]) -> None:
        """Take the rows of a task.

        Parameters
        ----------
        task : Task
            That was handed out.
        rows : iterable of mapping
            What came of it.
        """
        for row in rows:
            if row["status"] == FAILED:
                self._failed.add(task.case.number)
            elif row["kind"] == "filter" and row["rmse_deg_s"] is not None:
                self._squares.setdefault((task.case.number, row["seed"]), {})[row["source"]] = row["rmse_deg_s"] ** 2
        self._done.setdefault(task.case.number, set()).update(task.seeds)
        if self.study.precision is not None:
            self._continue(task.case, task.chunk + 1)

    def _continue(self, case: Variation, chunk: int) -> None:
        """Queue what is next of a case from a chunk on: all of it, or one chunk where a precision decides."""
        seeds = self.study.seeds
        for k in range(chunk, -(-len(seeds) // CHUNK)):
            if self.study.precision is not None and k > 0 and self._precise(case.number, seeds[: k * CHUNK]):
                return
            done = self._done.get(case.number, set())
            left = tuple(seed for seed in seeds[k * CHUNK : (k + 1) * CHUNK] if seed not in done)
            if left:
                self._waiting.append(Task(case, k, left))
                if self.study.precision is not None:
                    return

    def _precise(self, number: int, seeds: Sequence[int]) -> bool:
        """Return whether every filter of a case is known well enough from some seeds, or it fails anyway."""
        assert self.study.precision is not None
        if number in self._failed:
            return True
        known = [self._squares.get((number, seed), {}) for seed in seeds]
        columns = [np.array([one[name] for one in known if name in one]) for name in known[0]]
        return bool(columns) and all(relative_half_width(one) <= self.study.precision for one in columns)
