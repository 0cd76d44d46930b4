"""Figure 2 of Su et al. 2024: how far a mercury channel's reading is off, by the paper's one mode and by its full
equation.

Above, the error of the reading against the wall's rate for the paper's two fields; below, what the one-mode form (4)
itself gets wrong. Run: `python examples/one_mode_error.py [FIGURE.png]`
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator

from testbed.models.mhd_channel.channel import MhdChannel, one_mode_response

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

HEIGHT = 10e-3  # m; assumed: with 0.036 T it makes the paper's "a about 0.1 1/s"
FIELDS_T = (0.036, 0.1)
COLORS = ("#1f6fb4", "#c2552d")
PICTURE = Path(__file__).parents[1] / "docs" / "images" / "one_mode_error.png"
STYLE = {"linewidth": 1.6, "solid_capstyle": "round"}


@dataclass(frozen=True)
class Curves:
    """Errors of one channel over frequency, as fractions of the wall's amplitude."""

    field: float
    rate: float
    reading_one_mode: NDArray[np.float64]
    reading: NDArray[np.float64]
    approximation: NDArray[np.float64]


def error_curves(field: float, freq_hz: NDArray[np.float64], height: float = HEIGHT) -> Curves:
    """Return the errors at `field` [T]: |H_1 - 1| = a/sqrt(w^2 + a^2) of (6), |H - 1| of the whole, |H_1 - H|."""
    channel = MhdChannel(fluid="mercury", height=height, field=field)
    one_mode, full = one_mode_response(channel, freq_hz), channel.response(freq_hz)
    rate = np.pi**2 * channel.fluid.kinematic_viscosity / height**2 + channel.braking_rate
    return Curves(field, rate, np.abs(one_mode - 1.0), np.abs(full - 1.0), np.abs(one_mode - full))


def draw(curves: list[Curves], freq_hz: NDArray[np.float64]) -> Figure:
    """Return the figure of two panels over a common frequency axis."""
    figure = Figure(figsize=(7.0, 6.4), dpi=200, layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    for curve, color in zip(curves, COLORS, strict=True):
        name = f"{curve.field:g} T (a = {curve.rate:.2g} s$^{{-1}}$)"
        upper.loglog(freq_hz, curve.reading, color=color, label=f"{name}, full equation (2)", **STYLE)
        upper.loglog(freq_hz, curve.reading_one_mode, color=color, dashes=(4, 1.6), label=f"{name}, one mode (4), (6)")
        lower.loglog(freq_hz, curve.approximation, color=color, label=name, **STYLE)
    upper.set_ylabel("error of the reading $|H - 1|$")
    lower.set_ylabel("error of the one-mode form $|H_1 - H|$")
    lower.set_xlabel("frequency [Hz]")
    upper.set_title(f"Mercury, height {1e3 * HEIGHT:g} mm, closure 'local'", loc="left", fontsize=10)
    lower.set_xlim(freq_hz[0], freq_hz[-1])
    for axes in (upper, lower):
        _finish(axes)
    return figure


def _finish(axes: Axes) -> None:
    axes.grid(visible=True, which="major", color="#d5d9de", linewidth=0.7)
    axes.grid(visible=True, which="minor", color="#eceef1", linewidth=0.5)
    axes.spines[["top", "right"]].set_visible(False)
    axes.yaxis.set_major_locator(LogLocator(base=10))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{100 * value:g} %"))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.legend(frameon=False, fontsize=8.5)


def main() -> None:
    """Print the errors at a few frequencies and draw the figure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("figure", nargs="?", type=Path, default=PICTURE, help="where to write it (%(default)s)")
    target = parser.parse_args().figure
    freq = np.geomspace(1e-3, 1e3, 601)
    curves = [error_curves(field, freq) for field in FIELDS_T]
    print("field T  frequency Hz  reading off by (one mode, full)  one-mode form off by")
    for curve in curves:
        for at in (0.01, 0.1, 1.0, 10.0, 100.0):
            k = int(np.argmin(np.abs(freq - at)))
            row = (curve.reading_one_mode[k], curve.reading[k], curve.approximation[k])
            print(f"{curve.field:7g}  {at:12g}  " + "  ".join(f"{100 * value:9.4f} %" for value in row))
        print(f"{curve.field:7g}  one-mode form off by at most {100 * curve.approximation.max():.2f} %")
    target.parent.mkdir(parents=True, exist_ok=True)
    draw(curves, freq).savefig(target)
    print(f"wrote {target}")


if __name__ == "__main__":
    main()
