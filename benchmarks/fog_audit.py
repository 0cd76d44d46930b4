"""What a fibre-optic gyro's compensation can promise, and how often the audit is wrong: figures of docs/audit.md and
docs/fog.md.

Cycles of `fog_paper3` at 0.1 Hz: means over 100 s, which are judged, have the same noise as at 1 Hz. Trained on two
cycles, judged on the paper's programme and its mirror image under other noise. Beside each median reduction stands its
95 % interval, of the seeds drawn again: where coefficients scatter, one draw of them decides a cycle. 30 without
scatter, 5.9 and 4.1 with 10 and 20 % were reported.

Run it with ``OMP_NUM_THREADS=1 python benchmarks/fog_audit.py [SEEDS]`` (default 10).
"""

from __future__ import annotations

import sys
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.stats import beta

from testbed.compensation.model_only import train
from testbed.drift.findings import MOST_ORACLE_RATIO
from testbed.drift.injection import heat_rate
from testbed.drift.quality import block_std
from testbed.models.temperature import TemperatureProfile
from testbed.reproduce import paper3
from testbed.sensors import load_preset
from testbed.units import DEG_H

if TYPE_CHECKING:
    from testbed.compensation.model_only import DriftModel
    from testbed.drift.records import ThermalRecord
    from testbed.sensors.fog import Fog
    from testbed.signals import FloatArray

FS = 0.1
FOG: Fog = load_preset("fog_paper3")
TRAINING = {"paper and mirror": ("paper", "down first"), "two rates": ("two rates, up", "two rates, down")}
UNSEEN = ("paper", "down first")


def gyro(*, scatter: float = 0.0, step: float = 0.0625, noise: bool = True) -> Fog:
    """Return the preset with other coefficients' scatter, count of the thermometer [K], or without noise."""
    thermal = FOG.thermal.model_copy(update={"scatter": scatter})
    thermometer = FOG.thermometer.model_copy(update={"step": step})
    return FOG.model_copy(update={"thermal": thermal, "thermometer": thermometer, "noise": noise})


def trained(training: str, seed: int, fog: Fog, method: str = "gradient", rate: float = 0.0) -> DriftModel:
    """Return a model of two cycles whose true rate follows the temperature with this std [rad/s]."""
    cycles = [paper3.cycle(name, 1000 * seed + k, FS, fog).record for k, name in enumerate(TRAINING[training])]
    if rate:
        cycles = [replace(one, rate=one.rate + heat_rate(one.temperature, rate)) for one in cycles]
    return train(cycles, method=method, seed=seed)


def unseen(seed: int, fog: Fog) -> list[ThermalRecord]:
    """Return the cycles to judge on."""
    return [paper3.cycle(name, 1000 * seed + 500 + k, FS, fog) for k, name in enumerate(UNSEEN)]


def judged(model: DriftModel, cycle: ThermalRecord) -> tuple[float, float]:
    """Return by what the drift shrinks, and the 100 s block std over that with the true drift removed."""
    out = model.apply(cycle.record)
    oracle = block_std(cycle.record.rate - cycle.drift, FS)
    return block_std(cycle.drift, FS) / block_std(cycle.drift - out.drift, FS), block_std(out.rate, FS) / oracle


def interval(reduction: FloatArray) -> FloatArray:
    """Return the 95 % interval of the median, shape (2,), by the bootstrap over seeds, each of which has a row."""
    drawn = np.random.default_rng(1).integers(len(reduction), size=(4000, len(reduction)))
    medians = np.median(reduction[drawn].reshape(len(drawn), -1), axis=1)
    limits: FloatArray = np.percentile(medians, [2.5, 97.5])
    return limits


