"""Paper 1 repeated: Table II over seeds beside the paper's numbers, once more with defects in the sensors, and its
figures.

Su et al., IEEE Trans. Instrum. Meas. 2024, doi 10.1109/TIM.2024.3375962, Table II and, for the mixed signal, the text
of section IV.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from testbed.judging.bounds import Bounds
from testbed.metrics.errors import ErrorMetrics
from testbed.reproduce.paper1.defects import table_ii_defects
from testbed.reproduce.paper1.runs import FILTERS, SIGNALS, FusionProtocol, errors, outputs, presets, truth
from testbed.runs.atomic import write_text
from testbed.signals import BASE_RATE_HZ, sample_times

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from pathlib import Path

    from testbed.signals import FloatArray

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
COLUMNS = (
    "rmse_deg_s",
    "rmse_lowest_deg_s",
    "rmse_highest_deg_s",
    "rmse_aligned_deg_s",
    "paper_rmse_deg_s",
    "floor_rmse_deg_s",
    "optimum_rmse_deg_s",
)
# Of the floor, as in a scenario that states none [Hz].
BANDWIDTH_HZ = 1000.0


def report(seeds: int, out: Path, protocol: FusionProtocol | None = None) -> Iterator[str]:
    """Write both tables and all figures, and yield the tables and what was written, line by line.

    Parameters
    ----------
    seeds : int
        Seeds 1 to this [-].
    out : Path
        Folder to write to.
    protocol : FusionProtocol, optional
        Twenty seconds, judged from the tenth on, if not given.

    Yields
    ------
    str
        One line.
    """
    # Drawing is slow to import and nothing else here needs it.
    from testbed.reproduce.paper1.figures import write_figures

    protocol = protocol or FusionProtocol()
    yield f"moving the turntable: {', '.join(SIGNALS)}"
    rates = {signal: truth(signal, protocol) for signal in SIGNALS}
    yield from table_ii(rates, seeds, out, protocol)
    yield from table_ii_defects(rates, seeds, out, protocol)
    yield from write_figures(rates, out, protocol)


def table_ii(rates: Mapping[str, FloatArray], seeds: int, out: Path, protocol: FusionProtocol) -> Iterator[str]:
    """Write table_ii.csv and yield it line by line: medians over the seeds, lowest and highest RMSE, the paper's
    number, floor and optimum.

    The lines have floor and optimum as what the median is over them, the file in deg/s; they are those of filters.

    Parameters
    ----------
    rates : mapping of str to ndarray, shape (n_time,)
        True rate of each signal [rad/s].
    seeds : int
        Seeds 1 to this [-].
    out : Path
        Folder to write to.
    protocol : FusionProtocol
        Times of a run.

    Yields
    ------
    str
        One line.
    """
    rows, sensors, best = [], presets(), _bounds(rates, protocol)
    yield f"Table II: RMSE in deg/s, phase included; median over {seeds} seed(s)"
    headings = ("median", "lowest", "highest", "aligned", "paper", "x floor")
    yield f"{'':28s}{''.join(f'{heading:>10s}' for heading in headings)}{'x optimum':>11s}"
    for signal, rate in rates.items():
        runs = [errors(outputs(rate, seed, sensors), rate, signal, protocol) for seed in range(1, seeds + 1)]
        for name in runs[0]:
            found = *_statistics([run[name] for run in runs]), PAPER[signal].get(name)
            bounds = best[signal] if name in FILTERS else (None, None)
            rows.append((signal, name, *found, *bounds))
            floor, least = (_text(found[0] / bound if bound else None, 1) for bound in bounds)
            yield f"{signal:8s}{name:20s}" + "".join(f"{_text(v, 4):>10s}" for v in found) + f"{floor:>10s}{least:>11s}"
    text = "\n".join(
        ",".join(map(str, (signal, name, *(_text(v, 9) for v in values)))) for signal, name, *values in rows
    )
    write_text(out / "table_ii.csv", f"signal,name,{','.join(COLUMNS)}\n{text}\n")


def _bounds(rates: Mapping[str, FloatArray], protocol: FusionProtocol) -> dict[str, tuple[float, float]]:
    """Return floor and optimum of each signal [deg/s], of its lines as they are in the truth after settle."""
    sensors, first, lines = presets(), round(protocol.settle * BASE_RATE_HZ), []
    for signal, rate in rates.items():
        judged = ErrorMetrics([sine.frequency for sine in SIGNALS[signal]])
        judged.add(sample_times(first, rate.size - first, BASE_RATE_HZ), rate[first:], rate[first:])
        lines.append(judged.truth_lines())
    bounds = Bounds(sensors, {name: sensor.sample_rate for name, sensor in sensors.items()})
    floor, (best, _) = bounds.floor(BANDWIDTH_HZ), bounds.settled(lines)
    # Both sensors are rational and see every frequency between them.
    assert floor is not None
    assert best is not None
    return {
        signal: (float(np.rad2deg(floor)), float(np.rad2deg(one.rmse))) for signal, one in zip(rates, best, strict=True)
    }


def _statistics(runs: list[tuple[float, float]]) -> tuple[float, float, float, float]:
    rmse, aligned = np.array(runs).T
    return float(np.median(rmse)), float(rmse.min()), float(rmse.max()), float(np.median(aligned))


def _text(value: float | None, decimals: int) -> str:
    return "" if value is None else f"{value:.{decimals}f}"
