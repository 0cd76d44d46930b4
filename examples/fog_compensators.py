"""Drift compensation of a fibre-optic gyro on thermal cycles that its model has not seen: the figures of
docs/compensation_models.md.

Simulated `fog_paper3` at 1 Hz on a fixed base, Earth rate 10.6 deg/h. Trained on the paper's programme, on it and its
mirror image, or on programmes of our own; judged on four others: the paper's two and two with other rates, holds and
turning points, all under new noise. Then the same where the instrument's lags and hysteresis are not those that the
features have.

Run it with ``OMP_NUM_THREADS=1 python examples/fog_compensators.py`` for one seed; ``--full`` prints the tables of the
page, six seeds and the searches for the LSSVM's parameters (about 40 s of processor time).
"""

from __future__ import annotations

import argparse
import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from testbed.allan import allan_deviation, fit_allan
from testbed.compensation.features import Features
from testbed.compensation.lssvm import Lssvm, kernel_residuals
from testbed.compensation.model_only import DriftModel, train
from testbed.compensation.record import GyroRecord
from testbed.compensation.search import evolve, grey_wolf
from testbed.compensation.training import block_means, gather
from testbed.drift.leak import find_leaks
from testbed.models.temperature import TemperatureProfile
from testbed.sensors import load_preset
from testbed.sensors.stages import Surroundings
from testbed.units import DEG_H

if TYPE_CHECKING:
    from testbed.sensors.fog import Fog

EARTH = 10.6 * DEG_H
FOG = load_preset("fog_paper3").model_copy(update={"sample_rate": 1.0})
# Holds [s] and ramps (to degC, K/min) from 20 degC.
PROGRAMMES: dict[str, list[float | tuple[float, float]]] = {
    "up-first": [7200.0, (60.0, 0.1), (-30.0, 0.1)],
    "down-first": [7200.0, (-30.0, 0.1), (60.0, 0.1)],
    "slower, holds": [3600.0, (55.0, 0.08), 5400.0, (-25.0, 0.09), 5400.0],
    "down, other turns": [5400.0, (-25.0, 0.1), 3600.0, (50.0, 0.09), (20.0, 0.1)],
    "there and back": [7200.0, (60.0, 0.15), (-30.0, 0.1), (20.0, 0.15)],
    "back and there": [7200.0, (-30.0, 0.15), (60.0, 0.1), (20.0, 0.15)],
}
UNSEEN = tuple(PROGRAMMES)[:4]
# What a model is trained on, by name and number of cycles.
TRAINING = {
    "paper, 1": ("up-first",),
    "paper, 2": ("up-first", "down-first"),
    "two rates, 1": ("there and back",),
    "two rates, 2": ("there and back", "back and there"),
    "paper, 2 + two rates, 1": ("up-first", "down-first", "there and back"),
}
PAPER = ("paper, 1", "paper, 2")
# Name: method, features unless the method's own, training.
MODELS: dict[str, tuple[str, Features | None, tuple[str, ...]]] = {
    "gradient": ("gradient", None, tuple(TRAINING)),
    "process": ("process", None, tuple(TRAINING)),
    "polynomial": ("polynomial", None, PAPER),
    "gradient, plays": ("gradient", Features(plays=(3.0, 10.0)), PAPER),
    "lssvm": ("lssvm", None, PAPER),
    "lssvm, T alone": ("lssvm", Features(degree=1, slopes=False, lags=()), PAPER[1:]),
}
# Lags of coil, spool and core [s], half widths [K], lag of the thermometer [s], factor on hysteresis and gradient. The
# features have lags of 900, 1500 and 2400 s, which are those of the preset, and plays of 3 and 10 K.
TRUTHS = {
    "as the features": ((900.0, 1500.0, 2400.0), (4.0, 12.0), 900.0, 1.0),
    "spread wider": ((700.0, 1300.0, 3000.0), (3.0, 8.0), 700.0, 1.0),
    "slower": ((1200.0, 2200.0, 3600.0), (6.0, 15.0), 1000.0, 1.0),
    "faster, twice as strong": ((600.0, 1000.0, 1800.0), (2.0, 6.0), 900.0, 2.0),
}
PERIODS = (10.0, 60.0, 600.0, 3600.0, 21_600.0)


@dataclass(frozen=True)
class Cycle:
    """A record with its true drift and noise [rad/s]; drift is all that temperature does, scale factor included."""

    record: GyroRecord
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


def cycle(name: str, seed: int, fog: Fog = FOG) -> Cycle:
    """Return one cycle: with noise for the record, without for the truth."""
    temperature = chamber(PROGRAMMES[name])
    rate, surroundings = np.full(temperature.size, EARTH), Surroundings(temperature=temperature)
    stage = fog.start(1.0, seed, "fog")
    reading = stage.process_in(rate, surroundings)
    # With its seed: coefficients that scatter are those of the cycle.
    clean = fog.model_copy(update={"noise": False}).start(1.0, seed, "fog").process_in(rate, surroundings)
    return Cycle(GyroRecord(reading, stage.temperature, 1.0), clean - EARTH, reading - clean)


def other(truth: str) -> Fog:
    """Return the gyro with other lags and hysteresis."""
    lags, widths, thermometer, factor = TRUTHS[truth]
    heat, names = FOG.thermal, ("coil_lag", "spool_lag", "core_lag")
    change = {"half_width": widths, "gradient": factor * heat.gradient, **dict(zip(names, lags, strict=True))}
    change["hysteresis"] = tuple(factor * h for h in heat.hysteresis)
    place = FOG.thermometer.model_copy(update={"lag": thermometer})
    return FOG.model_copy(update={"thermal": heat.model_copy(update=change), "thermometer": place})


