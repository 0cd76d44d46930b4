"""N_k beside an indicator that does not see amplitude: a table of signals where N_k fails, and a figure over frequency
and amplitude.

Simulated `sx300` and `adis16505_filtered` with all their noise, belief `identified`, 6 s, medians of the second half.
A second table says how far the indicated frequency is off soon after a record has begun in mid-motion, beside a
bias of the gyro, and what a gyro with more noise than believed makes of it.
Run: ``python examples/frequency_indicator.py [FIGURE.png]`` (about 20 s)
"""

from __future__ import annotations

import argparse
import zlib
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from testbed.fusion.analysis.indicator import FrequencyIndicator
from testbed.fusion.bands import increment_variance
from testbed.fusion.belief import load_belief
from testbed.sensors import load_preset
from testbed.signals import random_stream
from testbed.units import DEG

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from testbed.signals import FloatArray

RATES = {"mhd_ars": 20_000.0, "mems_gyro": 2_000.0}
SENSORS = {"mhd_ars": load_preset("sx300"), "mems_gyro": load_preset("adis16505_filtered")}
BELIEF = load_belief("identified")
# Frequency [Hz] and amplitude [deg/s] of each line.
SIGNALS = {
    "standstill": [],
    "0.1 deg/s, 10 Hz": [(10.0, 0.1)],
    "1 deg/s, 0.5 Hz": [(0.5, 1.0)],
    "5 deg/s, 0.5 Hz": [(0.5, 5.0)],
    "1 deg/s, 2 Hz": [(2.0, 1.0)],
    "1 deg/s, 4 Hz": [(4.0, 1.0)],
    "1 deg/s, 10 Hz": [(10.0, 1.0)],
    "1 deg/s, 25 Hz": [(25.0, 1.0)],
    "1 deg/s, 100 Hz": [(100.0, 1.0)],
    "0.5 Hz and 0.18 at 10 Hz": [(0.5, 1.0), (10.0, 0.18)],
}
SWEEP_HZ = (0.2, 0.5, 1.0, 2.0, 4.0, 10.0, 25.0, 60.0, 150.0, 400.0)
AMPLITUDES = {0.1: "#8fbbe0", 1.0: "#1f6fb4", 10.0: "#0b2f52"}
# Of the second table: lines of 1 deg/s [Hz], seconds of the record [s], records, and the bias of the gyro [deg/s].
LINES_HZ, WINDOWS, RECORDS, BIAS = (0.1, 0.2, 0.5, 2.0, 10.0, 100.0), ((1, 2), (2, 3), (3, 5), (5, 12)), 4, 5.0
# Before a record begins, the sensors have seen the motion for this long [s].
RUN_UP = 2.0
# Root densities of the gyro's noise over the believed one.
NOISIER = (1.3, 1.6, 2.0)
PICTURE = Path(__file__).parents[1] / "docs" / "images" / "frequency_indicator.png"


