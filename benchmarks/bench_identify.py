"""What `testbed identify` promises: intervals that hold, noise refused, a dead time to 10 us, a belief that serves.

`python benchmarks/bench_identify.py [--runs N]` prints a row for each and exits with 1 if one is missed; 200 runs of
each take half an hour of CPU. Clocks are up to 2000 ppm off.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

import numpy as np
from promises import Promise, conclude
from scipy.stats import binom

sys.path.insert(0, str(Path(__file__).parents[1]))

import testbed
from testbed.fusion.belief import load_belief
from testbed.identification.belief_text import belief_text
from testbed.identification.model import fit_model
from testbed.identification.response import measure_response
from testbed.identification.session import identify_sensors
from testbed.logs.reader import read_log
from tests.identification.records import EXCITATIONS, record, rest

SCENARIOS = Path(__file__).parents[1] / "scenarios"
FILTERS = ("kalman", "wideband", "steady_state", "complementary")


def inside(name: str, runs: int) -> tuple[int, int]:
    """Return in how many records the true gain and phase of one frequency, another each time, are in the intervals."""
    hits = np.zeros(2, int)
    for seed in range(runs):
        one = record(EXCITATIONS[name], seed)
        found = measure_response(one.reference, one.output).response
        i = seed % found.freq_hz.size
        true = one.response(found.freq_hz)[i]
        off = abs(found.gain[i] - abs(true)), abs(np.angle(found.response[i] / true))
        hits += [error < half[i] for error, half in zip(off, found.half_widths, strict=True)]
    return int(hits[0]), int(hits[1])


def refused(runs: int) -> int:
    """Return in how many records of noise alone no response is found."""
    records = (record(rest, seed, reference_std=1e-5) for seed in range(runs))
    return sum(not measure_response(one.reference, one.output).response.freq_hz.size for one in records)


def delay_error(name: str, runs: int) -> float:
    """Return the largest error of the dead time [us] over records of 40 s."""
    errors = []
    for seed in range(runs):
        one = record(EXCITATIONS[name], 1000 + seed, length=40.0)
        errors.append(1e6 * abs(fit_model(measure_response(one.reference, one.output).response).delay - one.delay))
    return max(errors)


def worse(seeds: int) -> dict[str, float]:
    """Return how much larger the errors are with the written belief than with the exact one, rms over seeds."""
    with tempfile.TemporaryDirectory() as folder:
        run = Path(folder) / "run"
        testbed.run(SCENARIOS / "identification.yaml", out=run)
        outputs = ["sensors/mhd_ars/rate", "sensors/mems_gyro/rate"]
        log = read_log(run / "run.nc", {"channels": {name: {"column": name} for name in ("truth/rate", *outputs)}})
        written = Path(folder) / "belief.yaml"
        written.write_text(belief_text(identify_sensors(log, "truth/rate", outputs, one_clock=True), "a run"))
        believed = load_belief(str(written))
    mixed = testbed.load_scenario(SCENARIOS / "mixed_0p5hz_10hz.yaml").resolved()
    own = {
        key: one.model_dump(mode="json", context={"border": True}, exclude_none=True) for key, one in believed.items()
    }
    mixed["fusion"] = {f"{name}_exact": {"type": name, "belief": "exact"} for name in FILTERS} | {
        f"{name}_own": {"type": name, "belief": own} for name in FILTERS
    }
    mixed.pop("expect")
    found = testbed.evaluate(testbed.Scenario.from_dict(mixed), seeds=range(seeds))
    rms = {key: float(np.sqrt(np.mean([one.fusion[key].rmse_deg_s ** 2 for one in found]))) for key in mixed["fusion"]}
    return {name: rms[f"{name}_own"] / rms[f"{name}_exact"] for name in FILTERS}


def main() -> None:
    """Print the promises."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=200)
    runs = parser.parse_args().runs
    few = max(runs // 20, 2)
    low, high = binom.ppf([0.0035, 0.9965], runs, 0.95)
    promises = []
    for name in EXCITATIONS:
        for what, hits in zip(("gain", "phase"), inside(name, runs), strict=True):
            promises.append(Promise(f"{name}: {what} inside its 95 % interval, of {runs}", low, hits, at_most=False))
            promises.append(Promise(f"{name}: {what} inside its 95 % interval, of {runs}", high, hits))
        promises.append(Promise(f"{name}: dead time, largest error of {few} [us]", 10.0, delay_error(name, few)))
    promises.append(Promise(f"noise alone refused, of {runs}", runs, refused(runs), at_most=False))
    for name, ratio in worse(few).items():
        promises.append(Promise(f"{name}: error with the written belief over that with the true one", 1.1, ratio))
    conclude(*promises)


if __name__ == "__main__":
    main()
