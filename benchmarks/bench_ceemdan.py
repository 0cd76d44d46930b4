"""CEEMDAN of a day at 1 Hz (85,200 samples, 100 trials): time, memory, and how much faster than EMD-signal in its
ten-sift mode.

Promise: at most 15 s on two cores and 500 MB, at least 12 times faster than EMD-signal on the same cores. The peer
takes shorter records (each with our time beside it) and is extrapolated by the straight line through the last two: its
cost per call does not grow with the samples. That favours the peer a little, as a longer record has more modes. Where
the cores are shared, believe the processor time. Run: python benchmarks/bench_ceemdan.py [samples of the peer's
records, at least two ...]
"""

from __future__ import annotations

import resource
import sys
import time
import warnings

import numpy as np
from promises import Promise, conclude

from testbed.compensation.ceemdan import ceemdan
from testbed.signals import FloatArray, random_stream

N_DAY, TRIALS, CORES = 85_200, 100, 2


def record(n_time: int) -> FloatArray:
    """Return white noise on a random walk that passes it at 100 s: modes of every period."""
    rng = random_stream(1, "bench_ceemdan")
    value: FloatArray = rng.standard_normal(n_time) + 0.1 * np.cumsum(rng.standard_normal(n_time))
    return value


def processor_time() -> float:
    """Return the processor time of this process and its finished children [s]."""
    return sum(
        resource.getrusage(who).ru_utime + resource.getrusage(who).ru_stime
        for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    )


def timed(label: str, function, *args, **kwargs) -> tuple[float, float, FloatArray]:
    """Return wall clock [s], processor time [s] and modes; print them."""
    wall, cpu = time.perf_counter(), processor_time()
    modes = function(*args, **kwargs)
    wall, cpu = time.perf_counter() - wall, processor_time() - cpu
    print(
        f"{label:<44}{modes.shape[1]:>8} samples {wall:8.2f} s {cpu:8.2f} s CPU {modes.shape[0] - 1:4d} modes",
        flush=True,
    )
    return wall, cpu, modes


def peer(signal: FloatArray) -> FloatArray:
    """Decompose with EMD-signal: ten sifts, the same noise, two processes."""
    from PyEMD import CEEMDAN, EMD

    engine = CEEMDAN(trials=TRIALS, epsilon=0.2, ext_EMD=EMD(FIXE=10), parallel=True, processes=CORES, seed=1)
    modes: FloatArray = engine.ceemdan(signal)
    return modes


def main(lengths: list[int]) -> None:
    warnings.simplefilter("ignore")  # the peer forks
    ceemdan(record(512), trials=2, threads=1)  # compiles
    wall, cpu, _ = timed("ours, improved", ceemdan, record(N_DAY), trials=TRIALS, threads=CORES)
    megabytes = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    timed("ours, classic", ceemdan, record(N_DAY), variant="classic", trials=TRIALS, threads=CORES)
    print(f"{wall:.1f} s by the clock, {cpu / CORES:.1f} s if both cores were ours alone")
    found = []
    for n_time in lengths:
        ours = timed("ours", ceemdan, record(n_time), trials=TRIALS, threads=CORES)
        theirs = timed("EMD-signal, FIXE=10, two processes", peer, record(n_time))
        print(f"ratio: {theirs[0] / ours[0]:.0f} by the clock, {theirs[1] / ours[1]:.0f} in processor time", flush=True)
        found.append(theirs)
    (n, m), (short, long) = lengths[-2:], found[-2:]
    day_wall, day_cpu = (long[k] + (long[k] - short[k]) * (N_DAY - m) / (m - n) for k in (0, 1))
    print(f"EMD-signal extrapolated to {N_DAY} samples: {day_wall:.0f} s, {day_cpu:.0f} s CPU")
    print(f"that is {day_wall / wall:.0f} times ours by the clock")
    conclude(
        Promise("CEEMDAN of a day on two cores, in processor time [s]", 15.0, cpu / CORES),
        Promise("memory of CEEMDAN of a day [MB]", 500.0, megabytes),
        Promise("faster than EMD-signal, in processor time [-]", 12.0, day_cpu / cpu, at_most=False),
    )


if __name__ == "__main__":
    main([int(text) for text in sys.argv[1:]] or [4096, 12_288])
