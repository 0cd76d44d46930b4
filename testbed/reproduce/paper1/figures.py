"""The figures of paper 1, drawn at the width of a journal's column from the tables of its `data`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np

from testbed.fusion.filters.arw_shakf import ArwShakfParameters
from testbed.pages import palette
from testbed.pages.axes import marked
from testbed.pages.svg import INK
from testbed.reproduce.drawing import (
    DOTTED,
    LIMIT,
    MARKER,
    PRINT,
    in_time,
    key,
    legend,
    logarithmic,
    panels,
    save,
    smooth,
)
from testbed.reproduce.paper1.data import FOLLOWERS, bode, csv_text, following, increments, slip_error, stepped_sine
from testbed.reproduce.paper1.runs import FILTERS, SENSORS
from testbed.runs.atomic import write_text
from testbed.units import DEG

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping
    from pathlib import Path

    from matplotlib.figure import Figure

    from testbed.reproduce.paper1.data import Table
    from testbed.reproduce.paper1.runs import FusionProtocol
    from testbed.signals import FloatArray

SMOOTH_S = 20e-3
# In the order of the scenarios, so that a signal has the color that it has in their reports.
COLORS = palette.series_colors(("mhd_ars", "mems_gyro"), FILTERS)
LABELS = {
    "mems_gyro": "MEMS gyro",
    "mhd_ars": "MHD ARS",
    "shakf": "SHAKF",
    "arw_shakf": "ARW-SHAKF",
    "arw_shakf_literal": "ARW-SHAKF as printed",
}
# Beside the color, so that lines can be told apart without it.
MARKS = palette.series_marks(COLORS)
# Which signal each figure of a run shows, and which of its tables.
RUNS = {
    "figure_8": ("0.5 Hz", "rates"),
    "figure_9": ("4 Hz", "rates"),
    "figure_10": ("10 Hz", "rates"),
    "figure_11": ("4 Hz", "fused"),
    "figure_12": ("4 Hz", "adaptation"),
    "figure_13": ("mixed", "rates"),
    "figure_14": ("mixed", "fused"),
    "figure_15": ("mixed", "adaptation"),
}


def write_figures(rates: Mapping[str, FloatArray], out: Path, protocol: FusionProtocol) -> Iterator[str]:
    """Write every figure as SVG and PNG beside the tables that it shows, and yield a line for each.

    Parameters
    ----------
    rates : mapping of str to ndarray, shape (n_time,)
        True rate of each signal [rad/s].
    out : Path
        Folder to write to.
    protocol : FusionProtocol
        Times of a run.

    Yields
    ------
    str
        One line.
    """
    yield ""
    yield "figures (SVG and PNG, the numbers in CSV)"
    points = stepped_sine()
    for name, tables, draw in (
        ("figure_2", slip_error(), draw_slip_error),
        ("figure_6", bode(points), draw_bode),
        ("figure_7", increments(points), draw_increments),
    ):
        yield _write(out, name, tables, draw(*tables.values()))
    runs: dict[str, dict[str, Table]] = {}
    for name, (signal, kind) in RUNS.items():
        if signal not in runs:
            runs[signal] = following(rates[signal], signal, protocol)
        table = runs[signal][kind]
        yield _write(out, name, {name: table}, DRAW[kind](table))


@mpl.rc_context(PRINT)
def draw_slip_error(table: Table) -> Figure:
    """Draw figure 2; argument as from `slip_error`."""
    figure, (axes,) = panels(2.8)
    handles = []
    channels = {"0p036t": "0.036 T, 10 mm", "0p1t": "0.1 T, 10 mm", "sx300": "0.448 T, 15 mm (sx300)"}
    colors, freq = (palette.SENSORS[0], palette.TRUTH, palette.FILTERS[1]), table["frequency_hz"]
    for turn, ((name, label), color) in enumerate(zip(channels.items(), colors, strict=True)):
        full, one_mode = (
            marked(palette.Mark((0, dash), palette.SOLID[turn], turn), color, freq.size) for dash in (None, (3, 1.5))
        )
        handles += axes.plot(freq, table[f"full_{name}"], color=color, linewidth=1.3, label=label, **full)
        axes.plot(freq, table[f"one_mode_{name}"], color=color, linewidth=1.0, **one_mode)
    handles += [key("full equation (2)", linewidth=1.3), key("one mode (6)", linestyle=(0, (3, 1.5)))]
    axes.set_ylim(1e-4, 1.6)
    logarithmic(axes, "xy")
    axes.set_ylabel("error of the reading $e_M$ [-]")
    axes.set_xlabel("frequency [Hz]")
    axes.set_xlim(1e-3, 1e3)
    legend(figure, handles, 2)
    return figure


@mpl.rc_context(PRINT)
def draw_bode(curves: Table, measured: Table) -> Figure:
    """Draw figure 6; arguments as from `bode`."""
    figure, (gain, phase) = panels(3.4, 2)
    freq, handles = curves["frequency_hz"], []
    for name in SENSORS:
        color, mark = COLORS[f"sensors/{name}"], MARKS[f"sensors/{name}"]
        points = {"color": color, **marked(mark, color), "linestyle": "none"}
        for axes, what in ((gain, "gain_db"), (phase, "phase_deg")):
            axes.plot(freq, curves[f"{name}_{what}"], color=color, linestyle=mark.dash)
            axes.plot(freq, curves[f"{name}_eq39_{what}"], color=INK, linewidth=0.9, linestyle=":")
            axes.plot(measured["frequency_hz"], measured[f"{name}_{what}"], **points)
        handles.append(key(LABELS[name], color=color, **marked(mark, color)))
    handles += [key("equation (39)", linewidth=0.9, linestyle=":"), key("marks: stepped sine", linestyle="none")]
    gain.set_ylabel("gain [dB]")
    phase.set_ylabel("phase [deg]")
    phase.set_yticks([-90, -45, 0, 45, 90])
    phase.set_xlabel("frequency [Hz]")
    logarithmic(gain, "x")
    phase.set_xlim(0.05, 1e3)
    legend(figure, handles, 2)
    return figure


@mpl.rc_context(PRINT)
def draw_increments(curves: Table, measured: Table) -> Figure:
    """Draw figure 7 with the band limits of `arw_shakf`; arguments as from `increments`."""
    figure, rows = panels(3.6, 2)
    handles = [key("formula"), key("stepped sine", **MARKER, markeredgecolor=INK)]
    handles += [key("band limits", linewidth=0.8, linestyle=LIMIT)]
    for axes, name in zip(rows, SENSORS, strict=True):
        color, column = COLORS[f"sensors/{name}"], f"{name}_deg2_s2"
        axes.plot(curves["frequency_hz"], curves[column], color=color)
        axes.plot(measured["frequency_hz"], measured[column], **MARKER, markeredgecolor=color)
        logarithmic(axes, "xy")
        bottom, top = 0.6 * curves[column].min(), 2.2 * curves[column].max()
        axes.set_ylim(bottom, top)
        edges = _band_limits(name)
        for edge in edges:
            axes.axhline(edge, color=INK, linewidth=0.8, linestyle=LIMIT)
        for band, low, high in zip(("low", "mid", "high"), (bottom, *edges), (*edges, top), strict=True):
            axes.text(0.985, np.sqrt(low * high), band, transform=axes.get_yaxis_transform(), ha="right", va="center")
        axes.set_title(f"{LABELS[name]}, sine of 1 deg/s", loc="left")
        axes.set_ylabel("$N_k/\\Delta T$ [(deg/s)$^2$]")
    rows[-1].set_xlabel("frequency [Hz]")
    rows[-1].set_xlim(0.09, 60.0)
    legend(figure, handles, 3)
    return figure


@mpl.rc_context(PRINT)
def draw_rates(table: Table) -> Figure:
    """Draw figure 8, 9, 10 or 13; argument as the table `rates` of `following`."""
    figure, (axes,) = panels(2.3)
    t = table["time_s"]
    handles = axes.plot(
        t, table["turntable_deg_s"], color=palette.COMMANDED, linewidth=3.4, alpha=0.6, label="turntable"
    )
    for name in ("mems_gyro", "mhd_ars"):
        handles += axes.plot(t, table[f"{name}_deg_s"], label=LABELS[name], **_style(f"sensors/{name}", t.size))
    handles += axes.plot(t, table["arw_shakf_deg_s"], label="fused (ARW-SHAKF)", **_style("fusion/arw_shakf", t.size))
    in_time(axes, t)
    axes.set_ylabel("rate [deg/s]")
    legend(figure, handles, 2)
    return figure


@mpl.rc_context(PRINT)
def draw_fused(table: Table) -> Figure:
    """Draw figure 11 or 14; argument as the table `fused` of `following`. The errors have scales of their own."""
    figure, rows = panels(4.9, 1 + len(FOLLOWERS))
    t = table["time_s"]
    handles = rows[0].plot(
        t, table["turntable_deg_s"], color=palette.COMMANDED, linewidth=3.4, alpha=0.6, label="turntable"
    )
    rows[0].set_ylabel("rate [deg/s]")
    for axes, name in zip(rows[1:], FOLLOWERS, strict=True):
        handles += rows[0].plot(t, table[f"{name}_deg_s"], label=LABELS[name], **_style(f"fusion/{name}", t.size))
        milli, color = 1e3 * table[f"{name}_error_deg_s"], COLORS[f"fusion/{name}"]
        axes.plot(t, milli, color=color, linewidth=0.4, alpha=0.4)
        axes.plot(t, smooth(milli, t, SMOOTH_S), color=color, linewidth=1.2)
        axes.set_title(f"error of {LABELS[name]}", loc="left")
        axes.set_ylabel("[10$^{-3}$ deg/s]")
    rows[1].set_title("error of SHAKF (bold: mean over 20 ms)", loc="left")
    in_time(rows[-1], t)
    legend(figure, handles, 2)
    return figure


@mpl.rc_context(PRINT)
def draw_adaptation(table: Table) -> Figure:
    """Draw figure 12 or 15; argument as the table `adaptation` of `following`."""
    figure, rows = panels(4.8, 3)
    handles, t = [], table["time_s"]
    for axes, (sensor, index) in zip(rows, (("mems_gyro", 11), ("mhd_ars", 22)), strict=False):
        handles = [
            axes.plot(t, table[f"{name}_R_{sensor}_deg2_s2"], label=LABELS[name], **_style(f"fusion/{name}", t.size))[0]
            for name in FOLLOWERS
        ]
        axes.set_title(f"$R_{{{index}}}$, {LABELS[sensor]}", loc="left")
        axes.set_ylabel("$R$ [(deg/s)$^2$]")
    for sensor in SENSORS:
        fading, printed = (table[f"{name}_N_{sensor}_deg2_s2"] for name in FOLLOWERS[1:])
        rows[2].plot(t, fading, **_style(f"sensors/{sensor}", t.size))
        rows[2].plot(t, printed, color=INK, linewidth=0.9, linestyle=DOTTED)
        place: dict[str, Any] = {"xytext": (-2, -6), "textcoords": "offset points", "ha": "right", "va": "top"}
        rows[2].annotate(LABELS[sensor], (t[-1], fading[-1]), **place)
    rows[2].set_title("$N_k$ (marks: fading memory, dotted: as printed)", loc="left")
    rows[2].set_ylabel("$N_k/\\Delta T$ [(deg/s)$^2$]")
    rows[2].set_ylim(3e-7, 6e-5)  # the same in both figures
    rows[2].set_xlabel("time [s]")
    for axes in rows:
        logarithmic(axes, "xy")
    rows[2].set_xlim(t[0], t[-1])
    legend(figure, handles, 2)
    return figure


DRAW: dict[str, Callable[[Table], Figure]] = {
    "rates": draw_rates,
    "fused": draw_fused,
    "adaptation": draw_adaptation,
}


def _band_limits(sensor: str) -> tuple[float, float]:
    """Return the thresholds of N_k / dT that `arw_shakf` has by default [(deg/s)^2]."""
    low, high = ArwShakfParameters().bands[sensor].thresholds
    return low / DEG**2, high / DEG**2


def _style(group: str, n_points: int) -> dict[str, Any]:
    color = COLORS[group]
    return {"color": color, "linewidth": 1.0, **marked(MARKS[group], color, n_points)}


def _write(out: Path, name: str, tables: Mapping[str, Table], figure: Figure) -> str:
    for table_name, table in tables.items():
        write_text(out / f"{table_name}.csv", csv_text(table))
    save(figure, out, name)
    return f"{name}: {', '.join(f'{table_name}.csv' for table_name in tables)}, {name}.svg, {name}.png"
