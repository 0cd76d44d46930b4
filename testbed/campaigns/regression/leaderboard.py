"""Filters in order: how far each is above the least error there is, whether its claims hold, and what it costs."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.campaigns.regression.compare import ERRORS, in_words
from testbed.campaigns.regression.standard import AXES
from testbed.campaigns.statistics import COVERAGE

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from testbed.scenario.model import Scenario
    from testbed.signals import FloatArray

    Row = Mapping[str, Any]

# A claim holds in a case if the mean of error squared over variance claimed is at most this, as the contract has it.
HONEST_NEES = 2.0
# Seconds of readings that a filter is timed over, and how often.
_TIMED_S, _TIMES = 0.5, 3


@dataclass(frozen=True)
class Standing:
    """A filter's place.

    Parameters
    ----------
    name : str
        Of the filter.
    over_optimum, lower, upper : float
        Its error over the least one of each case, geometric mean over the cases, with its 95 % interval over seeds [-].
    worst, worst_case : float, str
        The largest of these ratios, and where.
    honest : float
        Share of the cases in which its claims hold [-].
    error_over_claim : float
        Its error over what it claims, geometric mean over the cases [-].
    cost : float or None
        Its time over that of `kalman` [-].
    n_case : int
        Cases in which its error is defined.
    residual : float
        What it leaves of a line of sight, geometric mean over the cases with one [urad]; NaN without.
    """

    name: str
    over_optimum: float
    lower: float
    upper: float
    worst: float
    worst_case: str
    honest: float
    error_over_claim: float
    cost: float | None
    n_case: int
    residual: float


def standings(rows: Iterable[Row], costs: Mapping[str, float]) -> list[Standing]:
    """Return the filters from the best on; those that miss a case come behind those that have all.

    The least error of a case is the optimum of its signal, or the floor where it has no lines.

    Parameters
    ----------
    rows : iterable of mapping
        As `testbed.campaigns.regression.history.essence` gives them.
    costs : mapping of str to float
        Time of a filter over that of `kalman` [-].
    """
    groups: dict[str, dict[tuple[str, ...], list[Row]]] = {}
    for row in rows:
        if row["kind"] == "filter":
            case = tuple(row[axis] for axis in AXES)
            groups.setdefault(row["source"], {}).setdefault(case, []).append(row)
    found = [_standing(name, cases, costs.get(name)) for name, cases in groups.items()]
    return sorted(found, key=lambda one: (-one.n_case, one.over_optimum))


def _standing(name: str, cases: Mapping[tuple[str, ...], Sequence[Row]], cost: float | None) -> Standing:
    from scipy.stats import t as student

    ratios, claims, honest, logs = {}, [], [], []
    for case, found in cases.items():
        rows = sorted(found, key=lambda row: row["seed"])
        errors, least = _column(rows, "rmse_deg_s"), _least(rows)
        if not (np.isfinite(errors).all() and np.isfinite(least).all() and (least > 0.0).all()):
            continue
        ratios[case] = float(np.sqrt(np.mean(errors**2) / np.mean(least**2)))
        logs.append(np.log(errors / least))
        claims.append(float(np.sqrt(np.mean(errors**2) / np.mean(_column(rows, "mean_std_deg_s") ** 2))))
        honest.append(float(np.mean(_column(rows, "nees"))) <= HONEST_NEES)
    if not ratios:
        return Standing(name, np.nan, np.nan, np.nan, np.nan, "", 0.0, np.nan, cost, 0, np.nan)
    worst = max(ratios, key=lambda case: ratios[case])
    seeds = min(column.size for column in logs)
    # Cases of one seed are not independent, seeds are.
    of_seed = np.mean([column[:seeds] for column in logs], axis=0)
    spread = float(of_seed.std(ddof=1)) / seeds**0.5 if seeds > 1 else np.nan
    half = float(student.ppf(0.5 + COVERAGE / 2.0, seeds - 1)) * spread if seeds > 1 else np.nan
    centre = float(np.mean(np.log(list(ratios.values()))))
    over, lower, upper = (float(np.exp(x)) for x in (centre, centre - half, centre + half))
    mean_claim = float(np.exp(np.mean(np.log(claims))))
    share = float(np.mean(honest))
    place = in_words(worst)
    return Standing(
        name, over, lower, upper, ratios[worst], place, share, mean_claim, cost, len(ratios), _residual(cases.values())
    )


def _residual(cases: Iterable[Sequence[Row]]) -> float:
    """Return the rms of the residual over the seeds, geometric mean over the cases that have one [urad]."""
    residuals = [_column(rows, ERRORS["residual"]) for rows in cases]
    logs = [0.5 * np.log(np.mean(one**2)) for one in residuals if np.isfinite(one).all()]
    return float(np.exp(np.mean(logs))) if logs else float("nan")


def _least(rows: Sequence[Row]) -> FloatArray:
    optimum = _column(rows, "optimum_rmse_deg_s")
    return np.where(np.isfinite(optimum), optimum, _column(rows, "floor_rmse_deg_s"))


def _column(rows: Iterable[Row], name: str) -> FloatArray:
    return np.array([np.nan if row.get(name) is None else row[name] for row in rows], dtype=float)


def costs_of(scenario: Scenario) -> dict[str, float]:
    """Return the processor time of each filter of a scenario over that of `kalman`, both compiled, in this process.

    Parameters
    ----------
    scenario : Scenario
        With the filters; its sensors are read at rest.
    """
    from testbed.chain.instruments import start_filter
    from testbed.scenario.model import Scenario

    reference = Scenario.from_dict({**scenario.source, "fusion": {"kalman": {}}})
    stages = {"": start_filter(reference, "kalman", reference.fusion["kalman"])}
    stages |= {name: start_filter(scenario, name, spec) for name, spec in scenario.fusion.items()}
    rng = np.random.default_rng(0)
    readings = {
        name: 1e-4 * rng.standard_normal(round(_TIMED_S * sensor.sample_rate))
        for name, sensor in scenario.sensors.items()
    }
    spent: dict[str, float] = {}
    # Interleaved, so that whatever else the machine does meets all; the first round compiles.
    for turn in range(_TIMES + 1):
        for name, stage in stages.items():
            begun = time.process_time()
            stage.process(readings)
            if turn:
                spent[name] = min(spent.get(name, np.inf), time.process_time() - begun)
    return {name: spent[name] / spent[""] for name in scenario.fusion}
