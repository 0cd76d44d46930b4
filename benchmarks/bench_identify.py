"""What `testbed identify` promises: intervals that hold, noise refused, a dead time to 10 us, a belief that serves.

`python benchmarks/bench_identify.py [PART ...] [--runs N]` prints a row for each promise and exits with 1 if one is
missed; a part is a kind of motion, `rest` or `belief`, by default all. Clocks are up to 2000 ppm off.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from promises import Promise, conclude
from scipy.stats import binom
from scipy.stats import t as student

sys.path.insert(0, str(Path(__file__).parents[1]))

import testbed
from testbed.fusion.belief import load_belief
from testbed.identification.belief_text import belief_text
from testbed.identification.model import fit_model
from testbed.identification.response import measure_response
from testbed.identification.session import identify_sensors
from testbed.logs.reader import read_log
from tests.identification.records import EXCITATIONS, record, rest

if TYPE_CHECKING:
    from collections.abc import Iterator

    from testbed.signals import FloatArray

SCENARIOS = Path(__file__).parents[1] / "scenarios"
FILTERS = ("kalman", "wideband", "steady_state", "complementary")


def inside(name: str, runs: int) -> FloatArray:
    """Return in how many records the true gain and the true phase are in their intervals, of each record the share of
    its frequencies; one that is given no response, as where the clock was not found, counts for none.
    """
    share, square = np.zeros(2), []
    for seed in range(runs):
        one = record(EXCITATIONS[name], seed)
        found = measure_response(one.reference, one.output).response
        if not found.freq_hz.size:
            print(f"{name} {seed}: no response", flush=True)
            continue
        true = one.response(found.freq_hz)
        off = np.stack([found.gain - abs(true), np.angle(found.response / true)]) / found.half_widths
        share += np.mean(np.abs(off) < 1.0, axis=1)
        square.append(np.mean((off * student.ppf(0.975, 2.0 * found.freedom)) ** 2, axis=1))
        law = np.mean(found.freedom / (found.freedom - 1.0))
    gain, phase = np.mean(square, axis=0)
    print(f"{name}: mean square of the errors over their variances {gain:.3f}, {phase:.3f}; Student's law {law:.3f}")
    return share


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


def written(seed: int, folder: Path) -> dict[str, object]:
    """Return the belief that a record of a seed gives, as a scenario has it."""
    told = testbed.load_scenario(SCENARIOS / "identification.yaml").resolved()
    told |= {"seed": seed, "fusion": {}}
    told.pop("expect")
    run = folder / f"run_{seed}"
    testbed.run(testbed.Scenario.from_dict(told), out=run, outputs=["netcdf"])
    outputs = ["sensors/mhd_ars/rate", "sensors/mems_gyro/rate"]
    log = read_log(run / "run.nc", {"channels": {name: {"column": name} for name in ("truth/rate", *outputs)}})
    belief = folder / f"belief_{seed}.yaml"
    belief.write_text(belief_text(identify_sensors(log, "truth/rate", outputs, one_clock=True), "a run"))
    return {
        key: one.model_dump(mode="json", context={"border": True}, exclude_none=True)
        for key, one in load_belief(str(belief)).items()
    }


def squares(records: int, seeds: int) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Return the mean square errors of each filter with the exact belief, shape (n_seed,), and on the same readings
    with that of each record, shape (n_record, n_seed) [(deg/s)^2].
    """
    with tempfile.TemporaryDirectory() as folder:
        believed = [written(100 + i, Path(folder)) for i in range(records)]
    mixed = testbed.load_scenario(SCENARIOS / "mixed_0p5hz_10hz.yaml").resolved()
    mixed.pop("expect")
    mixed["fusion"] = {f"{name}_exact": {"type": name, "belief": "exact"} for name in FILTERS} | {
        f"{name}_{i}": {"type": name, "belief": own} for name in FILTERS for i, own in enumerate(believed)
    }
    found = testbed.evaluate(testbed.Scenario.from_dict(mixed), seeds=range(seeds))
    rms = {key: np.array([one.fusion[key].rmse_deg_s for one in found]) for key in mixed["fusion"]}
    return {
        name: (rms[f"{name}_exact"] ** 2, np.array([rms[f"{name}_{i}"] for i in range(records)]) ** 2)
        for name in FILTERS
    }


def worse(exact: np.ndarray, own: np.ndarray) -> tuple[float, float, float]:
    """Return how much larger the errors are with written beliefs than with the exact one, root mean squares over
    records and seeds, and the ends of its 95 % interval by drawing both again.
    """
    rng = np.random.default_rng(1)
    drawn = []
    for _ in range(2000):
        record, seed = (rng.integers(0, n, n) for n in own.shape)
        drawn.append(np.sqrt(own[record][:, seed].mean() / exact[seed].mean()))
    low, high = np.quantile(drawn, [0.025, 0.975])
    return float(np.sqrt(own.mean() / exact.mean())), float(low), float(high)


def kind_of_motion(name: str, runs: int) -> Iterator[Promise]:
    """Yield what is promised of a kind of motion."""
    low, high = binom.ppf([0.0035, 0.9965], runs, 0.95)
    for what, hits in zip(("gain", "phase"), inside(name, runs).tolist(), strict=True):
        yield Promise(f"{name}: {what} inside its 95 % interval, of {runs}", low, hits, at_most=False)
        yield Promise(f"{name}: {what} inside its 95 % interval, of {runs}", high, hits)
    few = max(runs // 20, 2)
    yield Promise(f"{name}: dead time, largest error of {few} [us]", 10.0, delay_error(name, few))


def noise_alone(runs: int) -> Iterator[Promise]:
    """Yield what is promised of records without motion."""
    yield Promise(f"noise alone refused, of {runs}", runs, refused(runs), at_most=False)


def beliefs(runs: int) -> Iterator[Promise]:
    """Yield what is promised of the beliefs written, of a record for fifty runs and four seeds for a record."""
    records = max(runs // 50, 2)
    for name, (exact, own) in squares(records, 4 * records).items():
        ratio, low, high = worse(exact, own)
        each = np.sqrt(own.mean(axis=1) / exact.mean())
        print(f"{name}: {ratio:.3f} ({low:.3f} to {high:.3f}), by record {np.round(each, 3).tolist()}", flush=True)
        yield Promise(f"{name}: error with the written belief over that with the true one", 1.1, ratio)


PARTS = {
    **{name: partial(kind_of_motion, name) for name in EXCITATIONS},
    "rest": noise_alone,
    "belief": beliefs,
}


def main() -> None:
    """Print the promises."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("parts", nargs="*", metavar="PART", help=", ".join(PARTS))
    parser.add_argument("--runs", type=int, default=200)
    given = parser.parse_args()
    if unknown := set(given.parts) - set(PARTS):
        parser.error(f"expected parts of {', '.join(PARTS)}, got {', '.join(unknown)}")
    conclude(*(one for part in given.parts or PARTS for one in PARTS[part](given.runs)))


if __name__ == "__main__":
    main()
