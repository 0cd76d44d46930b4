"""`wideband` against the best fixed filter of every signal, and under a wrong belief: the figures of docs/wideband.md.

Simulated `sx300` and `adis16505_filtered` with all their noise, belief `identified`, 10 s, the last 5 s judged, phase included. The fixed filters
are `kalman` of order 3 on a decade grid of q around the best one, on the same readings.

Run it with ``python examples/wideband_against_fixed.py [SEEDS]`` (default 3; about 1 min of processor time).
"""

from __future__ import annotations

import sys

import numpy as np

from testbed.fusion import estimate
from testbed.fusion.belief import SensorBelief, load_belief
from testbed.sensors import load_preset

DEG = np.pi / 180.0
RATES = {"mhd_ars": 20_000.0, "mems_gyro": 2_000.0}
SENSORS = {"mhd_ars": load_preset("sx300"), "mems_gyro": load_preset("adis16505_filtered")}
BELIEF = load_belief("identified")
# Lines (frequency [Hz], amplitude [deg/s]) and the decade of q in (deg/s)^2/s^5 around which the fixed filters lie.
SIGNALS = {
    "0.1 Hz": ([(0.1, 1.0)], 2),
    "0.5 Hz": ([(0.5, 1.0)], 3),
    "2 Hz": ([(2.0, 1.0)], 5),
    "4 Hz": ([(4.0, 1.0)], 6),
    "10 Hz": ([(10.0, 1.0)], 9),
    "25 Hz": ([(25.0, 1.0)], 11),
    "100 Hz": ([(100.0, 1.0)], 13),
    "300 Hz": ([(300.0, 1.0)], 15),
    "500 Hz": ([(500.0, 1.0)], 16),
    "mixed": ([(0.5, 1.0), (10.0, 0.18)], 7),
    "wheel": ([(33.3, 0.3), (66.7, 0.1), (133.0, 0.1), (266.0, 0.05)], 13),
}


def signal(lines: list[tuple[float, float]], duration: float = 10.0) -> np.ndarray:
    """Return the rate [rad/s] at 20 kHz."""
    t = np.arange(round(duration * RATES["mhd_ars"])) / RATES["mhd_ars"]
    return np.sum([a * DEG * np.sin(2.0 * np.pi * f * t) for f, a in lines], axis=0)


def readings(rate: np.ndarray, seed: int, *, noise: bool = True) -> dict[str, np.ndarray]:
    """Return the readings of both sensors [rad/s]."""
    return {
        name: sensor.model_copy(update={"noise": noise}).sample(rate, RATES["mhd_ars"], seed)
        for name, sensor in SENSORS.items()
    }


def rmse(
    name: str, z: dict[str, np.ndarray], rate: np.ndarray, belief: dict[str, SensorBelief], **own: object
) -> float:
    """Return the error of a filter over the second half [deg/s]."""
    error = estimate(name, z, sample_rate_hz=RATES, belief=belief, **own).rate - rate
    return float(np.sqrt(np.mean(error[rate.size // 2 :] ** 2)) / DEG)


def against_fixed(seeds: range) -> None:
    """Print the medians of `wideband` and of the best fixed filter."""
    print(f"{'signal':>8}{'wideband':>10}{'fixed':>10}{'its q':>8}{'ratio':>8}   deg/s, median of {len(seeds)} seeds")
    for label, (lines, decade) in SIGNALS.items():
        rate, ours, fixed = signal(lines), [], []
        decades = range(decade - 1, decade + 3)
        for seed in seeds:
            z = readings(rate, seed)
            ours.append(rmse("wideband", z, rate, BELIEF))
            fixed.append([rmse("kalman", z, rate, BELIEF, order=3, q=10.0**q * DEG**2) for q in decades])
        best = np.median(fixed, axis=0)
        at = int(np.argmin(best))
        print(
            f"{label:>8}{np.median(ours):10.5f}{best[at]:10.5f}{'1e' + str(decades[at]):>8}{np.median(ours) / best[at]:8.3f}"
        )


def changed(belief: SensorBelief, *, gain: float = 1.0, corner: float = 1.0) -> SensorBelief:
    """Return a belief with another scale factor, or with all its poles and zeros moved by a factor."""
    a, b = np.array(belief.denominator), np.array(belief.numerator)
    powers = corner ** np.arange(a.size)
    return belief.model_copy(
        update={"numerator": tuple(gain * b * powers[a.size - b.size :]), "denominator": tuple(a * powers)}
    )


def under_mismatch(seed: int) -> None:
    """Print what 5 % of belief error costs: at most 1.3 sqrt(ideal^2 + forced^2), forced being the error without noise."""
    print(f"{'5 % of':>8}{'at':>8}{'ideal':>10}{'wrong':>10}{'forced':>10}{'ratio':>8}   deg/s")
    for label, change in (("scale", {"gain": 1.05}), ("corner", {"corner": 1.05})):
        wrong = BELIEF | {"mhd_ars": changed(BELIEF["mhd_ars"], **change)}
        for freq in (0.5, 10.0, 100.0):
            rate = signal([(freq, 1.0)])
            z = readings(rate, seed)
            ideal, real = (rmse("wideband", z, rate, belief) for belief in (BELIEF, wrong))
            forced = rmse("wideband", readings(rate, seed, noise=False), rate, wrong, stuck_after=0)
            print(f"{label:>8}{freq:8.1f}{ideal:10.5f}{real:10.5f}{forced:10.5f}{real / np.hypot(ideal, forced):8.3f}")


def main() -> None:
    """Print both tables."""
    against_fixed(range(21, 21 + int(sys.argv[1] if len(sys.argv) > 1 else 3)))
    under_mismatch(21)


if __name__ == "__main__":
    main()
