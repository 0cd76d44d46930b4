"""`wideband` against the best fixed filter of every signal, and under a wrong belief: the figures of docs/wideband.md.

Simulated `sx300` and `adis16505_filtered` with all their noise, belief `identified`, phase included. Each record begins
in mid-motion, at an instant drawn by its seed, and no filter knows anything of its start; with ``--start rest`` the
motion begins on a table at rest, and the filters know it. Judged are the root mean squares over all seeds in the second
quarter and in the second half. The fixed filters are `kalman` of orders 1, 2 and 3 on the same readings; order and q
are the best ones of as many other seeds, q followed by decades and then by quarters of one until it has a worse one on
either side. The wheel is that of scenarios/satellite_microvibration.yaml: alone, through a run-up from 20 to 60 rev/s,
and on the vibration of its platform.

Run it with ``python examples/wideband_against_fixed.py [--signals "10 Hz" mixed] [--csv FILE]`` for two seeds of 4 s
and two signals, which is a look and no measurement. ``--full`` is what the page says: ten seeds of 20 s, of all signals
unless some are named, about 40 s of processor time each. ``--mismatch`` prints the table of wrong beliefs
instead, ``--change`` the one of changing signals, both from rest. ``--filters`` and ``--restart`` give `wideband` other
parameters than its own in the first and the last, to see what they are for.
"""

from __future__ import annotations

import argparse
import csv
import functools
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import testbed
from testbed.fusion import FILTERS, estimate
from testbed.fusion.base import Received
from testbed.fusion.belief import SensorBelief, load_belief
from testbed.fusion.lanes.together import Together
from testbed.models.motion import ramp
from testbed.models.motions.sine import Sine
from testbed.parts import resolve
from testbed.sensors import load_preset
from testbed.signals import random_stream
from testbed.units import DEG

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from testbed.models.motion import Motion
    from testbed.signals import FloatArray

    # Rate and readings [rad/s].
    Record = tuple[FloatArray, dict[str, FloatArray]]

# Seeds and length of a record [s], and the signals of a look.
FULL, SHORT, LOOK = (10, 20.0), (2, 4.0), ("mixed", "100 Hz")
RATES = {"mhd_ars": 20_000.0, "mems_gyro": 2_000.0}
SENSORS = {"mhd_ars": load_preset("sx300"), "mems_gyro": load_preset("adis16505_filtered")}
BELIEF = load_belief("identified")
# No parameter of the filter was chosen on these.
FIRST_SEED = 101
# Nor is the fixed filter: of many, chosen on the seeds that judge it, one errs the other way than their noise.
TO_THE_OTHERS = 100
SATELLITE = Path(__file__).parents[1] / "scenarios" / "satellite_microvibration.yaml"
# Of the search for the best q, in decades; and where it begins for the lower orders: there the filter has the same
# bandwidth, (q / S)^(1 / 2m), S the density of the MHD ARS's noise [(deg/s)^2 s], as a logarithm.
STEPS, ORDERS, LOG10_S = (1.0, 0.25), (1, 2, 3), -10.5
SINES_HZ = (0.1, 0.5, 2.0, 4.0, 10.0, 25.0, 100.0, 300.0, 500.0)
# Asked for: error over that of the best fixed filter, at most, and claim over error; from rest also the error [deg/s].
RATIO, CLAIM = 1.15, (0.7, 1.4)
TARGETS = {"0.5 Hz": 0.0030, "4 Hz": 0.0030, "10 Hz": 0.0025, "mixed": 0.0035}
# A record that begins in mid-motion does so within this [s] of the motion; the sensors have run for as long before.
ANYWHERE, RUN_UP = 10.0, 5.0
# One that begins on a table at rest takes this long [s] to its full rate.
RAMP_IN = 0.5


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


def truth(motions: Sequence[Motion], duration: float, begin: float = 0.0) -> FloatArray:
    """Return the rate [rad/s] at 20 kHz of an ideal table from an instant [s] of its motion on; random phases and
    spectra are drawn once for all seeds.
    """
    t = begin + np.arange(round(duration * RATES["mhd_ars"])) / RATES["mhd_ars"]
    length = duration + (ANYWHERE if begin else 0.0)
    parts = [m.start(length, random_stream(1, f"motion {i}"))(t) for i, m in enumerate(motions)]
    rate: FloatArray = np.sum(parts, axis=0)
    return rate


