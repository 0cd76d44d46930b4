"""`wideband` against the best fixed filter of every signal, and under a wrong belief: the figures of docs/wideband.md.

Simulated `sx300` and `adis16505_filtered` with all their noise, belief `identified`, phase included, the second half
judged. Of 20 s (the default) the slow error, the same in all filters, is the larger part; ``--duration 10`` shows more
of what sets the filters apart. The fixed filters are `kalman` of order 3 on a decade grid of q, on the same readings;
the grid is followed until the best one has a worse one on either side. The wheel is that of
scenarios/satellite_microvibration.yaml: alone, through a run-up from 20 to 60 rev/s, and on the vibration of its
platform.

Run it with ``python examples/wideband_against_fixed.py [--seeds 10] [--signals "10 Hz" mixed] [--csv FILE]``: about 40
s of processor time for each signal with ten seeds of 20 s. ``--mismatch`` prints the table of wrong beliefs instead,
``--change`` the one of changing signals. ``--filters`` and ``--restart`` give `wideband` other parameters than its own
in the first and the last, to see what they are for. ``--start unknown`` lets no filter know that the table rests at
first.
"""

from __future__ import annotations

import argparse
import csv
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import testbed
from testbed.fusion import estimate
from testbed.fusion.belief import SensorBelief, load_belief
from testbed.models.motions.sine import Sine
from testbed.sensors import load_preset
from testbed.signals import random_stream
from testbed.units import DEG

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from testbed.models.motion import Motion
    from testbed.signals import FloatArray

RATES = {"mhd_ars": 20_000.0, "mems_gyro": 2_000.0}
SENSORS = {"mhd_ars": load_preset("sx300"), "mems_gyro": load_preset("adis16505_filtered")}
BELIEF = load_belief("identified")
# No parameter of the filter was chosen on these.
FIRST_SEED = 101
SATELLITE = Path(__file__).parents[1] / "scenarios" / "satellite_microvibration.yaml"
SINES_HZ = (0.1, 0.5, 2.0, 4.0, 10.0, 25.0, 100.0, 300.0, 500.0)
# Of the issue that asked for the filter: medians [deg/s], and the ratio to the best fixed filter.
TARGETS = {"0.5 Hz": 0.0030, "4 Hz": 0.0030, "10 Hz": 0.0025, "mixed": 0.0035}
RATIO = 1.15


def sine(freq: float, amplitude: float = 1.0) -> Motion:
    """Return a sine of an amplitude in deg/s."""
    return Sine(frequency=freq, rate=amplitude * DEG)


def signals() -> dict[str, tuple[Sequence[Motion], int]]:
    """Return the motions of each signal, and the decade of q in (deg/s)^2/s^5 at which the search begins."""
    (_, wheel), (_, platform) = testbed.load_scenario(SATELLITE).motion
    run_up = wheel.model_copy(update={"speed": 2 * np.pi * 20.0, "stop_speed": 2 * np.pi * 60.0})
    decade = {0.1: 3, 0.5: 4, 2.0: 5, 4.0: 6, 10.0: 8, 25.0: 11, 100.0: 13, 300.0: 16, 500.0: 17}
    table: dict[str, tuple[Sequence[Motion], int]] = {f"{f:g} Hz": ([sine(f)], decade[f]) for f in SINES_HZ}
    table["mixed"] = [sine(0.5), sine(10.0, 0.18)], 6
    table["wheel"] = [wheel], 8
    table["wheel run-up"] = [run_up], 8
    table["wheel, platform"] = [wheel, platform], 9
    return table


def truth(motions: Sequence[Motion], duration: float) -> FloatArray:
    """Return the rate [rad/s] at 20 kHz of an ideal table; random phases and spectra are drawn once for all seeds."""
    t = np.arange(round(duration * RATES["mhd_ars"])) / RATES["mhd_ars"]
    parts = [m.start(duration, random_stream(1, f"motion {i}"))(t) for i, m in enumerate(motions)]
    rate: FloatArray = np.sum(parts, axis=0)
    return rate


