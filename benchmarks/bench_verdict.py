"""Bars of the verdict before the estimate: planted faults are named, right records are left in peace.

    python benchmarks/bench_verdict.py [SEEDS]

Each fault under 20 seeds, named alone in at least 19; the scenarios of the repository, 100 records, at most one of them
with a finding. Exits with 1 if a bar is missed. Scenarios in which something is wrong on purpose are left out: a gyro
with scale, bias and lost readings (`gyro_errors`) and a warm magnet (`mhd_warm_electronics`).
"""

from __future__ import annotations

import math
import sys
import time
from pathlib import Path

import numpy as np
from promises import Promise, conclude

sys.path.insert(0, str(Path(__file__).parents[1]))

from testbed.campaigns.many import ManySensors
from testbed.chain.pipeline import block_lengths
from testbed.chain.truth import Truth
from testbed.fusion.analysis.remedy import remedied
from testbed.fusion.analysis.verdict import verdict
from testbed.fusion.belief import load_belief
from testbed.scenario.loader import as_scenario

SCENARIOS = Path(__file__).parents[1] / "scenarios"
RIGHT = (
    *("static", "static_allan", "single_0p5hz", "single_4hz", "single_10hz", "mixed_0p5hz_10hz", "chirp_0p1_to_25hz"),
    *("satellite_microvibration", "wideband_jitter", "disturbed_table", "paper1/paper1_sweep"),
    *("paper2/following_5hz", "pointing/wheel_ramp"),
)
MIXED, FOUR = ((0.5, 1.0), (10.0, 0.18)), ((4.0, 1.0),)
PPM, LATE, UNIT = 1852e-6, 0.02, math.degrees(1.0)


def table(lines, duration, gyro="adis16505_filtered"):
    """Return a scenario of lines (frequency [Hz], amplitude [deg/s]) on a table without dynamics."""
    motion = [{"sine": {"frequency": f"{f} Hz", "rate": f"{amplitude} deg/s"}} for f, amplitude in lines]
    sensors = {"mhd_ars": {"preset": "sx300"}, "mems_gyro": {"preset": gyro}}
    frame = {"name": "lines", "seed": 1, "duration": f"{duration} s", "settle": "1 s"}
    return as_scenario({**frame, "turntable": {"mode": "ideal"}, "motion": motion, "sensors": sensors})


def records(scenario, seeds):
    """Return the readings and stamps of each seed."""
    truth = Truth(scenario.with_seed(seeds[0]))
    many = {name: ManySensors(scenario, name, seeds) for name in scenario.sensors}
    blocks = {seed: {name: [] for name in many} for seed in seeds}
    for n_time in block_lengths(scenario):
        _, block = truth.process(n_time)
        for name, sensor in many.items():
            sensor.take(block)
            for seed, z in zip(seeds, sensor.readings(seeds), strict=True):
                blocks[seed][name].append(z.copy())
    found = []
    for one in blocks.values():
        readings = {name: np.concatenate(parts) for name, parts in one.items()}
        steps = {name: 1e9 / scenario.sensors[name].sample_rate for name in readings}
        found.append(
            (
                readings,
                {name: np.rint(np.arange(z.size) * steps[name]).astype(np.int64) for name, z in readings.items()},
            )
        )
    return found


def belief_of(scenario):
    """Return what the scenario's filters believe."""
    return dict(next(iter(scenario.fusion.values())).belief) if scenario.fusion else load_belief("eq39")


def named(found, kinds):
    """Return the first finding of these kinds."""
    return next((one for one in found.findings if one.kind in kinds), None)


def faults(seeds):
    """Yield name, how many seeds name it, and how many close enough."""
    eq39 = load_belief("eq39")
    for label, lines in (("mixed", MIXED), ("4 Hz", FOUR)):
        played = records(table(lines, 30.0), seeds)
        cases = {
            "sign": (("sign",), lambda z: -z, lambda t: t, None, 0.0),
            "deg/s": (("unit",), lambda z: UNIT * z, lambda t: t, UNIT, 1e-9),
            "20 ms": (("offset",), lambda z: z, lambda t: t + round(LATE * 1e9), LATE, 0.2e-3),
            "1852 ppm": (("rate",), lambda z: z, lambda t: np.rint(t * (1.0 + PPM)).astype(np.int64), PPM, 20e-6),
        }
        for name, (kinds, value, stamp, wanted, close) in cases.items():
            hits = near = clean = 0
            for readings, stamps in played:
                spoilt = readings | {"mems_gyro": value(readings["mems_gyro"])}
                moved = stamps | {"mems_gyro": stamp(stamps["mems_gyro"])}
                found = verdict(spoilt, moved, eq39)
                one = named(found, kinds)
                hits += one is not None and one.sensor == "mems_gyro" and len(found.findings) == 1
                near += one is not None and (wanted is None or abs(one.value - wanted) <= close)
                again = remedied(spoilt, moved, found)
                clean += not verdict(again.readings, again.time_ns, eq39).findings
            yield f"{name}, {label}", hits, near, clean
    for label, lines in (("mixed", MIXED), ("4 Hz", FOUR)):
        hits = sum(
            named(verdict(*one, eq39), ("bandwidth",)) is not None
            for one in records(table(lines, 20.0, gyro="adis16505"), seeds)
        )
        yield f"wide gyro, {label}", hits, hits, hits
    others = records(table(((9.0, 0.1),), 20.0), seeds)
    for label, lines in (("mixed", MIXED), ("4 Hz", FOUR)):
        hits = 0
        for (readings, stamps), (other, _) in zip(records(table(lines, 20.0), seeds), others, strict=True):
            found = verdict(readings | {"mems_gyro": other["mems_gyro"]}, stamps, eq39)
            hits += [one.kind for one in found.findings] == ["axis"]
        yield f"another axis, {label}", hits, hits, hits


def main() -> None:
    """Print one line for each bar, and the promises."""
    seeds = list(range(1, (int(sys.argv[1]) if len(sys.argv) > 1 else 20) + 1))
    promises, least = [], math.floor(0.95 * len(seeds))
    for name, hits, near, clean in faults(seeds):
        what = f"verdict: {name} named alone and close enough, of {len(seeds)} records"
        promises.append(Promise(what, least, min(hits, near), at_most=False))
        print(
            f"{name}: named alone {hits}, close enough {near}, nothing left once fixed {clean}, of {len(seeds)}",
            flush=True,
        )
    each = max(1, round(100 * len(seeds) / 20 / len(RIGHT) + 0.3))
    false = count = 0
    for name in RIGHT:
        scenario = as_scenario(SCENARIOS / f"{name}.yaml").with_(**{"turntable.engine": "auto"})
        begin, said = time.process_time(), []
        for readings, stamps in records(scenario, list(range(1, each + 1))):
            found = verdict(readings, stamps, belief_of(scenario))
            said += [str(one) for one in found.findings]
            false += bool(found.findings)
            count += 1
        print(
            f"right: {name}: {len(said)} findings in {each} ({time.process_time() - begin:.1f} s)",
            *said,
            sep="\n  ",
            flush=True,
        )
    print(f"right records with a finding: {false} of {count}")
    promises.append(Promise(f"verdict: right records with a finding, of {count}", max(1, count // 100), false))
    conclude(*promises)


if __name__ == "__main__":
    main()
