"""What a campaign shows: errors with intervals over its axes, from the rows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.campaigns.rows import OK, RESIDUAL, WINDOWED
from testbed.campaigns.statistics import Comparison, rank, rms_interval

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import pyarrow as pa

    from testbed.signals import FloatArray


@dataclass(frozen=True)
class Point:
    """One source in one case over its seeds: RMSE with interval, bounds [deg/s], NEES [-], first line's gain [-] and
    phase [deg]; NaN where undefined. `sight` has the errors of the line of sight with their intervals [urad].
    """

    case: int
    axes: Mapping[str, Any]
    n_seed: int
    lower: float
    rmse: float
    upper: float
    claimed: float
    floor: float
    optimum: float
    nees: float
    gain: tuple[float, float, float]
    phase: tuple[float, float, float]
    first_seed: int
    sight: Mapping[str, tuple[float, float, float]]


@dataclass(frozen=True)
class Summary:
    """All points by kind and source, and the filters in their order."""

    points: Mapping[tuple[str, str], Sequence[Point]]
    ranking: Sequence[Comparison]
    failures: Sequence[Mapping[str, Any]]


def summarise(table: pa.Table, axes: Sequence[str]) -> Summary:
    """Return what the rows of a campaign say.

    Parameters
    ----------
    table : pyarrow.Table
        As `read_cases` returns it.
    axes : sequence of str
        Varied keys.
    """
    rows = table.to_pylist() if table.num_rows else []
    groups: dict[tuple[str, str], dict[int, list[dict[str, Any]]]] = {}
    for row in rows:
        if row["status"] == OK:
            groups.setdefault((row["kind"], row["source"]), {}).setdefault(row["case"], []).append(row)
    points = {
        key: [_point(case, sorted(found, key=lambda row: row["seed"]), axes) for case, found in sorted(cases.items())]
        for key, cases in groups.items()
    }
    failures = [row for row in rows if row["status"] != OK]
    return Summary(points, rank(_errors(groups)), failures)


def _point(case: int, rows: list[dict[str, Any]], axes: Sequence[str]) -> Point:
    first = rows[0]
    lower, rmse, upper = _rms(_column(rows, "rmse_deg_s"))
    aimed = [name for name in first if name == RESIDUAL or name.startswith(WINDOWED)]
    sight = {name: _rms(_column(rows, name)) for name in aimed}
    claimed = _column(rows, "mean_std_deg_s")
    lines = [row["lines"][0] if row["lines"] else {} for row in rows]
    return Point(
        case=case,
        axes={key: first[key] for key in axes},
        n_seed=len(rows),
        lower=lower,
        rmse=rmse,
        upper=upper,
        claimed=_mean(claimed**2) ** 0.5,
        floor=_mean(_column(rows, "floor_rmse_deg_s")),
        optimum=_mean(_column(rows, "optimum_rmse_deg_s")),
        nees=_mean(_column(rows, "nees")),
        gain=_interval(_column(lines, "gain")),
        phase=_interval(_column(lines, "phase_deg")),
        first_seed=first["seed"],
        sight={name: one for name, one in sight.items() if np.isfinite(one[1])},
    )


def _rms(errors: FloatArray) -> tuple[float, float, float]:
    """Return the rms over seeds with its 95 % interval, NaN if there is none."""
    known = errors[np.isfinite(errors)]
    return rms_interval(known**2) if known.size else (np.nan, np.nan, np.nan)


def _column(rows: Sequence[Mapping[str, Any]], name: str) -> FloatArray:
    return np.array([np.nan if row.get(name) is None else row[name] for row in rows], dtype=float)


def _mean(values: FloatArray) -> float:
    finite = values[np.isfinite(values)]
    return float(finite.mean()) if finite.size else float("nan")


def _interval(values: FloatArray) -> tuple[float, float, float]:
    """Return the mean over seeds with its 95 % interval, by Student's t."""
    from scipy.special import stdtrit

    finite = values[np.isfinite(values)]
    if not finite.size:
        return (np.nan, np.nan, np.nan)
    mean = float(finite.mean())
    if finite.size < 2:
        return (np.nan, mean, np.nan)
    half = float(stdtrit(finite.size - 1, 0.975) * finite.std(ddof=1) / finite.size**0.5)
    return (mean - half, mean, mean + half)


def _errors(groups: Mapping[tuple[str, str], Mapping[int, Sequence[Mapping[str, Any]]]]) -> dict[str, FloatArray]:
    """Return the RMSE of every filter by case and seed, NaN where there is none."""
    filters = {name: cases for (kind, name), cases in groups.items() if kind == "filter"}
    numbers = sorted({case for cases in filters.values() for case in cases})
    seeds = sorted({row["seed"] for cases in filters.values() for rows in cases.values() for row in rows})
    place = {seed: j for j, seed in enumerate(seeds)}
    found = {}
    for name, cases in filters.items():
        errors = np.full((len(numbers), len(seeds)), np.nan)
        for i, number in enumerate(numbers):
            for row in cases.get(number, ()):
                if row["rmse_deg_s"]:
                    errors[i, place[row["seed"]]] = row["rmse_deg_s"]
        found[name] = errors
    return found
