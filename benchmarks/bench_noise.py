"""Time of all noise terms together over one `Generator.standard_normal` of the same length; target: at most 10.

And the noise of one seed of 20 s, a `sx300` and an `adis16505_filtered` in blocks of a second; target: at most 17 ms.
A missed target is an exit status of 1.

Beside it, in the same run and in turns, the same terms (white, flicker, random walk) from allantools; medians.
Run: python benchmarks/bench_noise.py
"""

from __future__ import annotations

import statistics
import time
from typing import TYPE_CHECKING

import allantools
import numpy as np
from promises import Promise, conclude

from testbed.allan import allan_deviation, fit_allan
from testbed.sensors import load_preset
from testbed.sensors.mems_gyro import MemsGyro
from testbed.sensors.mhd_ars import MhdArs
from testbed.sensors.noise import GyroNoise
from testbed.sensors.noise_terms import NoiseStage, _one_over_f, bank_response
from testbed.sensors.sampled_noise import Rational

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from testbed.signals import FloatArray

N_TIME = 10_000_000
RATE_HZ = 2000.0
MOST_TERMS, MOST_SEED = 10.0, 17e-3
FULL = GyroNoise(
    quantization=1e-6,
    angle_random_walk=4e-5,
    bias_instability=1e-5,
    rate_random_walk=1e-6,
    rate_ramp=1e-8,
    markov_bias=1e-5,
)
THREE = GyroNoise(angle_random_walk=4e-5, bias_instability=1e-5, rate_random_walk=1e-6)


def medians(actions: Mapping[str, Callable[[], object]], repeats: int = 3) -> dict[str, float]:
    """Return the median time of each action [s], taken in turns, so that all see the same machine."""
    times: dict[str, list[float]] = {name: [] for name in actions}
    for _ in range(repeats):
        for name, action in actions.items():
            start = time.perf_counter()
            action()
            times[name].append(time.perf_counter() - start)
    return {name: statistics.median(values) for name, values in times.items()}


def peer() -> FloatArray:
    """Return N, B and K from allantools, flicker by Kasdin and Walter's filter over an FFT (lengths of 2^k only)."""
    flicker = allantools.Noise(nr=2**24, qd=1e-5**2, b=-1)
    flicker.generateNoise()
    total: FloatArray = flicker.time_series[:N_TIME]
    total += allantools.noise.white(N_TIME, b0=2 * 4e-5**2, fs=RATE_HZ)
    total += allantools.noise.brown(N_TIME, b_minus2=2 * (1e-6 / (2 * np.pi)) ** 2, fs=RATE_HZ)
    return total


def noise_of_a_seed() -> float:
    """Return the median CPU time of the noise of both sensors over 20 s [s]."""
    mhd, gyro = load_preset("sx300"), load_preset("adis16505_filtered")
    assert isinstance(mhd, MhdArs)
    assert isinstance(gyro, MemsGyro)
    times = []
    for seed in range(15):
        start = time.process_time()
        fast = NoiseStage(mhd.noise_terms(mhd.sample_rate, seed, "mhd_ars"))
        slow = NoiseStage(gyro.sampled_terms(Rational(*gyro.transfer_function), gyro.sample_rate, seed, "mems_gyro"))
        for _ in range(20):
            fast.process(20_000)
            slow.process(2_000)
        times.append(time.process_time() - start)
    return statistics.median(times)


def main() -> None:
    FULL.sample(1000, RATE_HZ, 1)  # compiles
    took = medians(
        {
            "normal": lambda: np.random.default_rng(1).standard_normal(N_TIME),
            "six": lambda: FULL.sample(N_TIME, RATE_HZ, 1),
            "three": lambda: THREE.sample(N_TIME, RATE_HZ, 1),
            "peer": peer,
        }
    )
    print(f"standard_normal, {N_TIME:.0e} samples: {took['normal']:.3f} s (medians of 3 in turns)")
    six = took["six"] / took["normal"]
    print(f"all six terms over it:  {six:6.2f}")
    print(f"N, B, K over it:        {took['three'] / took['normal']:6.2f}")
    print(f"N, B, K by allantools:  {took['peer'] / took['normal']:6.2f}")
    for fs in (100.0, 2000.0, 20000.0):
        decay, gain = _one_over_f(1e-4 / fs)
        cycles = np.geomspace(1e-4 / fs, 0.5, 20_000)
        deviation = 10 * np.log10(2 * np.pi * cycles * np.abs(bank_response(decay, gain, cycles)) ** 2)
        print(f"1/f from 1e-4 Hz at {fs:7.0f} Hz: {decay.size} sections, at most {np.abs(deviation).max():.3f} dB off")
    seed = noise_of_a_seed()
    print(f"all noise of a seed, 20 s: {1e3 * seed:.1f} ms of CPU (median of 15)")
    record = THREE.sample(1_000_000, RATE_HZ, 1)
    curve = allan_deviation(record, RATE_HZ)
    took = medians(
        {
            "ours": lambda: allan_deviation(record, RATE_HZ),
            "theirs": lambda: allantools.oadev(record, rate=RATE_HZ, data_type="freq", taus=curve.tau),
            "fit": lambda: fit_allan(curve),
        }
    )
    print(
        f"Allan deviation of 1e6 samples, {curve.tau.size} averaging times: {took['ours']:.3f} s "
        f"(allantools {took['theirs']:.3f} s)"
    )
    print(f"fit with intervals and verdict: {took['fit']:.3f} s")
    conclude(
        Promise("all six noise terms over standard_normal [-]", MOST_TERMS, six),
        Promise("all noise of a seed, 20 s [CPU s]", MOST_SEED, seed),
    )


if __name__ == "__main__":
    main()
