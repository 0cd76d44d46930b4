"""What seeds could share of `wideband`, which goes seed by seed.

Printed: a step with and without states for slow noise; the part of it that no seed can share, which weighs the filters
by their innovations and mixes them; and of the bank's sixteen filters those whose covariance is the same, bit for bit,
under eight seeds, over the last two of three seconds. A filter slower than the best one starts again from it, at
readings that each seed has for itself, and from then on has a covariance of its own. What sharing can give at the most
follows: the step over what is left of it for each seed. Promised: all share at rest, nearly half of them on jitter.
Run:
python benchmarks/bench_wideband_lanes.py
"""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numba import njit
from promises import Promise, conclude

import testbed
from testbed.campaigns.many import ManySensors
from testbed.chain.pipeline import block_lengths
from testbed.chain.truth import Truth
from testbed.fusion.belief import default_belief
from testbed.fusion.filters.wideband import Wideband, WidebandParameters
from testbed.fusion.kernels.bank import admit, log_likelihood, start_again, weigh
from testbed.fusion.kernels.covariance import JOSEPH

if TYPE_CHECKING:
    from collections.abc import Callable

    from testbed.signals import FloatArray

SCENARIOS = Path(__file__).parents[1] / "scenarios"
RATES = {"mhd_ars": 20_000.0, "mems_gyro": 2_000.0}
N_TIME, FILTERS, SEEDS, LOOK = 20_000, 16, range(1, 9), 200


def us(task: Callable[[], object]) -> float:
    """Return the least CPU time of nine runs of N_TIME steps [us a step]."""
    task()
    times = []
    for _ in range(9):
        begin = time.process_time()
        task()
        times.append(time.process_time() - begin)
    return 1e6 * min(times) / N_TIME


def step_us(coloured: bool) -> float:
    """Return what a step takes, readings of white noise; print it."""
    stage = Wideband(default_belief(), RATES, WidebandParameters(coloured=coloured))
    rng = np.random.default_rng(1)
    readings = {name: 1e-4 * rng.standard_normal(round(N_TIME * rate / 2e4)) for name, rate in RATES.items()}
    found = us(lambda: stage.process(readings))
    print(f"{len(stage.model.F)} states: {found:.2f} us a step")
    return found


@njit(error_model="numpy")  # type: ignore[untyped-decorator]
def mix(x: Any, P: Any, score: Any, weight: Any, innovations: Any, spread: Any, out: Any) -> None:  # pragma: no cover
    """Do of each step of the bank what its filters have in common: gate, likelihoods, weights, estimate and claim."""
    M, watch, slower = np.int64(FILTERS), np.zeros(2), np.empty(FILTERS)
    for k in range(out.shape[1]):
        for m in range(M):
            score[m] *= 0.999
        for _ in range(2 if k % 10 == 0 else 1):
            e = innovations[k % len(innovations)]
            mean, variance = 0.0, 1e-10
            for m in range(M):
                mean += weight[m] * e[m]
            for m in range(M):
                variance += weight[m] * (spread[m] + (e[m] - mean) ** 2)
            if admit(watch, abs(mean) / np.sqrt(variance), 10.0, 10):
                for m in range(M):
                    score[m] += log_likelihood(e[m], spread[m] + 1e-10, 10.0)
        weigh(score, weight, M)
        start_again(x, P, score, 1e9, slower, x.shape[0], M, JOSEPH)
        rate, variance = 0.0, 0.0
        for m in range(M):
            rate += weight[m] * x[0, m]
        for m in range(M):
            variance += weight[m] * (P[0, 0, m] + (x[0, m] - rate) ** 2)
        out[0, k], out[1, k] = rate, np.sqrt(variance)


def mix_us() -> float:
    """Return what weighing and mixing take in a step; print it."""
    rng, M = np.random.default_rng(1), FILTERS
    innovations = 1e-5 * rng.standard_normal((256, M))
    given = (np.zeros((7, M)), np.ones((7, 7, M)), np.zeros(M), np.full(M, 1.0 / M), innovations, np.full(M, 1e-10))
    found = us(lambda: mix(*given, np.empty((2, N_TIME))))
    print(f"weighing and mixing: {found:.2f} us a step")
    return found


def _between(values: FloatArray, begin: int, rate_hz: float) -> FloatArray:
    """Return the readings of LOOK base samples from `begin` on."""
    first, last = (round(at * rate_hz / 2e4) for at in (begin, begin + LOOK))
    return values[first:last]


def sharing(name: str) -> float:
    """Return how many of the filters have one covariance under all seeds; print it."""
    changes = {"turntable.engine": "modal", "duration": "3 s", "settle": "0 s", "expect": None}
    scenario = testbed.load_scenario(SCENARIOS / f"{name}.yaml").with_(**changes)
    truth, seeds = Truth(scenario.with_seed(SEEDS[0])), list(SEEDS)
    many = {sensor: ManySensors(scenario, sensor, seeds) for sensor in scenario.sensors}
    rates = {sensor: part.sample_rate for sensor, part in scenario.sensors.items()}
    filters = [Wideband(default_belief(), rates, WidebandParameters(start="rest")) for _ in seeds]
    lower, counts = np.tril_indices(len(filters[0].model.F)), []
    for n_time in block_lengths(scenario):
        _, block = truth.process(n_time)
        for sensor in many.values():
            sensor.take(block)
        readings = {sensor: one.readings(seeds) for sensor, one in many.items()}
        for begin in range(0, n_time, LOOK):
            for j, one in enumerate(filters):
                part = {sensor: _between(readings[sensor][j], begin, rate) for sensor, rate in rates.items()}
                one.process(part)
            P = np.stack([one._P[lower] for one in filters])
            counts.append(int((P[0] == P).all(axis=(0, 1)).sum()))
    found = float(np.mean(counts[len(counts) // 3 :]))
    print(f"{name}: {found:.1f} of {FILTERS} filters have one covariance under {len(seeds)} seeds")
    return found


def main() -> None:
    """Print the parts and the promises."""
    _, step = step_us(coloured=False), step_us(coloured=True)
    mixing = mix_us()
    shared = {name: sharing(name) for name in ("static", "mixed_0p5hz_10hz", "wideband_jitter")}
    for name, count in shared.items():
        left = mixing + (1.0 - count / FILTERS) * (step - mixing)
        print(f"{name}: sharing leaves {left:.2f} of {step:.2f} us, so it gives at most {step / left:.1f} times")
    conclude(
        Promise("wideband: weighing and mixing, which no seed shares [us]", 0.3, mixing),
        Promise("wideband: filters that share a covariance, at rest", 16.0, shared["static"], at_most=False),
        Promise("wideband: filters that share a covariance, on jitter", 7.5, shared["wideband_jitter"], at_most=False),
    )


if __name__ == "__main__":
    main()
