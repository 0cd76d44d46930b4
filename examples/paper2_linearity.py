"""Linearity of paper 2 at one frequency: the deviation of the fused rate over the MHD ARS's own, by how it is measured.

The sensors are linear, so the deviation from the fitted line is noise. The first row is a filter just switched on, the
second one that has run for 300 s but is read for one second (two periods, no window), the third the protocol of
`testbed reproduce paper2`.

Run: ``python examples/paper2_linearity.py [--seeds N]`` (a quarter of a minute of processor time per seed)
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from testbed.reproduce.paper2 import CHANNELS, BenchProtocol, linearity

if TYPE_CHECKING:
    from testbed.signals import FloatArray

PAPER = BenchProtocol(linear_frequencies=(2.0,))
WAYS = {
    "just switched on": replace(PAPER, warm_up=0.0),
    "one second, no window": replace(PAPER, linear_observe=1.0),
    "as the protocol": PAPER,
}


def ratios(seeds: int, protocol: BenchProtocol) -> FloatArray:
    """Return the largest deviation of the fused rate over that of the MHD ARS, shape (n_seed,) [-]."""
    found = np.array([linearity(seed, protocol)[0] for seed in range(1, seeds + 1)])
    return found[:, CHANNELS.index("fused")] / found[:, CHANNELS.index("mhd_ars")]


def main() -> None:
    """Print mean, standard error and how many seeds are better than the MHD ARS alone."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=6)
    seeds = parser.parse_args().seeds
    print(f"2 Hz, fused over MHD ARS, {seeds} seeds")
    for name, protocol in WAYS.items():
        found = ratios(seeds, protocol)
        error = np.std(found, ddof=min(1, seeds - 1)) / np.sqrt(seeds)
        print(
            f"{name:22s} mean {np.mean(found):5.2f} +- {error:.2f}, median {np.median(found):5.2f}, "
            f"below 1 in {np.sum(found < 1.0)}"
        )


if __name__ == "__main__":
    main()