def line(label: str, pairs: list[tuple[float, float]], reported: float | None = None) -> None:
    """Print reductions and ratios, and the share that the audit refuses with its 95 % interval."""
    reduction, ratio = np.array(pairs).T
    n, k = ratio.size, int((ratio > MOST_ORACLE_RATIO).sum())
    low = beta.ppf(0.025, k, n - k + 1) if k else 0.0
    high = beta.ppf(0.975, k + 1, n - k) if k < n else 1.0
    of_median = "{:.1f}-{:.1f}".format(*interval(reduction.reshape(-1, len(UNSEEN))))
    print(
        f"{label:>52}{np.median(reduction):>8.1f}{of_median:>10}{reported or '':>9}{reduction.min():>7.1f}"
        f"{ratio.min():>7.2f}{np.median(ratio):>7.2f}{ratio.max():>7.2f}{k:>6d} of {n:<4d}{low:>7.1%} to {high:.1%}",
        flush=True,
    )


def head(title: str) -> None:
    """Print the head of a table."""
    print(f"\n{title}\n{'reduction':>85}{'to oracle':>17}{'refused':>14}")
    print(f"{'':>52}  median      95 % reported  least  least median  worst")


def honest(seeds: range) -> None:
    """Print what honest models reach: two kinds of training, coefficients that scatter, whole degrees, no noise."""
    head("honest models")
    for training in TRAINING:
        for label, fog, known, reported in (
            ("", gyro(), None, None),
            (", trained without noise", gyro(), gyro(noise=False), 30.0),
            (", coefficients scatter by 10 %", gyro(scatter=0.1), None, 5.9),
            (", by 20 %", gyro(scatter=0.2), None, 4.1),
            (", thermometer in whole degrees", gyro(step=1.0), None, None),
        ):
            pairs = [
                judged(trained(training, seed, known or fog), cycle) for seed in seeds for cycle in unseen(seed, fog)
            ]
            line(f"{training}{label}", pairs, reported)


def learned(seeds: range) -> None:
    """Print what becomes of models that were trained while the true rate followed the temperature."""
    head("models trained while the true rate followed temperature, deg/h rms")
    for training in TRAINING:
        for rate in (0.02, 0.03, 0.04, 0.06, 0.1):
            pairs = []
            for seed in seeds:
                model = trained(training, seed, gyro(), rate=rate * DEG_H)
                pairs += [judged(model, cycle) for cycle in unseen(seed, gyro())]
            line(f"{training}, {rate:g}", pairs)


def starts(seeds: range) -> None:
    """Print the error over the first four hours of cycles that start at another temperature than 20 degC."""
    print("\ntwo rates, gradient: start of the unseen cycle, error of the first 4 h and of all [deg/h], reduction")
    models = {seed: trained("two rates", seed, gyro()) for seed in seeds}
    for start in (-20.0, 0.0, 10.0, 20.0, 30.0, 40.0, 60.0):
        errors = []
        for seed, model in models.items():
            cycle = started(start, seed)
            left = model.apply(cycle.record).drift - cycle.drift
            first = left[: round(4 * 3600 * FS)]
            errors.append((np.abs(first - left.mean()).mean(), left.std(), cycle.drift.std() / left.std()))
        first, whole, reduction = np.median(errors, axis=0)
        print(f"{start:>8.0f} degC{first / DEG_H:>10.4f}{whole / DEG_H:>10.4f}{reduction:>8.1f}", flush=True)


def started(start: float, seed: int) -> ThermalRecord:
    """Return a cycle from a start [degC], where the gyro has rested: 2 h, then to 60 and to -30 degC at 0.1 K/min."""
    steps = [{"hold": "2 h"}, *({"ramp": f"{to} degC", "rate": "0.1 K/min"} for to in (60, -30) if to != start)]
    duration = 7200.0 + 600.0 * (abs(60.0 - start) + 90.0)
    profile = TemperatureProfile.model_validate({"start": f"{start} degC", "steps": steps}, context={"border": True})
    return paper3.through(profile, round(duration * FS), 7000 + seed, FS)


def main(seeds: range) -> None:
    """Print all tables."""
    honest(seeds)
    learned(seeds)
    starts(seeds)


if __name__ == "__main__":
    main(range(1, 1 + int(sys.argv[1]) if len(sys.argv) > 1 else 11))
