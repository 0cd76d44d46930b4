"""NEES, NIS and whiteness of every filter that reports innovations, over Monte Carlo with its belief for the truth."""

from __future__ import annotations

import functools
from copy import deepcopy
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from scipy.stats import chi2, kstwobign

from testbed.fusion import FILTERS
from testbed.fusion.belief import load_belief
from testbed.fusion.model import build_model, covariance_root
from testbed.parts import resolve
from testbed.signals import random_stream

if TYPE_CHECKING:
    from testbed.signals import FloatArray

RATES = {"mems_gyro": 2000.0, "mhd_ars": 20000.0}
BELIEF = load_belief("eq39")
RUNS, N_TIME = 100, 3000
INSTANTS = (20, 200, 1000, 2999)  # where NEES is judged; single runs are independent, instants of one run are not
# One miss in a thousand over all that is compared: per filter four NEES, two NIS, two periodograms.
MISS = 1e-3 / (8 * len(FILTERS))

# What adapts R to the innovations is not consistent, not even with its own model for the truth; it says so itself.
DEPARTS = {name: departs for name in FILTERS if (departs := resolve("filter", name, FILTERS).departs)}

pytestmark = [pytest.mark.contract, pytest.mark.oracle]


@dataclass(frozen=True)
class Found:
    """Normalised error squared (run, instant), and normalised innovations of the last two thirds, all runs one after
    the other.
    """

    nees: FloatArray
    innovations: dict[str, FloatArray]


def built(name: str) -> Any:
    cls = resolve("filter", name, FILTERS)
    # From rest: what adapts is judged by its own sensors, not by what it makes of an unknown start;
    # and a model that wanders out of a sensor's range is no lie.
    parameters = cls.Parameters()
    if "start" in type(parameters).model_fields:
        parameters = parameters.model_copy(update={"start": "rest", "gate": False})
    return cls(BELIEF, RATES, parameters)


def truth_model(name: str, stage: Any) -> tuple[Any, FloatArray, FloatArray]:
    """Return the model of the filter, and R and covariance at the start that it begins with."""
    model, silent = stage.model, {"mems_gyro": [0.0], "mhd_ars": [0.0]}
    first = built(name).process(silent).diagnostics
    R = np.array([first[f"R_{one}"][0] if f"R_{one}" in first else model.R[i] for i, one in enumerate(model.sensors)])
    if name == "wideband":  # one of the bank
        p = stage.Parameters()
        model = build_model(BELIEF, RATES, order=p.order, q=1e7 * p.q, coloured=p.coloured, start="rest")
    return model, R, model.P0


def simulate(model: Any, R: FloatArray, P0: FloatArray, seed: int) -> tuple[FloatArray, FloatArray]:
    """Return rate (run, time) and readings (run, sensor, time) of x+ = F x + w, z = H x + v."""
    rng = random_stream(seed, "monte carlo")
    x = rng.standard_normal((RUNS, len(model.F))) @ covariance_root(P0).T
    root = covariance_root(model.Q)
    rate, z = np.empty((RUNS, N_TIME)), np.empty((RUNS, R.size, N_TIME))
    for k in range(N_TIME):
        if k:
            x = x @ model.F.T + rng.standard_normal(x.shape) @ root.T
        rate[:, k] = x[:, 0]
        z[:, :, k] = x @ model.H.T + rng.standard_normal((RUNS, R.size)) * np.sqrt(R)
    return rate, z


@functools.cache
def monte_carlo(name: str) -> Found:
    stage = built(name)
    if not any(
        key.startswith("innovation_variance_")
        for key in stage.process({"mems_gyro": [0.0], "mhd_ars": [0.0]}).diagnostics
    ):
        pytest.skip(f"{name} reports no innovations")
    rate, z = simulate(*truth_model(name, stage), seed=4)
    nees, innovations = np.empty((RUNS, len(INSTANTS))), {sensor: [] for sensor in RATES}
    fresh = built(name)
    for run in range(RUNS):
        block = deepcopy(fresh).process({"mems_gyro": z[run, 0, ::10], "mhd_ars": z[run, 1]})
        nees[run] = ((block.rate - rate[run]) / block.std)[list(INSTANTS)] ** 2
        for sensor, pieces in innovations.items():
            e, C = (
                block.diagnostics[f"{key}_{sensor}"][N_TIME // 3 :] for key in ("innovation", "innovation_variance")
            )
            pieces.append((e / np.sqrt(C))[np.isfinite(e)])
    return Found(nees, {sensor: np.concatenate(pieces) for sensor, pieces in innovations.items()})


def chance(n: int) -> tuple[float, float]:
    """Return what a mean of n squares of unit Gaussians lies between."""
    low, high = chi2.ppf([MISS / 2.0, 1.0 - MISS / 2.0], n) / n
    return float(low), float(high)


@pytest.mark.parametrize("name", FILTERS)
def test_error_is_as_large_as_claimed(name: str) -> None:
    low, high = DEPARTS.get(name, {}).get("nees", chance(RUNS))
    found = monte_carlo(name).nees.mean(axis=0)
    # The first reading is used as the filter begins with it: only later does adaptation tell.
    assert np.all((found[1:] >= low) & (found[1:] <= high)), found


@pytest.mark.parametrize("sensor", RATES)
@pytest.mark.parametrize("name", FILTERS)
def test_innovations_are_as_large_as_claimed(name: str, sensor: str) -> None:
    nu = monte_carlo(name).innovations[sensor]
    low, high = DEPARTS.get(name, {}).get(f"nis_{sensor}", chance(nu.size))
    assert low <= np.mean(nu**2) <= high


def cumulative_periodogram(series: FloatArray) -> float:
    """Return the largest distance of the cumulated periodogram from a straight line, times the root of its number of
    ordinates.
    """
    power = np.abs(np.fft.rfft(series))[1:-1] ** 2
    rising = np.cumsum(power) / np.sum(power)
    return float(np.max(np.abs(rising - np.arange(1, power.size + 1) / power.size)) * np.sqrt(power.size))


@pytest.mark.parametrize("sensor", RATES)
@pytest.mark.parametrize("name", [name for name in FILTERS if name not in DEPARTS])
def test_innovations_are_white(name: str, sensor: str) -> None:
    """Of white noise that distance follows Kolmogorov's law (Bartlett)."""
    assert cumulative_periodogram(monte_carlo(name).innovations[sensor]) < kstwobign.isf(MISS)


@pytest.mark.parametrize("name", DEPARTS)
def test_where_a_filter_departs_the_bounds_notice(name: str) -> None:
    found = monte_carlo(name)
    values = {"nees": (found.nees.mean(axis=0)[1:].max(), RUNS)}
    values |= {f"nis_{sensor}": (np.mean(nu**2), nu.size) for sensor, nu in found.innovations.items()}
    outside = {key for key, (value, n) in values.items() if not chance(n)[0] <= value <= chance(n)[1]}
    assert outside & set(DEPARTS[name])
