"""What of a recording is kept in memory while it is read: whole columns, or the means of neighbouring samples."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.logs.means import Means, Places
from testbed.logs.options import refusal

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping, Sequence

    from numpy.typing import NDArray

    from testbed.errors import ScenarioError
    from testbed.logs.plan import Plan
    from testbed.logs.stamps import StampScan
    from testbed.logs.table import Table

    Timed = tuple[int | None, float]
    Stamps = dict[Timed, NDArray[np.int64]]

# Numbers that are kept at most: 1 GB of them, and what is made of them takes as much several times over.
MOST_KEPT = 1 << 27
_GOOD_AVERAGE = 1000
# Lines are counted in the first megabyte of a text: of so many there may be this share.
_SURE = 0.5
# Samples that are kept one by one unless more are asked for, and means that are kept of more: 500 MB with all that is
# made of them.
MOST_WHOLE = 1 << 23
_MEANS = 1 << 21


def fitting(one: Plan) -> Plan:
    """Return a plan that keeps the means of as many samples as memory asks for, a power of 2, and says so."""
    column = one.table.columns[one.value]
    n_time = max(column.n_time or 0, column.about or 0)
    if n_time <= MOST_WHOLE:
        return one
    average = 1 << math.ceil(math.log2(n_time / _MEANS))
    remedy = f"--average 1 keeps all, up to {MOST_KEPT >> 20} million"
    said = f"about {n_time:.1e} samples: means of {average} are kept; {remedy}"
    return replace(one, average=average, assumed=(*one.assumed, said))


def kept_columns(
    table: Table, plans: Sequence[Plan], scans: Mapping[Timed, StampScan]
) -> tuple[list[NDArray[Any]], Stamps]:
    """Return the column of each plan, and the stamps; blocks are joined one by one, so that all stands there once.

    Parameters
    ----------
    table : Table
        The file.
    plans : sequence of Plan
        Of one group of its columns, with the same `average`.
    scans : mapping
        What looks at the stamps, by column and unit.

    Returns
    -------
    tuple
        Numbers as in the file, and stamps [ns] by column and unit, none where means are kept.

    Raises
    ------
    ScenarioError
        If it is empty, or holds more than memory should.
    """
    kept = _Means(plans) if plans[0].average > 1 else _Columns(plans, scans)
    stamps = {one.stamps for one in plans if one.stamps is not None}
    n_time = 0
    # What the file itself says is refused before it is read.
    if plans[0].average == 1 and _said(table, {one.value for one in plans} | stamps) > MOST_KEPT:
        raise _too_many(table)
    for block in table.blocks(list(dict.fromkeys([*(one.value for one in plans), *stamps])), stamps):
        n_time += next(iter(block.values())).size
        times = {key: scan.add(block[scan.column]) for key, scan in scans.items()}
        try:
            n_kept = kept.add(block, times)
        except OverflowError as error:
            raise refusal(table.path, f"{error}: cut the record in parts", "--time") from error
        if n_kept > MOST_KEPT:
            raise _too_many(table)
    if not n_time:
        raise refusal(table.path, "expected at least 4 samples, got 0")
    return kept.result()


def _said(table: Table, wanted: Collection[int]) -> float:
    """Return how many numbers columns hold at the least, as far as the file says."""
    columns = [table.columns[i] for i in wanted]
    return sum(max(one.n_time or 0, _SURE * (one.about or 0)) for one in columns)


def _too_many(table: Table) -> ScenarioError:
    message = f"holds more than the {MOST_KEPT >> 20} million numbers that are kept in memory"
    remedy = f"--average {_GOOD_AVERAGE} keeps means of as many samples, which take about 100 bytes each"
    return refusal(table.path, f"{message}: {remedy}")


class _Columns:
    """Whole columns and stamps."""

    def __init__(self, plans: Sequence[Plan], scans: Mapping[Timed, StampScan]) -> None:
        self._plans = plans
        self._values: dict[int, list[NDArray[Any]]] = {one.value: [] for one in plans}
        self._times: dict[Timed, list[NDArray[np.int64]]] = {key: [] for key in scans}
        self._n_kept = 0

    def add(self, block: Mapping[int, NDArray[Any]], times: Stamps) -> int:
        for i, parts in self._values.items():
            parts.append(block[i])
            self._n_kept += block[i].size
        for key, stamps in times.items():
            self._times[key].append(stamps)
            self._n_kept += stamps.size
        return self._n_kept

    def result(self) -> tuple[list[NDArray[Any]], Stamps]:
        values = {i: _joined(parts) for i, parts in self._values.items()}
        uses = Counter(one.value for one in self._plans)
        # A channel scales its numbers in place.
        own = [values[one.value].copy() if uses[one.value] > 1 else values[one.value] for one in self._plans]
        return own, {key: _joined(parts) for key, parts in self._times.items()}


class _Means:
    """Means of neighbouring samples, on the even grid of the stamps where these are used."""

    def __init__(self, plans: Sequence[Plan]) -> None:
        self._plans = plans
        self._means = [Means(one.average, one.kind) for one in plans]
        self._places = {self._clock(one): Places() for one in plans}
        self._values: list[list[NDArray[Any]]] = [[] for _ in plans]

    def add(self, block: Mapping[int, NDArray[Any]], times: Stamps) -> int:
        n_time = next(iter(block.values())).size
        places = {
            key: clock.rows(n_time) if key is None else clock.stamped(times[key]) for key, clock in self._places.items()
        }
        for one, means, parts in zip(self._plans, self._means, self._values, strict=True):
            parts.append(means.add(block[one.value], places[self._clock(one)]))
        return sum(part.size for parts in self._values for part in parts)

    def result(self) -> tuple[list[NDArray[Any]], Stamps]:
        return [_joined(parts) for parts in self._values], {}

    @staticmethod
    def _clock(one: Plan) -> Timed | None:
        return (one.stamps, one.time_unit) if one.stamps is not None and one.time_said else None


def _joined(parts: list[NDArray[Any]]) -> NDArray[Any]:
    """Return blocks as one array, and let go of them."""
    whole = parts[0] if len(parts) == 1 else np.concatenate(parts)
    parts.clear()
    return whole
