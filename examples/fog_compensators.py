"""Drift compensation of a fibre-optic gyro on thermal cycles that its model has not seen: the figures of docs/compensation_models.md.

Simulated `fog_paper3` at 1 Hz on a fixed base, Earth rate 10.6 deg/h. Trained on one cycle (up-first) or two (up-first and down-first) and
judged on four others: the same two programmes and two with other rates, holds and turning points, all under noise of their own.

Run it with ``python examples/fog_compensators.py [SEEDS]`` (default 6; about 40 s of processor time; the LSSVM on the first seed only).
"""

from __future__ import annotations

import sys
from dataclasses import dataclass

import numpy as np

from testbed.compensation.features import Features
from testbed.compensation.lssvm import Lssvm, block_residuals
from testbed.compensation.model_only import DriftModel, train
from testbed.compensation.record import Record
from testbed.compensation.search import evolve, grey_wolf
from testbed.compensation.training import block_means, gather
from testbed.models.temperature import TemperatureProfile
from testbed.sensors import load_preset
from testbed.sensors.allan import allan_deviation, fit_allan
from testbed.sensors.base import Surroundings

DEG_H = np.pi / 180.0 / 3600.0
EARTH = 10.6 * DEG_H
FOG = load_preset("fog_paper3").model_copy(update={"sample_rate": 1.0})
# Holds [s] and ramps (to degC, K/min) from 20 degC. The first two train; the last two are judged, with the first two under other noise.
PROGRAMMES = {
    "up-first": [7200.0, (60.0, 0.1), (-30.0, 0.1)],
    "down-first": [7200.0, (-30.0, 0.1), (60.0, 0.1)],
    "slower, holds": [3600.0, (55.0, 0.08), 5400.0, (-25.0, 0.09), 5400.0],
    "down, other turns": [5400.0, (-25.0, 0.1), 3600.0, (50.0, 0.09), (20.0, 0.1)],
}
# Name: method, features unless the method's own.
MODELS: dict[str, tuple[str, Features | None]] = {
    "gradient": ("gradient", None),
    "polynomial": ("polynomial", None),
    "lssvm": ("lssvm", None),
    "lssvm, T alone": ("lssvm", Features(degree=1, slopes=False, lags=())),
    "gradient, plays": ("gradient", Features(plays=(3.0, 10.0))),
}
PERIODS = (10.0, 60.0, 600.0, 3600.0, 21_600.0)


@dataclass(frozen=True)
class Cycle:
    """A record with its true drift and noise [rad/s]; drift is all that temperature does, scale factor included."""

    record: Record
    drift: np.ndarray
    noise: np.ndarray


def chamber(legs: list[float | tuple[float, float]]) -> np.ndarray:
    """Return the programme's temperature [K] at 1 Hz."""
    steps: list[dict[str, float]] = []
    seconds, at = 0.0, 20.0
    for leg in legs:
        if isinstance(leg, tuple):
            steps.append({"ramp": leg[0] + 273.15, "rate": leg[1] / 60.0})
            seconds, at = seconds + abs(leg[0] - at) / leg[1] * 60.0, leg[0]
        else:
            steps.append({"hold": leg})
            seconds += leg
    return TemperatureProfile.model_validate({"start": 293.15, "steps": steps}).at(0, round(seconds), 1.0)


def cycle(name: str, seed: int) -> Cycle:
    """Return one cycle: with noise for the record, without for the truth."""
    temperature = chamber(PROGRAMMES[name])
    rate, surroundings = np.full(temperature.size, EARTH), Surroundings(temperature=temperature)
    stage = FOG.start(1.0, seed, "fog")
    reading = stage.process_in(rate, surroundings)
    clean = FOG.model_copy(update={"noise": False}).start(1.0, 0, "fog").process_in(rate, surroundings)
    return Cycle(Record(reading, stage.temperature, 1.0), clean - EARTH, reading - clean)


def judge(model: DriftModel, unseen: Cycle) -> tuple[float, float]:
    """Return by what the drift shrinks, and the 100 s block std over the oracle's (true drift subtracted)."""
    out = model.apply(unseen.record)
    before, after = block_means(unseen.drift, 100), block_means(unseen.drift - out.drift, 100)
    return before.std() / after.std(), block_means(out.rate, 100).std() / block_means(unseen.noise, 100).std()