def readings(rate: FloatArray, seed: int, *, noise: bool = True) -> dict[str, FloatArray]:
    """Return the readings of both sensors [rad/s]."""
    return {
        name: sensor.model_copy(update={"noise": noise}).sample(rate, RATES["mhd_ars"], seed)
        for name, sensor in SENSORS.items()
    }


def error_and_claim(
    name: str, z: dict[str, FloatArray], rate: FloatArray, belief: dict[str, SensorBelief], **own: object
) -> tuple[float, float]:
    """Return the error of a filter over the second half, and the standard deviation that it claims there [deg/s]."""
    block = estimate(name, z, sample_rate_hz=RATES, belief=belief, verdict=False, **{"start": "rest", **own})
    late = slice(rate.size // 2, None)
    error, claim = (float(np.sqrt(np.mean(of[late] ** 2)) / DEG) for of in (block.rate - rate, block.std))
    return error, claim


def rmse(
    name: str, z: dict[str, FloatArray], rate: FloatArray, belief: dict[str, SensorBelief], **own: object
) -> float:
    """Return the error of a filter over the second half [deg/s]."""
    return error_and_claim(name, z, rate, belief, **own)[0]


def fixed(
    z: dict[str, FloatArray],
    rate: FloatArray,
    decade: int,
    belief: dict[str, SensorBelief] = BELIEF,
    start: str = "rest",
) -> float:
    """Return the error of the order-3 filter with q = 10^decade (deg/s)^2/s^5 [deg/s]."""
    return rmse("kalman", z, rate, belief, order=3, q=10.0**decade * DEG**2, start=start)


def best_fixed(errors: Callable[[int], FloatArray], decade: int) -> tuple[int, FloatArray]:
    """Return the decade of the smallest median error, worse ones on either side of it, and the errors of its seeds."""
    known = {d: errors(d) for d in (decade - 1, decade, decade + 1)}
    while True:
        best = min(known, key=lambda d: float(np.median(known[d])))
        beside = [d for d in (best - 1, best + 1) if d not in known]
        if not beside:
            return best, known[best]
        known[beside[0]] = errors(beside[0])


@dataclass(frozen=True)
class Judgement:
    """Errors of `wideband` and of the best fixed filter for one signal [deg/s].

    `ratio` is the median of the ratios of the pairs with the same noise, `ratio_of_medians` what it says, `claim` the
    root mean square that `wideband` claims over its error, over all seeds.
    """

    signal: str
    seeds: int
    wideband: float
    largest: float
    fixed: float
    fixed_log10_q: int
    ratio: float
    ratio_of_medians: float
    claim: float


def judge(label: str, seeds: Sequence[int], duration: float, start: str = "rest", **own: float) -> Judgement:
    """Judge one signal of `signals` over paired seeds from one start; `own` are parameters of `wideband`."""
    motions, decade = signals()[label]
    rate = truth(motions, duration)
    records = [readings(rate, seed) for seed in seeds]
    pairs = [error_and_claim("wideband", z, rate, BELIEF, start=start, **own) for z in records]
    ours, claims = np.array(pairs).T
    at, theirs = best_fixed(lambda d: np.array([fixed(z, rate, d, start=start) for z in records]), decade)
    middle, other = float(np.median(ours)), float(np.median(theirs))
    ratio = float(np.median(ours / theirs))
    claim = float(np.sqrt(np.mean(claims**2) / np.mean(ours**2)))
    return Judgement(label, len(seeds), middle, float(ours.max()), other, at, ratio, middle / other, claim)


def against_fixed(
    labels: Sequence[str],
    seeds: Sequence[int],
    duration: float,
    target: Path | None,
    start: str,
    own: dict[str, float],
) -> None:
    """Print a line per signal, and write them to a file."""
    print(
        f"{'signal':>16} wideband  largest    fixed   its q   ratio  of medians  claim   deg/s, start {start}, "
        f"{len(seeds)} seeds, {duration:g} s"
    )
    rows = []
    for label in labels:
        row = judge(label, seeds, duration, start, **own)
        rows.append(asdict(row))
        met = max(row.ratio, row.ratio_of_medians) <= RATIO and row.wideband <= TARGETS.get(label, np.inf)
        print(
            f"{label:>16}{row.wideband:9.5f}{row.largest:9.5f}{row.fixed:9.5f}{'1e' + str(row.fixed_log10_q):>8}"
            f"{row.ratio:8.3f}{row.ratio_of_medians:12.3f}{row.claim:7.2f}   {'met' if met else 'MISSED'}",
            flush=True,
        )
    if target:
        with target.open("w", newline="") as file:
            writer = csv.DictWriter(file, fieldnames=list(rows[0]))
            writer.writeheader()
            writer.writerows(rows)


def changed(belief: SensorBelief, *, gain: float = 1.0, corner: float = 1.0) -> SensorBelief:
    """Return a belief with another scale factor, or with all its poles and zeros moved by a factor."""
    a, b = np.array(belief.denominator), np.array(belief.numerator)
    powers = corner ** np.arange(a.size)
    return belief.model_copy(
        update={"numerator": tuple(gain * b * powers[a.size - b.size :]), "denominator": tuple(a * powers)}
    )


def mismatch_ratios(
    freq: float, decade: int, wrong: dict[str, SensorBelief], seeds: Sequence[int], duration: float = 10.0
) -> FloatArray:
    """Return error, ideal and forced error [deg/s] of a sine of 1 deg/s for each seed, shape (n_seed, 3).

    Ideal is `wideband` with the right belief on the same readings. Forced is what the wrong belief alone does: the
    fixed filter that is best for this signal with the right belief (its `decade` of q), given the wrong one and
    readings without noise.
    """
    rate = truth([sine(freq)], duration)
    forced = fixed(readings(rate, 0, noise=False), rate, decade, wrong)
    rows = []
    for seed in seeds:
        z = readings(rate, seed)
        rows.append([rmse("wideband", z, rate, wrong), rmse("wideband", z, rate, BELIEF), forced])
    return np.array(rows)


# Frequency [Hz] and the decade of the best fixed q with the right belief (10 s, from the table above).
MISMATCH_AT = {0.5: 2, 10.0: 10, 100.0: 13}


def under_mismatch(seeds: Sequence[int]) -> None:
    """Print what 5 % of belief error costs: promised are at most 1.3 sqrt(ideal^2 + forced^2).

    In one run noise and forced error may add as amplitudes, which gives a ratio of up to sqrt(2); over seeds their
    squares add. So the ratio of the rms over the seeds stands beside the largest of a single run.
    """
    print(
        "belief off by 5 %            at Hz  ideal    forced   error   over seeds  largest   deg/s, medians; ratio "
        "error / sqrt(ideal^2 + forced^2)"
    )
    for sensor in SENSORS:
        for change in ({"gain": 1.05}, {"gain": 0.95}, {"corner": 1.05}, {"corner": 0.95}):
            ((key, factor),) = change.items()
            wrong = BELIEF | {sensor: changed(BELIEF[sensor], **change)}
            for freq, decade in MISMATCH_AT.items():
                error, ideal, forced = mismatch_ratios(freq, decade, wrong, seeds).T
                worst = float(np.max(error / np.hypot(ideal, forced)))
                together = float(np.sqrt(np.mean(error**2) / np.mean(ideal**2 + forced**2)))
                print(
                    f"{sensor:>10} {key:>6} x {factor:4.2f}{freq:12.1f}{np.median(ideal):9.5f}{forced[0]:9.5f}"
                    f"{np.median(error):9.5f}{together:9.3f}{worst:10.3f}   "
                    f"{'met' if worst <= 1.3 else 'MISSED in a run'}",
                    flush=True,
                )


# Frequency [Hz] and amplitude [deg/s] before and after the middle of the run, where the rate passes zero.
CHANGES = {
    "0.5 to 100 Hz": ((0.5, 1.0), (100.0, 1.0)),
    "100 to 0.5 Hz": ((100.0, 1.0), (0.5, 1.0)),
    "4 to 25 Hz": ((4.0, 1.0), (25.0, 1.0)),
    "10 Hz, times 100": ((10.0, 0.1), (10.0, 10.0)),
    "10 Hz, by 100": ((10.0, 10.0), (10.0, 0.1)),
    "0.5 Hz, times 100": ((0.5, 0.1), (0.5, 10.0)),
    "100 Hz, times 100": ((100.0, 0.1), (100.0, 10.0)),
}
AFTER = 0.1  # s; two memories of the filter


def change_errors(label: str, seed: int, duration: float = 10.0, **own: float) -> tuple[float, float, float]:
    """Return the errors [deg/s] from `AFTER` on, without a change (the second signal from the start, same noise), and
    the largest error.
    """
    before, after = (truth([sine(*line)], duration) for line in CHANGES[label])
    half, rest = before.size // 2, before.size // 2 + round(AFTER * RATES["mhd_ars"])
    rate = np.concatenate([before[:half], after[half:]])
    always: dict[str, Any] = {"start": "rest", "verdict": False}
    errors = [
        (estimate("wideband", readings(one, seed), sample_rate_hz=RATES, belief=BELIEF, **always, **own).rate - one)
        / DEG
        for one in (rate, after)
    ]
    real, ideal = (float(np.sqrt(np.mean(error[rest:] ** 2))) for error in errors)
    return real, ideal, float(np.max(np.abs(errors[0][half:])))


def under_change(seeds: Sequence[int], own: dict[str, float]) -> None:
    """Print what a change in the middle of the run costs: promised are at most 1.3 times the error without it."""
    print(
        f"{'change':>18}  without     with  largest ratio  largest error   deg/s, medians, "
        f"from {AFTER:g} s after the change on"
    )
    for label in CHANGES:
        real, ideal, peak = np.array([change_errors(label, seed, **own) for seed in seeds]).T
        worst = float(np.max(real / ideal))
        print(
            f"{label:>18}{np.median(ideal):9.5f}{np.median(real):9.5f}{worst:9.3f}{peak.max():14.3f}"
            f"   {'met' if worst <= 1.3 else 'MISSED'}",
            flush=True,
        )


def main() -> None:
    """Print the table asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=10, help="how many")
    parser.add_argument("--duration", type=float, default=20.0, help="of a run in s")
    parser.add_argument("--signals", nargs="+", default=list(signals()), choices=list(signals()), metavar="SIGNAL")
    parser.add_argument("--start", choices=("rest", "unknown"), default="rest", help="what both filters know of it")
    parser.add_argument("--csv", type=Path, help="where to write the table")
    parser.add_argument("--filters", type=int, help="in the bank of `wideband`, over the same decades")
    parser.add_argument("--restart", type=float, help="of `wideband`; 1e12 is never")
    table = parser.add_mutually_exclusive_group()
    table.add_argument("--mismatch", action="store_true", help="print the table of wrong beliefs instead")
    table.add_argument("--change", action="store_true", help="print the table of signals that change instead")
    given = parser.parse_args()
    seeds = range(FIRST_SEED, FIRST_SEED + given.seeds)
    own = {key: value for key in ("filters", "restart") if (value := getattr(given, key)) is not None}
    if given.mismatch:
        under_mismatch(seeds)
    elif given.change:
        under_change(seeds, own)
    else:
        against_fixed(given.signals, seeds, given.duration, given.csv, given.start, own)


if __name__ == "__main__":
    main()