def indicators(lines: list[tuple[float, float]], duration: float = 6.0) -> dict[str, float]:
    """Return N_k/dT [(deg/s)^2] of both sensors, and the frequencies [Hz] by increments of each and by both."""
    t = np.arange(round(duration * RATES["mhd_ars"])) / RATES["mhd_ars"]
    rate = DEG * sum((a * np.sin(2.0 * np.pi * f * t) for f, a in lines), np.zeros_like(t))
    seed = zlib.crc32(repr(lines).encode())
    z = {name: sensor.sample(rate, RATES["mhd_ars"], seed) for name, sensor in SENSORS.items()}
    found = FrequencyIndicator(BELIEF, RATES).process(z)
    row = {f"N_{name}": increment_variance(z[name][z[name].size // 2 :]) / DEG**2 for name in SENSORS}
    for name, values in {**found.by_increments, "both": found.by_sensors}.items():
        later = values[values.size // 2 :]
        row[f"f_{name}"] = float(np.median(later)) if np.isfinite(later).all() else np.nan
    return row


def alone(
    lines: list[tuple[float, float]], seed: int, *, bias: float = 0.0, noise: float = 1.0
) -> dict[str, FloatArray]:
    """Return the frequencies [Hz] of each sensor alone over a record of 12 s that begins in mid-motion, its gyro with a
    bias [deg/s] and `noise` times the believed white noise.
    """
    duration = RUN_UP + WINDOWS[-1][1]
    t = np.arange(round(duration * RATES["mhd_ars"])) / RATES["mhd_ars"]
    phases = 2.0 * np.pi * random_stream(seed, "phases").random(len(lines))
    parts = (a * np.sin(2.0 * np.pi * f * t + p) for (f, a), p in zip(lines, phases, strict=True))
    rate = DEG * sum(parts, np.zeros_like(t))
    gyro = SENSORS["mems_gyro"]
    louder = gyro.model_copy(update={"angle_random_walk": noise * gyro.angle_random_walk})
    z = {
        name: sensor.sample(rate, RATES["mhd_ars"], seed)[round(RUN_UP * RATES[name]) :]
        for name, sensor in {**SENSORS, "mems_gyro": louder}.items()
    }
    z["mems_gyro"] += bias * DEG
    return FrequencyIndicator(BELIEF, RATES).process(z).by_increments


def farthest(freq: float, **gyro: float) -> dict[str, list[float]]:
    """Return for each sensor how far [%] a line of 1 deg/s is indicated off in 99 of 100 readings of each window."""
    records = [alone([(freq, 1.0)], seed, **gyro) for seed in range(RECORDS)]
    return {
        name: [
            100.0
            * np.nanpercentile([np.abs(one[name][round(a * fs) : round(b * fs)] / freq - 1.0) for one in records], 99)
            for a, b in WINDOWS
        ]
        for name, fs in RATES.items()
    }


def draw() -> Figure:
    """Return the figure: N_k of both sensors above, the indicators below, over the frequency of a sine of three
    amplitudes.
    """
    figure = Figure(figsize=(9.0, 6.4), dpi=160, layout="constrained")
    (gyro, mhd), (one, both) = figure.subplots(2, 2, sharex=True, sharey="row")
    for amplitude, color in AMPLITUDES.items():
        rows = [indicators([(f, amplitude)]) for f in SWEEP_HZ]
        style = {"color": color, "marker": "o", "markersize": 4, "linewidth": 1.4, "label": f"{amplitude:g} deg/s"}
        for axes, key in ((gyro, "N_mems_gyro"), (mhd, "N_mhd_ars"), (one, "f_mhd_ars"), (both, "f_both")):
            axes.loglog(SWEEP_HZ, [row[key] for row in rows], **style)
    for axes, title in (
        (gyro, "$N_k/T$ of the gyro"),
        (mhd, "$N_k/T$ of the MHD ARS"),
        (one, "by increments of the MHD ARS"),
        (both, "by comparing both sensors"),
    ):
        _finish(axes, title)
    gyro.set_ylabel("(deg/s)$^2$")
    one.set_ylabel("indicated frequency [Hz]")
    for axes in (one, both):
        axes.set_xlabel("true frequency [Hz]")
    return figure


def _finish(axes: Axes, title: str) -> None:
    axes.set_title(title, loc="left", fontsize=10)
    axes.grid(visible=True, which="major", color="#d5d9de", linewidth=0.7)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(frameon=False, fontsize=8.5)


def main() -> None:
    """Print the table and draw the figure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("figure", nargs="?", type=Path, default=PICTURE, help="where to write it (%(default)s)")
    target = parser.parse_args().figure
    print(f"{'':26}N_k/T, (deg/s)^2     frequency, Hz, by increments   by both")
    print(f"{'signal':26}{'gyro':>9}{'MHD':>10}{'gyro':>12}{'MHD':>12}{'sensors':>16}")
    for label, lines in SIGNALS.items():
        row = indicators(lines)
        print(
            f"{label:26}{row['N_mems_gyro']:9.1e}{row['N_mhd_ars']:10.2e}"
            f"{row['f_mems_gyro']:12.3f}{row['f_mhd_ars']:12.3f}{row['f_both']:16.3f}"
        )
    print(f"\noff by, %, in 99 of 100 readings of {RECORDS} records from mid-motion; bias of the gyro {BIAS:g} deg/s")
    print(f"{'signal':26}{'sensor':12}" + "".join(f"{f'{a}-{b} s':>10}" for a, b in WINDOWS))
    for freq in LINES_HZ:
        for name, off in farthest(freq, bias=BIAS).items():
            print(f"{f'1 deg/s, {freq:g} Hz':26}{name:12}" + "".join(f"{one:10.1f}" for one in off))
    print("\na gyro with more white noise than believed: indicated at a standstill, and of 1 deg/s at 0.5 Hz, Hz")
    for noise in NOISIER:
        rest, slow = (np.median(alone(lines, 0, noise=noise)["mems_gyro"][-4000:]) for lines in ([], [(0.5, 1.0)]))
        print(f"{f'{noise:g} times the density':26}{rest:12.1f}{slow:12.2f}")
    target.parent.mkdir(parents=True, exist_ok=True)
    draw().savefig(target)
    print(f"wrote {target}")


if __name__ == "__main__":
    main()
