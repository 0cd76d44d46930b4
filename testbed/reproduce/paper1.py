"""Paper 1's Table II on the simulated table and sensors: complex and aligned RMSE of sensors and filters, over seeds.

Su et al., IEEE Trans. Instrum. Meas. 2024, doi 10.1109/TIM.2024.3375962, Table II and, for the mixed signal, the text of section IV. The
table moves once per signal (the truth does not depend on the seed); the sensors read it anew for every seed, and every filter has one
parameter set, its default, and believes in equation (39).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from testbed.fusion import estimate
from testbed.metrics import ErrorMetrics
from testbed.models.motion import MotionProfile
from testbed.models.motions.sine import Sine
from testbed.models.turntable import Mounting, Turntable, TurntableParameters
from testbed.sensors import load_preset
from testbed.signals import random_stream, sample_times
from testbed.store import write_text

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from testbed.signals import FloatArray

BASE_HZ = 20_000.0
DEG = np.pi / 180.0
SENSORS = {"mems_gyro": "adis16505_filtered", "mhd_ars": "sx300"}
FILTERS = ("kalman", "shakf", "arw_shakf", "arw_shakf_literal")
SIGNALS = {
    "0.5 Hz": (Sine(frequency=0.5, rate=DEG),),
    "4 Hz": (Sine(frequency=4.0, rate=DEG),),
    "10 Hz": (Sine(frequency=10.0, rate=DEG),),
    "mixed": (Sine(frequency=0.5, angle=5.555e-3), Sine(frequency=10.0, angle=50e-6)),
}
# RMSE in deg/s. The paper's "proposed" filter is beside both of our forms of it.
PAPER: dict[str, dict[str, float]] = {
    "0.5 Hz": {
        "mems_gyro": 0.0315,
        "mhd_ars": 0.5650,
        "shakf": 0.0108,
        "arw_shakf": 0.0098,
        "arw_shakf_literal": 0.0098,
    },
    "4 Hz": {"mems_gyro": 0.0120, "mhd_ars": 0.0091, "shakf": 0.1831, "arw_shakf": 0.0071, "arw_shakf_literal": 0.0071},
    "10 Hz": {
        "mems_gyro": 0.4820,
        "mhd_ars": 0.0085,
        "shakf": 0.3428,
        "arw_shakf": 0.0039,
        "arw_shakf_literal": 0.0039,
    },
    "mixed": {"shakf": 0.1482, "arw_shakf": 0.0143, "arw_shakf_literal": 0.0143},
}
COLUMNS = ("rmse_deg_s", "rmse_lowest_deg_s", "rmse_highest_deg_s", "rmse_aligned_deg_s", "paper_rmse_deg_s")


@dataclass(frozen=True)
class Protocol:
    """Times of a run [s]: its length, and where the metrics start.

    Parameters
    ----------
    duration, settle : float
        [s].
    """

    duration: float = 20.0
    settle: float = 10.0


def truth(signal: str, protocol: Protocol) -> FloatArray:
    """Return the inertial rate of the table under its servo [rad/s], shape (n_time,), at 20 kHz.

    Parameters
    ----------
    signal : str
        One of `SIGNALS`.
    protocol : Protocol
        Its length.
    """
    terms = [sine.start(protocol.duration, random_stream(0, "motion")) for sine in SIGNALS[signal]]
    table = Turntable(TurntableParameters(), {"mhd_ars": Mounting()}, BASE_HZ)
    motion, seconds = MotionProfile(terms, 0.5, BASE_HZ), round(protocol.duration)
    return np.concatenate([table.process(motion.process(round(BASE_HZ))).rate for _ in range(seconds)])


def errors(rate: FloatArray, signal: str, seed: int, protocol: Protocol) -> dict[str, tuple[float, float]]:
    """Return complex and aligned RMSE [deg/s] of every sensor and filter for one seed.

    Parameters
    ----------
    rate : ndarray, shape (n_time,)
        True rate [rad/s].
    signal : str
        One of `SIGNALS`.
    seed : int
        Seed of the noise.
    protocol : Protocol
        Its times.
    """
    sensors = {name: load_preset(preset) for name, preset in SENSORS.items()}
    rates = {name: sensor.sample_rate for name, sensor in sensors.items()}
    outputs = {name: sensor.start(BASE_HZ, seed, name).process(rate) for name, sensor in sensors.items()}
    readings = dict(outputs)
    outputs |= {name: estimate(name, readings, sample_rate_hz=rates).rate for name in FILTERS}
    lines = [sine.frequency for sine in SIGNALS[signal]]
    found = {}
    for name, values in outputs.items():
        own_rate = rates.get(name, BASE_HZ)
        metrics, first = ErrorMetrics(lines), round(protocol.settle * own_rate)
        of_truth = rate[:: round(BASE_HZ / own_rate)]
        metrics.add(sample_times(first, values.size - first, own_rate), values[first:], of_truth[first:])
        result = metrics.result()
        found[name] = result["rmse_deg_s"], result["rmse_aligned_deg_s"]
    return found


def report(seeds: int, out: Path, protocol: Protocol | None = None) -> Iterator[str]:
    """Write table_ii.csv and yield it line by line: medians over the seeds, lowest and highest RMSE, and the paper's number.

    Parameters
    ----------
    seeds : int
        Seeds 1 to this [-].
    out : Path
        Folder to write to.
    protocol : Protocol, optional
        Twenty seconds, judged from the tenth on, if not given.

    Yields
    ------
    str
        One line.
    """
    protocol = protocol or Protocol()
    rows = []
    yield f"Table II: RMSE in deg/s, phase included; median over {seeds} seed(s)"
    yield f"{'':8s}{'':20s}{'median':>10s}{'lowest':>10s}{'highest':>10s}{'aligned':>10s}{'paper':>10s}"
    for signal in SIGNALS:
        rate = truth(signal, protocol)
        runs = [errors(rate, signal, seed, protocol) for seed in range(1, seeds + 1)]
        for name in runs[0]:
            rows.append((signal, name, *_statistics([run[name] for run in runs]), PAPER[signal].get(name)))
            yield f"{signal:8s}{name:20s}" + "".join(f"{_text(value, 4):>10s}" for value in rows[-1][2:])
    text = "\n".join(
        ",".join(map(str, (signal, name, *(_text(v, 9) for v in values)))) for signal, name, *values in rows
    )
    write_text(out / "table_ii.csv", f"signal,name,{','.join(COLUMNS)}\n{text}\n")


def _statistics(runs: list[tuple[float, float]]) -> tuple[float, float, float, float]:
    rmse, aligned = np.array(runs).T
    return float(np.median(rmse)), float(rmse.min()), float(rmse.max()), float(np.median(aligned))


def _text(value: float | None, decimals: int) -> str:
    return "" if value is None else f"{value:.{decimals}f}"