def readings(rate: FloatArray, seed: int, *, noise: bool = True) -> dict[str, FloatArray]:
    """Return the readings of both sensors [rad/s]."""
    return {
        name: sensor.model_copy(update={"noise": noise}).sample(rate, RATES["mhd_ars"], seed)
        for name, sensor in SENSORS.items()
    }


def record(motions: Sequence[Motion], duration: float, seed: int, start: str) -> Record:
    """Return rate and readings [rad/s] of a record that begins with the motion, on a table at rest, or in the middle of
    it, at an instant drawn by the seed.
    """
    if start == "rest":
        rate = truth(motions, duration)
        # As in a scenario: wheel and platform would jump from a rest to their rate.
        rate *= ramp(np.arange(rate.size) / RATES["mhd_ars"], RAMP_IN)
        return rate, readings(rate, seed)
    begin = float(random_stream(seed, "begin").uniform(0.0, ANYWHERE))
    rate = truth(motions, duration + RUN_UP, begin)
    cut = {name: z[round(RUN_UP * RATES[name]) :] for name, z in readings(rate, seed).items()}
    return rate[round(RUN_UP * RATES["mhd_ars"]) :], cut


def errors_and_claims(name: str, records: Sequence[Record], start: str, **own: object) -> FloatArray:
    """Return the error of a filter over the second quarter and over the second half of each record, and the standard
    deviations that it claims there [deg/s], shape (n_seed, 2, 2). Where the filter can, the seeds go side by side.
    """
    kind = resolve("filter", name, FILTERS)
    filters = [kind(BELIEF, RATES, kind.Parameters(start=start, **own)) for _ in records]
    received = [one.received(z) for one, (_, z) in zip(filters, records, strict=True)]
    together, n, squares = Together(filters[0]), records[0][0].size, []
    for part in (slice(k * n // 4, (k + 1) * n // 4) for k in range(4)):
        blocks = together.process(filters, [Received(Z[:, part], gated[:, part], None) for Z, gated, _ in received])
        # Each holds until the next one is asked for.
        squares.append(
            [
                [rms(block.rate - rate[part]) ** 2, rms(block.std) ** 2]
                for block, (rate, _) in zip(blocks, records, strict=True)
            ]
        )
    _, second, third, fourth = np.array(squares)
    found: FloatArray = np.sqrt(np.stack([second, 0.5 * (third + fourth)], axis=-1)) / DEG
    return found


def rms(values: FloatArray) -> float:
    """Return the root mean square, unit of `values`."""
    return float(np.sqrt(np.mean(np.square(values))))


def rmse(
    name: str, z: dict[str, FloatArray], rate: FloatArray, belief: dict[str, SensorBelief], **own: object
) -> float:
    """Return the error of a filter over the second half of a record from rest [deg/s]."""
    block = estimate(name, z, sample_rate_hz=RATES, belief=belief, start="rest", verdict=False, **own)
    return rms((block.rate - rate)[rate.size // 2 :]) / DEG


def fixed(log10_q: float, order: int = 3) -> dict[str, Any]:
    """Return the parameters of the fixed filter with q = 10^log10_q (deg/s)^2/s^(2 order - 1)."""
    return {"order": order, "q": 10.0**log10_q * DEG**2}


def best_fixed(errors: Callable[[float], FloatArray], log10_q: float) -> tuple[float, FloatArray]:
    """Return the log10 of q whose errors have the least root mean square, worse ones a quarter of a decade on either
    side of it, and the errors of its seeds.
    """
    known: dict[float, FloatArray] = {}
    for step in STEPS:
        best = None
        while best != log10_q:
            best, near = log10_q, (log10_q, log10_q - step, log10_q + step)
            known |= {one: errors(one) for one in near if one not in known}
            log10_q = min(near, key=lambda one: rms(known[one]))
    return log10_q, known[log10_q]


@dataclass(frozen=True)
class Judgement:
    """Errors of `wideband` and of the best fixed filter for one signal, root mean squares over all seeds [deg/s].

    `begin` and `end` say over which seconds of the records, `order_1` to `order_3` what the best fixed filter of that
    order has; `order` and `log10_q` are those of the best of all. `ratio` is error over error, `claim` what `wideband`
    claims over its error.
    """

    signal: str
    begin: float
    end: float
    seeds: int
    wideband: float
    largest: float
    order_1: float
    order_2: float
    order_3: float
    order: int
    log10_q: float
    ratio: float
    claim: float


def judge(
    label: str, seeds: Sequence[int], duration: float, start: str = "unknown", **own: float
) -> tuple[Judgement, Judgement]:
    """Judge the second quarter and the second half of one signal of `signals` over paired seeds from one start; `own`
    are parameters of `wideband`. What the fixed filter is was chosen on as many other seeds.
    """
    motions, decade = signals()[label]
    records, others = ([record(motions, duration, seed + step, start) for seed in seeds] for step in (0, TO_THE_OTHERS))
    mine = errors_and_claims("wideband", records, start, **own)

    @functools.cache
    def found(log10_q: float, order: int) -> FloatArray:
        return errors_and_claims("kalman", others, start, **fixed(log10_q, order))[:, 0]

    judgements = []
    for k, (begin, end) in enumerate(((0.25 * duration, 0.5 * duration), (0.5 * duration, duration))):
        ours, claims = mine[:, :, k].T
        first = {order: round(LOG10_S + (decade - LOG10_S) * order / 3) for order in ORDERS}
        best = {m: best_fixed(lambda q, m=m, k=k: found(q, m)[:, k], first[m]) for m in ORDERS}
        order = min(ORDERS, key=lambda m: rms(best[m][1]))
        theirs = {
            m: rms(errors_and_claims("kalman", records, start, **fixed(q, m))[:, 0, k]) for m, (q, _) in best.items()
        }
        error = rms(ours)
        figures = error, float(ours.max()), *theirs.values(), order, best[order][0], error / theirs[order]
        judgements.append(Judgement(label, begin, end, len(seeds), *figures, rms(claims) / error))
    return judgements[0], judgements[1]


def against_fixed(
    labels: Sequence[str], seeds: Sequence[int], duration: float, target: Path | None, start: str, own: dict[str, float]
) -> None:
    """Print two lines per signal, and write them to a file."""
    print(
        f"{'signal':>16}  seconds wideband  largest  order 1  order 2  order 3    order, q   ratio  claim   deg/s, "
        f"start {start}, {len(seeds)} seeds"
    )
    rows = []
    for label in labels:
        for row in judge(label, seeds, duration, start, **own):
            rows.append(asdict(row))
            met = row.ratio <= RATIO and CLAIM[0] <= row.claim <= CLAIM[1]
            met = met and (start == "unknown" or row.wideband <= TARGETS.get(label, np.inf))
            print(
                f"{label:>16}{f'{row.begin:g}-{row.end:g}':>9}{row.wideband:9.5f}{row.largest:9.5f}"
                f"{row.order_1:9.5f}{row.order_2:9.5f}{row.order_3:9.5f}{f'{row.order}, 1e{row.log10_q:g}':>12}"
                f"{row.ratio:8.3f}{row.claim:7.2f}   {'met' if met else 'MISSED'}",
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
    forced = rmse("kalman", readings(rate, 0, noise=False), rate, wrong, **fixed(decade))
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
    parser.add_argument("--full", action="store_true", help="ten seeds of 20 s, all signals")
    parser.add_argument("--seeds", type=int, help="how many")
    parser.add_argument(
        "--duration", type=float, help="of a record in s; judged are its second quarter and its second half"
    )
    parser.add_argument("--signals", nargs="+", choices=list(signals()), metavar="SIGNAL")
    parser.add_argument("--start", choices=("unknown", "rest"), default="unknown", help="of the records")
    parser.add_argument("--csv", type=Path, help="where to write the table")
    parser.add_argument("--filters", type=int, help="in the bank of `wideband`, over the same decades")
    parser.add_argument("--restart", type=float, help="of `wideband`; 1e12 is never")
    table = parser.add_mutually_exclusive_group()
    table.add_argument("--mismatch", action="store_true", help="print the table of wrong beliefs instead")
    table.add_argument("--change", action="store_true", help="print the table of signals that change instead")
    given = parser.parse_args()
    n_seeds, duration = FULL if given.full else SHORT
    seeds = range(FIRST_SEED, FIRST_SEED + (given.seeds or n_seeds))
    own = {key: value for key in ("filters", "restart") if (value := getattr(given, key)) is not None}
    if given.mismatch:
        under_mismatch(seeds)
    elif given.change:
        under_change(seeds, own)
    else:
        shown = given.signals or (list(signals()) if given.full else LOOK)
        against_fixed(shown, seeds, given.duration or duration, given.csv, given.start, own)


if __name__ == "__main__":
    main()