def compare(seeds: range) -> DriftModel:
    """Print the table over methods and return the last seed's `gradient` model of two cycles."""
    print(
        f"drift reduction and 100 s block std over the oracle's, {len(seeds)} seeds x {len(PROGRAMMES)} unseen cycles"
    )
    print(f"{'model':>18}{'cycles':>8}{'reduction: median':>20}{'least':>8}{'to oracle: median':>20}{'worst':>8}")
    found: dict[tuple[str, int], list[tuple[float, float]]] = {}
    kept = None
    for seed in seeds:
        known = [cycle(name, 100 * seed + k).record for k, name in enumerate(list(PROGRAMMES)[:2])]
        unseen = [cycle(name, 100 * seed + 50 + k) for k, name in enumerate(PROGRAMMES)]
        for label, (method, features) in MODELS.items():
            if method == "lssvm" and seed != seeds[0]:
                continue  # twenty times the cost of the others
            for n in (1, 2):
                model = train(known[:n], method=method, features=features, seed=seed)
                found.setdefault((label, n), []).extend(judge(model, each) for each in unseen)
                kept = model if (label, n) == ("gradient", 2) else kept
    for (label, n), pairs in found.items():
        reduction, ratio = np.array(pairs).T
        print(
            f"{label:>18}{n:>8}{np.median(reduction):>20.1f}{reduction.min():>8.1f}{np.median(ratio):>20.2f}{ratio.max():>8.2f}"
        )
    assert kept is not None
    return kept


def noise_and_gain(model: DriftModel, seeds: range) -> None:
    """Print what compensation does to N and B of an unseen cycle, and to a true rate."""
    changes = []
    for seed in seeds:
        unseen = cycle("slower, holds", 100 * seed + 60).record
        fits = [fit_allan(allan_deviation(r, 1.0).between(1.0, 300.0)) for r in (unseen.rate, model.apply(unseen).rate)]
        before, after = ([f.angle_random_walk.value, f.bias_instability.value] for f in fits)
        changes.append(100.0 * (np.array(after) / np.array(before) - 1.0))
    worst = np.abs(changes).max(axis=0)
    print(f"fitted N and B (tau to 300 s) change by at most {worst[0]:.2f} % and {worst[1]:.2f} %")
    base, t = model.apply(unseen).rate, np.arange(unseen.rate.size)
    for period in PERIODS:
        rate = 0.05 * DEG_H * np.sin(2.0 * np.pi * t / period)
        moved = model.apply(Record(unseen.rate + rate, unseen.temperature, 1.0)).rate
        print(f"gain of an injected rate of period {period:7.0f} s: {(moved - base) @ rate / (rate @ rate):.6f}")


def searches(seed: int) -> None:
    """Print what each search asks for the LSSVM's parameters, 284 rows of one cycle, blocked error and training error."""
    rows = gather([cycle("up-first", 100 * seed).record], Features(), block=7200.0, most=300)
    bounds = ((10.0, 1e5), (1e-6, 1e6))

    def blocked(p: np.ndarray) -> float:
        return float(np.sqrt(np.mean(block_residuals(rows.Z, rows.y, p[0], p[1], rows.folds) ** 2)) / DEG_H)

    def training(p: np.ndarray) -> float:
        return float(np.sqrt(np.mean((Lssvm.fit(rows.Z, rows.y, p[0], p[1]).weights / p[0]) ** 2)) / DEG_H)

    for fitness, label in ((blocked, "blocked"), (training, "training")):
        for search, log in ((grey_wolf, True), (grey_wolf, False), (evolve, True)):
            best = search(fitness, bounds, seed=seed, log=log)
            scale = "log" if log else "linear"
            print(
                f"{search.__name__:>10}, {scale:>6}, {label:>8} error {best.value:.2e} deg/h "
                f"(gamma {best.point[0]:.2g}, sigma^2 {best.point[1]:.2g}), {best.evaluations} evaluations"
            )


def main() -> None:
    """Print all."""
    seeds = range(1, 1 + int(sys.argv[1] if len(sys.argv) > 1 else 6))
    model = compare(seeds)
    noise_and_gain(model, seeds)
    searches(seeds[0])


if __name__ == "__main__":
    main()
