"""Time to change a scenario: `with_` validates the whole, `with_seed` the seed alone; promise: at most 15 us.

Run: python benchmarks/bench_scenario.py
"""

from __future__ import annotations

import statistics
import time
from pathlib import Path
from typing import TYPE_CHECKING

from promises import Promise, conclude

import testbed

if TYPE_CHECKING:
    from collections.abc import Callable

MIXED = Path(__file__).parents[1] / "scenarios" / "mixed_0p5hz_10hz.yaml"


def median(action: Callable[[int], object], repeats: int) -> float:
    """Return the median CPU time of an action [s]."""
    times = []
    for k in range(repeats):
        begin = time.process_time()
        action(k)
        times.append(time.process_time() - begin)
    return statistics.median(times)


def main() -> None:
    scenario = testbed.load_scenario(MIXED)
    whole = median(lambda k: scenario.with_(duration=f"{20 + k} s"), 31)
    seed = median(scenario.with_seed, 10_001)
    print(f"with_ {1e3 * whole:.1f} ms: {whole / seed:.0f} times as long")
    conclude(Promise("Scenario.with_seed [us]", 15.0, 1e6 * seed))


if __name__ == "__main__":
    main()
