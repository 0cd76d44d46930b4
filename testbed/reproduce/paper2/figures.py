"""Pictures of paper 2, each beside its numbers: both responses, following at three frequencies, noise at standstill.

The paper's figures are known to us by what its text says that they show: 2 the sensors' frequency responses, 7 to 9 the
fused rate that follows a sine of 1 rad/s at 0.5, 5 and 50 Hz, 11 the noise densities at standstill.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np

from testbed.fusion.belief import load_belief
from testbed.pages import palette
from testbed.pages.axes import marked
from testbed.pages.svg import INK
from testbed.reproduce.drawing import LIMIT, PRINT, in_time, key, legend, logarithmic, panels, save
from testbed.reproduce.paper2.rivals import SENSORS
from testbed.runs.atomic import write_text
from testbed.sensors import load_preset
from testbed.signals import BASE_RATE_HZ
from testbed.units import DEG

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping
    from pathlib import Path

    from matplotlib.figure import Figure

    from testbed.signals import FloatArray

    Table = dict[str, FloatArray]

GROUPS = {name: f"sensors/{name}" for name in SENSORS} | {"fused": "fusion/allan_srkf", "rate": "truth"}
COLORS = {name: palette.color_of(group) for name, group in GROUPS.items()}
MARKS = palette.series_marks(GROUPS.values())
LABELS = {"mems_gyro": "MEMS gyro", "mhd_ars": "MHD ARS", "fused": "fused", "rate": "true rate"}
BELIEVED = {"color": INK, "linewidth": 0.9, "linestyle": LIMIT}
FOLLOWED_HZ = {"figure_7": 0.5, "figure_8": 5.0, "figure_9": 50.0}
SHOWN_PERIODS, BEFORE_S = 3.0, 1.0


def write_pictures(
    read: Callable[[FloatArray], Mapping[str, FloatArray]], freq_hz: FloatArray, density: FloatArray, out: Path
) -> Iterator[str]:
    """Write every picture as SVG and PNG beside its numbers, and yield a line for each.

    Parameters
    ----------
    read : callable
        True rate [rad/s] -> readings of both sensors and the fused rate [rad/s], by name, of a filter just switched on.
    freq_hz : ndarray, shape (n_bin,)
        Of the densities [Hz].
    density : ndarray, shape (n_bin, 4)
        Gyro, MHD ARS, fused, MHD ARS referred to the rate [rad^2/s].
    out : Path
        Folder to write to.

    Yields
    ------
    str
        One line.
    """
    yield "figures (SVG and PNG, the numbers in CSV)"
    yield _write(out, "figure_2", both_responses(), draw_both_responses)
    for name, freq in FOLLOWED_HZ.items():
        yield _write(out, name, followed(read, freq), draw_followed)
    columns = ("mems_gyro", "mhd_ars", "fused", "mhd_ars_input_referred")
    noise = {"frequency_hz": freq_hz} | dict(zip(columns, density.T, strict=True))
    yield _write(out, "figure_11", noise, draw_noise)


def both_responses() -> Table:
    """Return figure 2: gain [-] and phase [deg] of both sensors and of what the belief `paper2` holds of them."""
    freq = np.geomspace(0.01, 1000.0, 251)
    believed, found = load_belief("paper2"), {"frequency_hz": freq}
    for name, part in SENSORS.items():
        for of, response in (
            (name, load_preset(part).response(freq)),
            (f"{name}_believed", believed[name].realisation().response(freq)),
        ):
            found[f"{of}_gain"] = np.abs(response)
            found[f"{of}_phase_deg"] = np.degrees(np.unwrap(np.angle(response)))
    return found


def followed(read: Callable[[FloatArray], Mapping[str, FloatArray]], freq_hz: float) -> Table:
    """Return three periods of a sine of 1 rad/s, readings and fused rate [deg/s], a second and more after the start."""
    first = round(max(BEFORE_S, 1.0 / freq_hz) * BASE_RATE_HZ)
    t = np.arange(first + round(SHOWN_PERIODS / freq_hz * BASE_RATE_HZ)) / BASE_RATE_HZ
    rate = np.sin(2.0 * np.pi * freq_hz * t)
    rows = slice(first, None, max(round(BASE_RATE_HZ / freq_hz / 200.0), 1))
    return {name: values[rows] for name, values in {"t": t, "rate": rate / DEG}.items()} | {
        name: values[rows] / DEG for name, values in read(rate).items()
    }


@mpl.rc_context(PRINT)
def draw_both_responses(table: Table) -> Figure:
    """Draw figure 2 from the table of `both_responses`."""
    figure, (gain, phase) = panels(4.2, 2)
    for name in SENSORS:
        # The belief lies on the sensor: dashed in ink over a wide line, so that both are seen.
        for of, style in ((name, {**_style(name, 251), "linewidth": 2.4}), (f"{name}_believed", BELIEVED)):
            gain.plot(table["frequency_hz"], table[f"{of}_gain"], **style)
            phase.plot(table["frequency_hz"], table[f"{of}_phase_deg"], **style)
    logarithmic(gain, "xy")
    logarithmic(phase, "x")
    gain.set_ylabel("gain [-]")
    gain.set_ylim(1e-3, 2.0)
    phase.set_ylabel("phase [deg]")
    phase.set_xlabel("frequency [Hz]")
    phase.set_xlim(table["frequency_hz"][0], table["frequency_hz"][-1])
    names = [key(LABELS[name], **_style(name)) for name in SENSORS]
    legend(figure, [*names, key("believed", **BELIEVED)], 3)
    return figure


@mpl.rc_context(PRINT)
def draw_followed(table: Table) -> Figure:
    """Draw one of figures 7 to 9 from the table of `followed`: rates above, error of the fused one below."""
    figure, (rates, error) = panels(3.8, 2)
    for name in ("rate", *SENSORS):
        width = 2.2 if name == "rate" else 1.0
        rates.plot(table["t"], table[name], linewidth=width, **_style(name, table["t"].size))
    rates.plot(table["t"], table["fused"], linewidth=1.2, **_style("fused", table["t"].size))
    error.plot(table["t"], table["fused"] - table["rate"], color=COLORS["fused"], linewidth=0.9)
    rates.set_ylabel("rate [deg/s]")
    error.set_ylabel("fused - true [deg/s]")
    in_time(error, table["t"])
    legend(figure, [key(LABELS[name], **_style(name)) for name in ("rate", *SENSORS, "fused")], 2)
    return figure


@mpl.rc_context(PRINT)
def draw_noise(table: Table) -> Figure:
    """Draw figure 11: root densities at standstill."""
    figure, (axes,) = panels(2.8)
    for name in ("mems_gyro", "mhd_ars", "fused"):
        axes.plot(table["frequency_hz"], np.sqrt(table[name]) / DEG, linewidth=1.2, **_style(name, table[name].size))
    referred = np.sqrt(table["mhd_ars_input_referred"]) / DEG
    axes.plot(table["frequency_hz"], referred, color=COLORS["mhd_ars"], linewidth=1.0, linestyle=LIMIT)
    logarithmic(axes, "xy")
    axes.set_xlabel("frequency [Hz]")
    axes.set_ylabel("noise [deg/s/$\\sqrt{\\mathrm{Hz}}$]")
    axes.set_xlim(table["frequency_hz"][0], table["frequency_hz"][-1])
    names = [key(LABELS[name], **_style(name)) for name in ("mems_gyro", "mhd_ars", "fused")]
    legend(figure, [*names, key("MHD ARS, as a rate", color=COLORS["mhd_ars"], linestyle=LIMIT)], 2)
    return figure


def _style(name: str, n_points: int | None = None) -> dict[str, Any]:
    color, mark = COLORS[name], MARKS.get(GROUPS[name])
    return {"color": color} | (marked(mark, color, n_points) if mark else {})


def _write(out: Path, name: str, table: Table, draw: Callable[[Table], Figure]) -> str:
    rows = [",".join(table), *(",".join(f"{value:.9g}" for value in row) for row in zip(*table.values(), strict=True))]
    write_text(out / f"{name}.csv", "\n".join(rows) + "\n")
    save(draw(table), out, name)
    return f"  {name}.svg"
