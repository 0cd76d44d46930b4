"""What of a decomposition can be relied on: single modes change with the seed of the added noise, groups of modes
hardly do.

A day at 1 Hz: white and flicker noise with the drift of one thermal cycle. Prints entropies and periods of the modes,
then for each way to group them the cuts by seed and how far the sum of a group moves from seed to seed, over its own
size; the same for single modes. Run: python examples/mode_groups.py [trials]
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

import numpy as np

from testbed.compensation.ceemdan import ceemdan
from testbed.compensation.entropy import multiscale_sample_entropy, permutation_entropy
from testbed.compensation.grouping import group_modes, mean_period
from testbed.sensors.noise import GyroNoise
from testbed.units import DEG_H

if TYPE_CHECKING:
    from testbed.signals import FloatArray

SEEDS = range(6)
METHODS = ("period", "sample_entropy", "permutation_entropy")


def record(n_time: int = 85_200) -> FloatArray:
    """Return noise of 7.8e-4 deg/sqrt(h) and 1.5e-2 deg/h with the drift of a cycle 20, 60, -30 C with a lag of 25 min
    [rad/s].
    """
    noise = GyroNoise(angle_random_walk=7.8e-4 * 60.0 * DEG_H, bias_instability=1.5e-2 * DEG_H).sample(n_time, 1.0, 1)
    chamber = np.interp(np.arange(n_time), [0, 7200, 31_200, 85_200], [20.0, 20.0, 60.0, -30.0])
    coil = np.empty(n_time)
    coil[0] = 20.0
    for k in range(1, n_time):
        coil[k] = coil[k - 1] + (chamber[k - 1] - coil[k - 1]) / 1500.0
    drift = 0.1 * ((coil - 20.0) / 40.0) ** 2 + 0.45 * 60.0 * np.gradient(coil)
    value: FloatArray = noise + drift * DEG_H
    return value


def moved(signals: list[FloatArray]) -> float:
    """Return the standard deviation over seeds, over the rms of the mean [-]."""
    table = np.array(signals)
    return float(np.sqrt(np.mean(table.std(axis=0, ddof=1) ** 2) / np.mean(table.mean(axis=0) ** 2)))


def main(trials: int = 20) -> None:
    """Print the tables."""
    signal = record()
    runs = [ceemdan(signal, trials=trials, seed=seed) for seed in SEEDS]
    print("mode  period, s  rms, deg/h  permutation entropy  sample entropy at scale 55   (seed 0)")
    for k, mode in enumerate(runs[0][:-1], 1):
        numbers = np.std(mode) / DEG_H, permutation_entropy(mode), multiscale_sample_entropy(mode, [55])[0]
        print("{:4d} {:10.4g} {:11.4f} {:20.3f} {:27.3f}".format(k, mean_period(mode, 1.0), *numbers))
    print(f"modes by seed: {[len(modes) - 1 for modes in runs]}")
    for method in METHODS:
        groups = [group_modes(modes, 1.0, method=method) for modes in runs]
        print(
            (
                f"{method}: noise ends at {[g.noise.stop for g in groups]}, "
                f"mixed at {[g.mixed.stop for g in groups]}; moves by"
            ),
            end="",
        )
        for name in ("noise", "mixed", "drift"):
            sums = [modes[list(getattr(g, name))].sum(axis=0) for modes, g in zip(runs, groups, strict=True)]
            print(f" {name} {moved(sums):.2f}" if np.any(sums) else f" {name} empty", end="")
        print()
    least = min(len(modes) for modes in runs) - 1
    print("single modes move by " + " ".join(f"{moved([modes[k] for modes in runs]):.2f}" for k in range(least)))


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
