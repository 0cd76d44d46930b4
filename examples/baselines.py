"""What practitioners would pick, beside the adaptive filters and the optimum: the table of docs/baselines.md.

The four signals of paper 1 (20 s, the last half judged, phase included), `sx300` and `adis16505_filtered` with all
their noise, 1/f and bias instability included, belief `identified`, every filter with its defaults; `steady_state` also
made for the signal's strongest line. The ratio is to the optimum of that signal, which counts white noise only.

Run it with ``python examples/baselines.py`` for two signals and one seed of 4 s; ``--full`` is the table of the
page, all four and three seeds of 20 s (about 2 min of processor time).
"""

from __future__ import annotations

import argparse

import numpy as np

from testbed.fusion import FILTERS, estimate
from testbed.fusion.belief import load_belief
from testbed.judging.bounds import Bounds
from testbed.models.motion import MotionProfile
from testbed.parts import resolve
from testbed.reproduce.paper1 import SIGNALS
from testbed.sensors import load_preset
from testbed.signals import random_stream
from testbed.units import DEG

RATES = {"mhd_ars": 20_000.0, "mems_gyro": 2_000.0}
SENSORS = {"mhd_ars": load_preset("sx300"), "mems_gyro": load_preset("adis16505_filtered")}
BELIEF = load_belief("identified")
COMPARED = ("kalman", "arw_shakf", "wideband", "steady_state", "complementary", "blending")
# Seeds, length of a record [s], whose second half is judged, and signals.
FULL, SHORT = (3, 20.0, tuple(SIGNALS)), (1, 4.0, ("0.5 Hz", "mixed"))


def rate_of(signal: str, duration: float) -> np.ndarray:
    """Return the commanded rate [rad/s] at 20 kHz, with its ramp-in."""
    terms = [sine.start(duration, random_stream(0, "motion")) for sine in SIGNALS[signal]]
    return MotionProfile(terms, 0.5, RATES["mhd_ars"]).process(round(duration * RATES["mhd_ars"])).rate


def lines_of(signal: str, duration: float) -> list[tuple[float, float]]:
    """Return frequency [Hz] and amplitude [rad/s] of each line."""
    settled = round(0.5 * duration * RATES["mhd_ars"])
    rate = rate_of(signal, duration)[settled:]
    t = np.arange(settled, settled + rate.size) / RATES["mhd_ars"]
    return [
        (s.frequency, float(2.0 * abs(np.mean(rate * np.exp(-2j * np.pi * s.frequency * t))))) for s in SIGNALS[signal]
    ]


def errors(signal: str, seed: int, duration: float) -> dict[str, tuple[float, float]]:
    """Return RMSE and claimed standard deviation (root mean square) of every filter [deg/s]."""
    rate = rate_of(signal, duration)
    readings = {name: sensor.sample(rate, RATES["mhd_ars"], seed) for name, sensor in SENSORS.items()}
    strongest, amplitude = max(lines_of(signal, duration), key=lambda line: line[1] * line[0])
    runs: dict[str, tuple[str, dict[str, float]]] = {name: (name, {}) for name in COMPARED}
    runs["steady_state, for it"] = "steady_state", {"frequency": strongest, "amplitude": amplitude}
    settled, found = rate.size // 2, {}
    for label, (name, own) in runs.items():
        block = estimate(name, readings, sample_rate_hz=RATES, belief=BELIEF, start="rest", verdict=False, **own)
        error = (block.rate - rate)[settled:]
        found[label] = tuple(float(np.sqrt(np.mean(values**2))) / DEG for values in (error, block.std[settled:]))
    return found


def main() -> None:
    """Print what was derived, then errors, claims and ratios, median over the seeds."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--full", action="store_true", help="all four signals, three seeds of 20 s")
    n_seeds, duration, signals = FULL if parser.parse_args().full else SHORT
    for name in ("complementary", "blending"):
        factory = resolve("filter", name, FILTERS)
        built = factory(BELIEF, RATES, factory.Parameters(start="rest"))
        print(f"{name}: crossover {1e3 * built.crossover_hz:.2f} mHz, bandwidth {built.bandwidth_hz:.0f} Hz")
    seeds = range(1, 1 + n_seeds)
    spread = f"median of {n_seeds} seeds" if n_seeds > 1 else "one seed"
    print(f"{'':>8}{'':>22}{'RMSE':>10}{'claimed':>10}{'x optimum':>11}   deg/s, {spread} of {duration:g} s")
    for signal in signals:
        lines = lines_of(signal, duration)
        (best,), _ = Bounds(SENSORS, RATES).settled([lines])
        print(f"{signal:>8}{'optimum, settled':>22}{best.rmse / DEG:10.5f}")
        runs = [errors(signal, seed, duration) for seed in seeds]
        for name in runs[0]:
            rmse, std = np.median([run[name] for run in runs], axis=0)
            print(f"{signal:>8}{name:>22}{rmse:10.5f}{std:10.5f}{rmse * DEG / best.rmse:11.2f}")


if __name__ == "__main__":
    main()
