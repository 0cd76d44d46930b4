"""Time of all noise terms together over one `Generator.standard_normal` of the same length; target: at most 10.

Beside it, in the same run, the same terms (white, flicker, random walk) from allantools. Run: python benchmarks/bench_noise.py
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import allantools
import numpy as np

from testbed.sensors.allan import allan_deviation, fit_allan
from testbed.sensors.noise import GyroNoise
from testbed.sensors.noise_terms import _one_over_f, bank_response

if TYPE_CHECKING:
    from collections.abc import Callable

    from testbed.signals import FloatArray

N_TIME = 10_000_000
RATE_HZ = 2000.0
FULL = GyroNoise(
    quantization=1e-6,
    angle_random_walk=4e-5,
    bias_instability=1e-5,
    rate_random_walk=1e-6,
    rate_ramp=1e-8,
    markov_bias=1e-5,
)
THREE = GyroNoise(angle_random_walk=4e-5, bias_instability=1e-5, rate_random_walk=1e-6)


def best(action: Callable[[], object], repeats: int = 3) -> float:
    """Return the shortest time of a few [s]."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        action()
        times.append(time.perf_counter() - start)
    return min(times)


def peer() -> FloatArray:
    white: FloatArray = allantools.noise.white(N_TIME, b0=2 * 4e-5**2, fs=RATE_HZ)
    white += allantools.noise.pink(N_TIME) + allantools.noise.brown(N_TIME, fs=RATE_HZ)
    return white


def main() -> None:
    FULL.sample(1000, RATE_HZ, 1)
    normal = best(lambda: np.random.default_rng(1).standard_normal(N_TIME))
    print(f"standard_normal, {N_TIME:.0e} samples: {normal:.3f} s")
    print(
        f"all six terms over it:  {best(lambda: FULL.sample(N_TIME, RATE_HZ, 1)) / normal:6.2f}  (target: at most 10)"
    )
    print(f"N, B, K over it:        {best(lambda: THREE.sample(N_TIME, RATE_HZ, 1)) / normal:6.2f}")
    print(f"N, B, K by allantools:  {best(peer, 1) / normal:6.2f}")
    for fs in (100.0, 2000.0, 20000.0):
        decay, gain = _one_over_f(1e-4 / fs)
        cycles = np.geomspace(1e-4 / fs, 0.5, 20_000)
        deviation = 10 * np.log10(2 * np.pi * cycles * np.abs(bank_response(decay, gain, cycles)) ** 2)
        print(f"1/f from 1e-4 Hz at {fs:7.0f} Hz: {decay.size} sections, at most {np.abs(deviation).max():.3f} dB off")
    record = THREE.sample(1_000_000, RATE_HZ, 1)
    curve = allan_deviation(record, RATE_HZ)
    ours = best(lambda: allan_deviation(record, RATE_HZ))
    theirs = best(lambda: allantools.oadev(record, rate=RATE_HZ, data_type="freq", taus=curve.tau), 1)
    print(f"Allan deviation of 1e6 samples, {curve.tau.size} averaging times: {ours:.3f} s (allantools {theirs:.3f} s)")
    print(f"fit with intervals: {best(lambda: fit_allan(curve)):.3f} s")


if __name__ == "__main__":
    main()
