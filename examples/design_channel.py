"""Design a channel: lower corner, scale factor and Hartmann number against field and height.

Prints a table and draws the three over the field, one line per height. For example:
`python examples/design_channel.py --fluid mercury --closure axial_field --field 0.1 0.3 0.5 --height 2 4 8 --width 6
--radius 15`
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib import colormaps
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from testbed.models.mhd_channel.channel import MhdChannel
from testbed.models.mhd_channel.fluids import FLUIDS
from testbed.models.mhd_channel.ring import ChannelRing

if TYPE_CHECKING:
    from collections.abc import Sequence

PICTURE = Path(__file__).parents[1] / "docs" / "images" / "design_channel.png"
CLOSURES = ("local", "radial_field", "axial_field")
TEMPERATURE = 293.15  # K
HEADER = (
    f"{'B [T]':>7} {'l [mm]':>7} {'corner [Hz]':>12} {'EMF [uV/(rad/s)]':>17} {'Ha [-]':>8} "
    f"{'Johnson [nrad/s/sqrt(Hz)]':>26}"
)


@dataclass(frozen=True)
class Design:
    """One channel and what it is worth: SI units, Johnson noise two-sided and referred to the slip."""

    channel: MhdChannel
    corner_freq_hz: float
    emf_per_rate: float
    hartmann_number: float
    johnson_noise: float

    def row(self) -> str:
        """Return the design as a line of the table."""
        return (
            f"{self.channel.field:7.3f} {1e3 * self.channel.height:7.2f} {self.corner_freq_hz:12.4g} "
            f"{1e6 * self.emf_per_rate:17.4g} {self.hartmann_number:8.3g} {1e9 * self.johnson_noise:26.3g}"
        )


def design(channel: MhdChannel, ring: ChannelRing) -> Design:
    """Return what `channel`, bent to `ring`, is worth; its field must not be zero."""
    emf = ring.emf_per_rate(channel)
    noise = ring.voltage_noise(channel, TEMPERATURE) / emf
    return Design(channel, channel.corner_freq_hz, emf, channel.hartmann_number, noise)


def survey(template: MhdChannel, ring: ChannelRing, fields: Sequence[float], heights: Sequence[float]) -> list[Design]:
    """Return a design for every pair of field [T] and height [m], fields running fastest."""
    pairs = [(field, height) for height in heights for field in fields]
    return [design(template.model_copy(update={"field": b, "height": length}), ring) for b, length in pairs]


def draw(designs: list[Design], title: str) -> Figure:
    """Return corner, scale factor and Hartmann number over the field, one line per height."""
    figure = Figure(figsize=(10.5, 3.9), dpi=200, layout="constrained")
    panels = figure.subplots(1, 3)
    heights = sorted({each.channel.height for each in designs})
    colors = colormaps["viridis"](np.linspace(0.05, 0.85, len(heights)))
    for height, color in zip(heights, colors, strict=True):
        line = [each for each in designs if each.channel.height == height]
        fields = [each.channel.field for each in line]
        values = (
            [each.corner_freq_hz for each in line],
            [1e6 * each.emf_per_rate for each in line],
            [each.hartmann_number for each in line],
        )
        for axes, value in zip(panels, values, strict=True):
            axes.loglog(
                fields, value, color=color, marker="o", markersize=3, linewidth=1.5, label=f"{1e3 * height:g} mm"
            )
    for axes, label in zip(panels, ("lower corner [Hz]", "scale factor [µV/(rad/s)]", "Hartmann number"), strict=True):
        axes.set(xlabel="magnetic field B [T]", ylabel=label)
        axes.grid(visible=True, which="both", color="#e3e6ea", linewidth=0.6)
        axes.spines[["top", "right"]].set_visible(False)
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
            axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
            axis.set_minor_formatter(NullFormatter())
    if designs[0].channel.closure == "axial_field":
        panels[1].set_title("B W r, the same for every height", fontsize=9)
    panels[-1].legend(title="height l", frameon=False, fontsize=8.5)
    figure.suptitle(title, fontsize=10, x=0.01, ha="left")
    return figure


def arguments(argv: Sequence[str] | None = None) -> argparse.Namespace:
    """Return the command line's choices; lengths in millimetres there."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--fluid", choices=sorted(FLUIDS), default="mercury")
    parser.add_argument("--closure", choices=CLOSURES, default="axial_field")
    parser.add_argument("--load-fraction", type=float, default=1.0, help="1 short circuit, 0 open (%(default)s)")
    parser.add_argument("--field", type=float, nargs="+", metavar="T", default=[0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.7])
    parser.add_argument("--height", type=float, nargs="+", metavar="MM", default=[2.0, 4.0, 8.0, 15.0])
    parser.add_argument("--width", type=float, metavar="MM", default=6.0, help="of the ring, inner to outer wall")
    parser.add_argument("--radius", type=float, metavar="MM", default=15.0, help="mean radius of the ring")
    parser.add_argument("--figure", type=Path, default=PICTURE, help="where to draw it (%(default)s)")
    given = parser.parse_args(argv)
    if min(*given.field, *given.height, given.width, given.radius) <= 0.0:
        parser.error("fields and lengths: expected more than 0")
    if not 0.0 <= given.load_fraction <= 1.0 or (given.closure == "local" and given.load_fraction != 1.0):
        parser.error("--load-fraction: expected 0 to 1, and 1 with closure local")
    return given


def main(argv: Sequence[str] | None = None) -> None:
    """Print the table and draw the figure."""
    given = arguments(argv)
    template = MhdChannel(
        fluid=given.fluid, height=1e-3, field=0.1, closure=given.closure, load_fraction=given.load_fraction
    )
    ring = ChannelRing(width=1e-3 * given.width, radius=1e-3 * given.radius)
    designs = survey(template, ring, sorted(given.field), [1e-3 * height for height in sorted(given.height)])
    title = (
        f"{given.fluid}, closure '{given.closure}', load fraction {given.load_fraction:g}, "
        f"ring {given.width:g} mm wide, mean radius {given.radius:g} mm"
    )
    print(title, HEADER, *(each.row() for each in designs), sep="\n")
    given.figure.parent.mkdir(parents=True, exist_ok=True)
    draw(designs, title).savefig(given.figure)
    print(f"wrote {given.figure}")


if __name__ == "__main__":
    main()
