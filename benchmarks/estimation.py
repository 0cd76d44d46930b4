"""Any start, any gap, slow noise: errors and claims of the filters over many seeds against the limits promised.

    python benchmarks/estimation.py starts|faults|slow [SEEDS]

20 seeds take minutes to hours; the tests marked slow run a few. Exits with 1 if a limit is missed. Records are the
readings of the shipped instruments (belief `identified`), motion as a formula.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from testbed.fusion import FILTERS, estimate

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from testbed.signals import FloatArray
from tests.records import DEG, FS, RATES, cut, judged, mixed, offset_mixed, record, rms

HONEST = ("kalman", "steady_state", "wideband", "arw_shakf")
LIMITS = dict.fromkeys(FILTERS, (0.0045, 0.0045)) | {
    "allan_srkf": (0.007, 0.007),
    "complementary": (0.05, 0.1),
    "blending": (0.05, 0.1),
}
WITHIN = dict.fromkeys(FILTERS, 1.5) | dict.fromkeys(HONEST, 0.4)
Row = tuple[str, str, bool]


def starts(seeds: int) -> Iterator[Row]:
    """Yield 10 to 14 s after a start at five phases of 0.5 Hz, and inside 6 deg/s."""
    runs: dict[tuple[str, int], list[tuple[float, float]]] = {}
    for seed in range(seeds):
        for k, motion in enumerate((mixed, offset_mixed)):
            whole = record(motion, 20.7, seed)
            for name in FILTERS:
                for begin in (5.0, 5.4, 5.8, 6.2, 6.6) if k == 0 else (5.4,):
                    runs.setdefault((name, k), []).append(judged(name, *cut(*whole, begin), 10.0, 14.0))
    for name in FILTERS:
        found = [[rms(np.array(column)) for column in zip(*runs[name, k], strict=True)] for k in (0, 1)]
        (moving, claim), (constant, of_constant) = found
        good = moving <= LIMITS[name][0] and constant <= LIMITS[name][1]
        if name in HONEST:
            good = good and 0.7 <= claim / moving <= 1.4
        words = f"motion {moving:.5f} (claims {claim:.5f}), inside 6 deg/s {constant:.5f} (claims {of_constant:.5f})"
        yield name, words, good


def faults(seeds: int) -> Iterator[Row]:
    """Yield the largest error in a second of fault, what is left 3 s later, and error over claims; 3 Hz, 1 deg/s."""
    spoil: dict[str, tuple[str, float | None]] = {
        "MHD lost": ("mhd_ars", np.nan),
        "MHD at 0": ("mhd_ars", 0.0),
        "MHD stuck": ("mhd_ars", None),
        "MHD at its rail": ("mhd_ars", 30.0 * DEG),
        "gyro lost": ("mems_gyro", np.nan),
        "gyro at its rail": ("mems_gyro", 500.0 * DEG),
        "gyro at 2000": ("mems_gyro", 2000.0 * DEG),
    }

    def motion(t: FloatArray) -> FloatArray:
        return DEG * np.sin(6.0 * np.pi * t)

    inside, after = slice(round(8.0 * FS), round(9.0 * FS)), slice(round(12.0 * FS), None)
    for name in (name for name in FILTERS if name != "arw_shakf_literal"):
        worst, left, usual, boast = dict.fromkeys(spoil, 0.0), dict.fromkeys(spoil, 0.0), 0.0, 0.0
        for seed in range(seeds):
            rate, clean = record(motion, 13.5, seed)
            block = estimate(name, clean, sample_rate_hz=RATES, belief="identified")
            usual = max(usual, rms((block.rate - rate)[after]) / DEG)
            for fault, (sensor, value) in spoil.items():
                z = clean[sensor].copy()
                part = slice(round(8.0 * RATES[sensor]), round(9.0 * RATES[sensor]))
                z[part] = z[part.start] if value is None else value
                block = estimate(name, clean | {sensor: z}, sample_rate_hz=RATES, belief="identified")
                error = (block.rate - rate) / DEG
                worst[fault] = max(worst[fault], float(np.abs(error[inside]).max()))
                left[fault] = max(left[fault], rms(error[after]))
                boast = max(
                    boast, rms((error * DEG / block.std)[inside]), rms((error * DEG / block.std)[inside.stop :])
                )
        good = max(worst.values()) <= WITHIN[name] and max(left.values()) <= max(0.1, 1.2 * usual)
        good = good and (name == "shakf" or boast <= 5.0)
        words = ", ".join(f"{fault} {value:.3f}" for fault, value in worst.items())
        yield name, f"{words}; 3 s later {max(left.values()):.4f}, clean {usual:.4f}; error/claim {boast:.2f}", good


def slow(seeds: int) -> Iterator[Row]:
    """Yield the last 100 s of 200 s with states for slow noise and without, on the same seeds."""
    limits = {"steady_state": 0.7, "wideband": 0.7, "kalman": 0.85}
    runs: dict[tuple[str, bool], list[tuple[float, float]]] = {}
    for seed in range(seeds):
        whole = record(mixed, 200.0, seed)
        for name in limits:
            for coloured in (True, False):
                runs.setdefault((name, coloured), []).append(judged(name, *whole, 100.0, 200.0, coloured=coloured))
    for name, limit in limits.items():
        (with_states, claim), (white, of_white) = (
            [rms(np.array(column)) for column in zip(*runs[name, coloured], strict=True)] for coloured in (True, False)
        )
        ratio = with_states / white
        good = ratio <= limit and (name == "kalman" or 0.7 <= claim / with_states <= 1.4)
        words = f"{with_states:.5f} (claims {claim:.5f}), white design {white:.5f} (claims {of_white:.5f})"
        yield name, f"{words}, ratio {ratio:.2f}", good


PARTS: dict[str, Callable[[int], Iterator[Row]]] = {"starts": starts, "faults": faults, "slow": slow}


def main() -> int:
    """Print a part and return whether a limit is missed."""
    part, seeds = sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 20
    print(f"{part}, {seeds} seeds, deg/s")
    missed = False
    for name, words, good in PARTS[part](seeds):
        missed = missed or not good
        print(f"{name:<18} {words}{'' if good else '  MISSED'}", flush=True)
    return int(missed)


if __name__ == "__main__":
    sys.exit(main())
