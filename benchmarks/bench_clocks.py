"""Cost of readings with stamps: clocks without a whole ratio, and a fast clock that jitters, over the regular steps of
the nearest whole ratio; every filter that takes them, whole calls of `process`, interleaved in one process.

Promised: at most 1.3 times the integer path at 20000/2003.704 Hz, 1.7 at 20000/6664 and 2 with a jittering fast clock.
Run:
python benchmarks/bench_clocks.py
"""

import argparse
import statistics
import time

import numpy as np
from promises import Promise, conclude

from testbed.fusion import FILTERS
from testbed.fusion.base import BlockFilter
from testbed.fusion.belief import default_belief
from testbed.parts import resolve
from testbed.signals import FloatArray, random_stream

FAST = 20_000.0
# Rate of the slow sensor, jitter of the fast clock in its periods, the nearest whole ratio, most times its cost.
CASES = [(2003.704, 0.0, 10, 1.3), (6664.0, 0.0, 3, 1.7), (2000.0, 0.2, 10, 2.0)]


def record(slow_hz: float, jitter: float, n: int) -> tuple[dict[str, FloatArray], dict[str, np.ndarray]]:
    """Return white readings of both sensors and their stamps [ns]."""
    rates, random = {"mhd_ars": FAST, "mems_gyro": slow_hz}, random_stream(1, "clocks")
    times = {name: np.arange(np.ceil(n / FAST * rate)) / rate for name, rate in rates.items()}
    times["mhd_ars"] += jitter / FAST * random.uniform(0.0, 1.0, n)
    readings = {name: 1e-3 * random.standard_normal(one.size) for name, one in times.items()}
    return readings, {name: np.rint(1e9 * one).astype(np.int64) for name, one in times.items()}


def seconds(stage: BlockFilter, *given: dict[str, np.ndarray]) -> float:
    """Return the processor time of a filter over a record [s], from where it is."""
    begin = time.process_time()
    stage.process(*given)
    return time.process_time() - begin


def ratio(kind: type[BlockFilter], case: tuple[float, float, int, float], n: int, repeats: int) -> float:
    """Return how many times the time of regular steps it takes: the median of pairs taken one after the other, since a
    machine that others use changes its pace for longer than that. Both filters go on; before the first pair counts,
    their tables are made.
    """
    slow_hz, jitter, stride, _ = case
    readings, stamps = record(slow_hz, jitter, n)
    whole = {"mhd_ars": readings["mhd_ars"], "mems_gyro": record(FAST / stride, 0.0, n)[0]["mems_gyro"]}
    even, timed = (
        kind(default_belief(), {"mhd_ars": FAST, "mems_gyro": rate}, kind.Parameters())
        for rate in (FAST / stride, slow_hz)
    )
    pairs = []
    for turn in range(repeats + 1):
        of_even = seconds(even, whole)
        shifted = {name: one + round(1e9 * turn * n / FAST) for name, one in stamps.items()}
        pairs.append(seconds(timed, readings, shifted) / of_even)
    return statistics.median(pairs[1:])


def main() -> None:
    """Print the ratios of every filter."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=1.0, help="length of the record at 20 kHz")
    parser.add_argument("--repeats", type=int, default=31, help="pairs that are taken")
    given = parser.parse_args()
    n, promises = round(given.seconds * FAST / 60) * 60, []
    for name in FILTERS:
        kind = resolve("filter", name, FILTERS)
        if not kind.any_clock:
            print(f"{name}: refuses clocks without a whole ratio")
            continue
        for case in CASES:
            slow_hz, jitter, stride, most = case
            ratio(kind, case, 600, 1)
            found = ratio(kind, case, n, given.repeats)
            what = f"{name}, {FAST:g}/{slow_hz:g} Hz{', fast clock jitters' if jitter else ''}"
            print(f"{what}: {found:.2f} times regular steps of {FAST:g}/{FAST / stride:g} Hz")
            promises.append(Promise(what, most, found))
    conclude(*promises)


if __name__ == "__main__":
    main()
