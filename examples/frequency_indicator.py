"""N_k beside an indicator that does not see amplitude: a table of signals where N_k fails, and a figure over frequency
and amplitude.

Simulated `sx300` and `adis16505_filtered` with all their noise, belief `identified`, 6 s, medians of the second half.
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
from testbed.units import DEG

if TYPE_CHECKING:
    from matplotlib.axes import Axes

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
    target.parent.mkdir(parents=True, exist_ok=True)
    draw().savefig(target)
    print(f"wrote {target}")


if __name__ == "__main__":
    main()
