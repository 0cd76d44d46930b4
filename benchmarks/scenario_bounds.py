"""The upper bounds of a scenario's expectations by their rule: what 20 other seeds scatter to, and a fifth to spare.

    python benchmarks/scenario_bounds.py SCENARIO.yaml [SEEDS]

A bound is (mean + k s) / 0.8 over seeds 1 to 20, rounded up to two digits: mean + k s is the one-sided tolerance limit
that 999 of 1000 seeds keep, with a confidence of 95 % (normal; k = 4.3 for 20), and `tests/test_scenarios.py` asks for
a fifth of margin. Prints both beside what the file has.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path

import numpy as np
from scipy.stats import nct, norm

sys.path.insert(0, str(Path(__file__).parents[1]))

import testbed

MARGIN, SHARE, CONFIDENCE = 0.8, 0.999, 0.95


def tolerance(n: int) -> float:
    """Return k of the one-sided tolerance limit of n normal values (Hahn, Meeker, Statistical Intervals, 1991)."""
    return float(nct.ppf(CONFIDENCE, n - 1, norm.ppf(SHARE) * math.sqrt(n)) / math.sqrt(n))


def rounded_up(value: float, digits: int = 2) -> float:
    """Return the least number of so many digits that is not below `value`."""
    unit = 10.0 ** (math.floor(math.log10(value)) - digits + 1)
    return math.ceil(value / unit - 1e-9) * unit


def main() -> None:
    """Print one row for each upper bound."""
    path, seeds = sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 20
    scenario = testbed.load_scenario(path)
    rows = [testbed.run(scenario, seed=seed).metrics["expectations"] for seed in range(1, seeds + 1)]
    print(f"{Path(path).stem}, {seeds} seeds")
    for k, bound in enumerate(scenario.expect):
        if not bound.relation.startswith("<"):
            continue
        values = np.array([row[k]["value"] for row in rows])
        derived = rounded_up((values.mean() + tolerance(seeds) * values.std(ddof=1)) / MARGIN)
        row = rows[0][k]
        spread = f"mean {values.mean():.5f} s {values.std(ddof=1):.5f} most {values.max():.5f}"
        print(f"{row['subject']} {row['metric']} {row['bound']}: {spread}: {derived:.2g}")


if __name__ == "__main__":
    main()
