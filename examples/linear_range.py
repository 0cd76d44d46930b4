"""Where the linear channel holds: by what the secondary flow changes the reading, over frequency and amplitude.

Left the channel of the preset sx300, right a weakly braked one (10 mm, 0.036 T). The line of a sine is compared between
the flows `similarity` and `linear`. Run: `python examples/linear_range.py [FIGURE.png]`
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from testbed.models.mhd_channel.channel import MhdChannel
from testbed.models.mhd_channel.linear_range import linear_range

if TYPE_CHECKING:
    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]

PICTURE = Path(__file__).parents[1] / "docs" / "images" / "linear_range.png"
CHANNELS = {
    "sx300: 15 mm, 0.448 T": MhdChannel(fluid="mercury", height=15e-3, field=0.448, nodes=64),
    "weakly braked: 10 mm, 0.036 T": MhdChannel(fluid="mercury", height=10e-3, field=0.036, nodes=64),
}
RATES = (1.0, 10.0, 30.0, 50.0)  # deg/s
COLORS = ("#8fb8de", "#1f6fb4", "#c2552d", "#6b2d5c")
PER_PERIOD, PERIODS, JUDGED = 1000, 20, 4


def departure(channel: MhdChannel, freq_hz: float, rate: float) -> complex:
    """Return by what the line of a sine of `rate` [rad/s] departs from the linear channel's, over that line [-]."""
    turns = 2.0 * np.pi * np.arange(PERIODS * PER_PERIOD + 1) / PER_PERIOD
    late = slice(-JUDGED * PER_PERIOD, None)
    lines = []
    for flow in ("similarity", "linear"):
        slip = channel.model_copy(update={"flow": flow}).simulate(rate * np.sin(turns), freq_hz * PER_PERIOD)
        lines.append(np.mean(slip[late] * np.exp(-1j * turns[late])))
    return complex(lines[0] / lines[1] - 1.0)


def curve(channel: MhdChannel, freq_hz: FloatArray, rate_deg_s: float) -> FloatArray:
    """Return the size of the departure at every frequency, shape (n_freq,) [-]."""
    return np.array([abs(departure(channel, f, np.radians(rate_deg_s))) for f in freq_hz])


def draw(curves: dict[str, list[FloatArray]], freq_hz: FloatArray) -> Figure:
    """Return a panel per channel; dashed where `check` says that the linear range is left."""
    figure = Figure(figsize=(8.4, 3.8), dpi=200, layout="constrained")
    for axes, (name, found) in zip(figure.subplots(1, 2, sharex=True, sharey=True), curves.items(), strict=True):
        for values, rate, color in zip(found, RATES, COLORS, strict=True):
            peak = np.radians(rate)
            within = np.array([linear_range(CHANNELS[name], peak, peak / (2 * np.pi * f)).holds for f in freq_hz])
            axes.loglog(freq_hz, values, color=color, linewidth=1.0, dashes=(3, 1.5))
            axes.loglog(freq_hz, np.where(within, values, np.nan), color=color, linewidth=1.8, label=f"{rate:g} deg/s")
        axes.set_title(name, loc="left", fontsize=10)
        axes.set_xlabel("frequency [Hz]")
        axes.grid(visible=True, which="major", color="#d5d9de", linewidth=0.7)
        axes.spines[["top", "right"]].set_visible(False)
        axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{100 * value:.15g} %"))
        axes.set_xlim(freq_hz[0], freq_hz[-1])
        axes.set_ylim(1e-9, 0.2)
        if axes.get_subplotspec().is_first_col():  # type: ignore[union-attr]
            axes.set_ylabel("departure from the linear channel")
            axes.legend(frameon=False, fontsize=8.5)
    return figure


def main() -> None:
    """Print the departure at a few frequencies and amplitudes and draw the figure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("figure", nargs="?", type=Path, default=PICTURE, help="where to write it (%(default)s)")
    target = parser.parse_args().figure
    for name, channel in CHANNELS.items():
        print(f"{name}\nfrequency Hz  rate deg/s  departure %  phase deg  of the reading deg/s")
        for freq in (0.1, 0.5, 2.5, 10.0):
            reading = abs(channel.response(freq))
            for rate in RATES[-2:]:
                off = departure(channel, freq, np.radians(rate))
                phase = np.degrees(np.angle(1.0 + off))
                print(
                    f"{freq:12g}  {rate:10g}  {100 * abs(off):11.5f}  {phase:9.5f}  {abs(off) * reading * rate:20.6f}"
                )
    freq = np.geomspace(0.02, 10.0, 28)
    curves = {name: [curve(channel, freq, rate) for rate in RATES] for name, channel in CHANNELS.items()}
    target.parent.mkdir(parents=True, exist_ok=True)
    draw(curves, freq).savefig(target)
    print(f"wrote {target}")


if __name__ == "__main__":
    main()