def judge(model: DriftModel, unseen: Cycle) -> tuple[float, float]:
    """Return by what the drift shrinks, and the 100 s block std over the oracle's (true drift subtracted)."""
    out = model.apply(unseen.record)
    before, after = block_means(unseen.drift, 100), block_means(unseen.drift - out.drift, 100)
    return before.std() / after.std(), block_means(out.rate, 100).std() / block_means(unseen.noise, 100).std()


def cycles(seed: int, fog: Fog = FOG) -> tuple[dict[str, Cycle], list[Cycle]]:
    """Return the cycles to train on and those to judge on."""
    known = {name: cycle(name, 100 * seed + k, fog) for k, name in enumerate(PROGRAMMES)}
    return known, [cycle(name, 100 * seed + 50 + k, fog) for k, name in enumerate(UNSEEN)]


def head(what: str) -> None:
    """Print the head of a table."""
    print(f"\n{what:>33}{'trained on':>25}{'reduction: median':>20}{'least':>8}{'to oracle: median':>20}{'worst':>8}")


def row(label: str, training: str, pairs: list[tuple[float, float]]) -> None:
    """Print a row of a table."""
    reduction, ratio = np.array(pairs).T
    print(
        f"{label:>33}{training:>25}{np.median(reduction):>20.1f}{reduction.min():>8.1f}{np.median(ratio):>20.2f}{ratio.max():>8.2f}",
        flush=True,
    )


def compare(seeds: range) -> None:
    """Print the table over methods and training programmes."""
    print(f"drift reduction and 100 s block std over the oracle's, {len(seeds)} seeds x {len(UNSEEN)} unseen cycles")
    data = [(seed, *cycles(seed)) for seed in seeds]
    head("model")
    for label, (method, features, trainings) in MODELS.items():
        for training in trainings:
            pairs = []
            for seed, known, unseen in data:
                records = [known[name].record for name in TRAINING[training]]
                model = train(records, method=method, features=features, seed=seed)
                pairs += [judge(model, each) for each in unseen]
            row(label, training, pairs)


def other_truths(seeds: range) -> None:
    """Print what it costs that an instrument has other lags than the features, and what a record without noise would
    give.
    """
    head("instrument, method")
    for truth in TRUTHS:
        data = [cycles(seed, other(truth)) for seed in seeds]
        for method, training in itertools.product(("gradient", "process"), ("paper, 2", "two rates, 2")):
            names, pairs = TRAINING[training], []
            for known, unseen in data:
                model = train([known[name].record for name in names], method=method)
                pairs += [judge(model, each) for each in unseen]
            row(f"{truth}, {method}", training, pairs)
        known, unseen = data[0]
        quiet = [GyroRecord(EARTH + known[n].drift, known[n].record.temperature, 1.0) for n in TRAINING["paper, 2"]]
        model = train(quiet, method="gradient")
        row(f"{truth}, gradient", "paper, 2, no noise", [judge(model, each) for each in unseen])


def audited(model: DriftModel, seed: int) -> None:
    """Print what the audit says of a model on an unseen cycle."""
    unseen = cycle("slower, holds", 100 * seed + 60)

    def compensate(record: GyroRecord) -> np.ndarray:
        return model.apply(record).rate

    found = find_leaks(compensate, unseen.record, compensate(unseen.record), unseen.drift)
    print(f"{model.method}, audit: {'; '.join(found.leaks) or 'no leak found'}")


def noise_and_gain(model: DriftModel, seeds: range) -> None:
    """Print, for a model of two cycles, what compensation does to N and B of an unseen cycle, and to a true rate."""
    changes = []
    for seed in seeds:
        unseen = cycle("slower, holds", 100 * seed + 60).record
        fits = [fit_allan(allan_deviation(r, 1.0).between(1.0, 300.0)) for r in (unseen.rate, model.apply(unseen).rate)]
        before, after = ([f.angle_random_walk.value, f.bias_instability.value] for f in fits)
        changes.append(100.0 * (np.array(after) / np.array(before) - 1.0))
    worst = np.abs(changes).max(axis=0)
    print(f"\n{model.method}: fitted N and B (tau to 300 s) change by at most {worst[0]:.2f} % and {worst[1]:.2f} %")
    base, t = model.apply(unseen).rate, np.arange(unseen.rate.size)
    for period in PERIODS:
        rate = 0.05 * DEG_H * np.sin(2.0 * np.pi * t / period)
        moved = model.apply(GyroRecord(unseen.rate + rate, unseen.temperature, 1.0)).rate
        print(f"gain of an injected rate of period {period:7.0f} s: {(moved - base) @ rate / (rate @ rate):.6f}")


def searches(seed: int) -> None:
    """Print what each search asks for the LSSVM's parameters, 284 rows of a cycle, blocked error and training error."""
    rows = gather([cycle("up-first", 100 * seed).record], Features(), block=7200.0, most=300)
    bounds = ((10.0, 1e5), (1e-6, 1e6))

    def blocked(p: np.ndarray) -> float:
        return float(np.sqrt(np.mean(kernel_residuals(rows.Z, rows.y, p[0], p[1], rows.folds) ** 2)) / DEG_H)

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
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--full", action="store_true", help="six seeds, and the searches")
    full = parser.parse_args().full
    seeds = range(1, 7 if full else 2)
    compare(seeds)
    other_truths(seeds)
    for method in ("gradient", "process"):
        model = train([cycle(name, 100 + k).record for k, name in enumerate(UNSEEN[:2])], method=method)
        noise_and_gain(model, seeds)
        audited(model, seeds[0])
    if full:
        searches(seeds[0])


if __name__ == "__main__":
    main()
