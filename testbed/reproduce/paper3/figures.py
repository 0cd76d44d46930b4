"""Figures 10 to 14 of paper 3 on our data, drawn at the width of a journal's column beside their numbers."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np

from testbed.compensation.entropy import multiscale_permutation_entropy, multiscale_sample_entropy
from testbed.compensation.grouping import group_modes, mean_period
from testbed.drift.quality import timed_means
from testbed.drift.table_2 import ORIGINAL, PIPELINE
from testbed.pages.axes import marked
from testbed.pages.palette import COMMANDED, FILTERS, SENSORS, SOLID, TRUTH, Dash, Mark
from testbed.pages.svg import INK
from testbed.reproduce.drawing import DOTTED, LIMIT, PRINT, key, legend, logarithmic, panels, save
from testbed.reproduce.paper1.data import csv_text
from testbed.runs.atomic import write_text
from testbed.units import CELSIUS, DEG_H

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from pathlib import Path

    from matplotlib.figure import Figure

    from testbed.compensation.grouping import ModeGroups
    from testbed.compensation.paper3 import PaperOptions
    from testbed.drift.page import Audited
    from testbed.drift.records import ThermalRecord
    from testbed.signals import FloatArray

    Table = dict[str, FloatArray]

# Samples of a block of the entropies, at which sample entropy has the paper's groups.
SCALE = 55
GROUPS = ("noise", "mixed", "drift")
_COLORS = dict(zip(GROUPS, (SENSORS[0], FILTERS[1], TRUTH), strict=True))
HONEST = "gradient, 2 other cycles"
# Colour and line of what figures 13 and 14 show.
METHODS: dict[str, tuple[str, Dash]] = {
    ORIGINAL: (COMMANDED, (0, None)),
    "AKF [22]": (SENSORS[0], (0, None)),
    "OLMD-KPCA": (SENSORS[2], (0, (5, 2))),
    "CEEMDAN-LWT": (SENSORS[1], (0, (3, 1.2))),
    PIPELINE: (FILTERS[2], (0, None)),
    HONEST: (FILTERS[0], (0, None)),
}
_BINS = 400


@dataclass(frozen=True)
class Decomposed:
    """The modes of a record.

    Parameters
    ----------
    modes : ndarray, shape (n_mode + 1, n_time)
        Fastest first, the residual last [rad/s].
    groups : ModeGroups
        What they are taken for.
    sample_rate_hz : float
        Rate of the samples [Hz].
    """

    modes: FloatArray
    groups: ModeGroups
    sample_rate_hz: float

    @classmethod
    def of(cls, modes: FloatArray, sample_rate_hz: float, options: PaperOptions) -> Decomposed:
        """Return modes in the groups of the paper's pipeline.

        Parameters
        ----------
        modes : ndarray, shape (n_mode + 1, n_time)
            Fastest first, the residual last [rad/s].
        sample_rate_hz : float
            Rate of the samples [Hz].
        options : PaperOptions
            Of the pipeline.
        """
        return cls(modes, group_modes(modes, sample_rate_hz, method=options.grouping), sample_rate_hz)

    def group_of(self, mode: int) -> str:
        """Return the name of the group that a row belongs to."""
        return next(name for name in GROUPS if mode in getattr(self.groups, name))


def write_figures_10_to_14(found: Decomposed, audited: Mapping[str, Audited], out: Path) -> Iterator[str]:
    """Write every figure as SVG and PNG beside its table, and yield a line for each.

    Parameters
    ----------
    found : Decomposed
        Modes of the record.
    audited : mapping of str to Audited
        What each method makes of it, by the names of `METHODS` at least.
    out : Path
        Folder to write to.

    Yields
    ------
    str
        One line.
    """
    shown = {name: audited[name] for name in METHODS}
    thermal = shown[ORIGINAL].thermal
    for name, what, table, figure in (
        ("figure_10", "record and oven", day(thermal), draw_day(day(thermal))),
        ("figure_11", "modes", mode_table(found), draw_modes(found)),
        ("figure_12", "entropy of the modes", entropies(found), draw_entropies(entropies(found), found)),
        ("figure_13", "compensated rates", rates(shown), draw_compensated(rates(shown))),
        ("figure_14", "Allan deviations", deviations(shown), draw_deviations(deviations(shown))),
    ):
        write_text(out / f"{name}.csv", csv_text({_column(head): values for head, values in table.items()}))
        save(figure, out, name)
        yield f"{name}: {what}"


def day(thermal: ThermalRecord) -> Table:
    """Return time [h], 100 s means of rate and true drift [deg/h], temperature [degC]."""
    record, fs = thermal.record, thermal.record.sample_rate_hz
    drift = np.full(record.rate.size, np.nan) if thermal.drift is None else thermal.drift
    return {
        "time_h": timed_means(np.arange(record.rate.size) / fs / 3600.0, fs),
        "rate_deg_h": timed_means(record.rate, fs) / DEG_H,
        "true_drift_deg_h": timed_means(drift, fs) / DEG_H,
        "temperature_degc": timed_means(record.temperature, fs) - CELSIUS,
    }


def mode_table(found: Decomposed) -> Table:
    """Return number, mean period [s], std [deg/h] and group (0 noise, 1 mixed, 2 drift) of each mode, residual last."""
    n = len(found.modes)
    return {
        "mode": np.arange(1.0, n + 1.0),
        "period_s": np.array([_finite(mean_period(row, found.sample_rate_hz)) for row in found.modes]),
        "std_deg_h": found.modes.std(axis=1) / DEG_H,
        "group": np.array([float(GROUPS.index(found.group_of(k))) for k in range(n)]),
    }


def entropies(found: Decomposed) -> Table:
    """Return number, permutation entropy at scales 1 and 55 and sample entropy at 55 of each mode but the residual."""
    modes = found.modes[:-1]
    permutation = np.array([multiscale_permutation_entropy(row, [1, SCALE]) for row in modes])
    return {
        "mode": np.arange(1.0, len(modes) + 1.0),
        "permutation_entropy": permutation[:, 0],
        f"permutation_entropy_{SCALE}": permutation[:, 1],
        f"sample_entropy_{SCALE}": np.array([_finite(multiscale_sample_entropy(row, [SCALE])[0]) for row in modes]),
    }


def rates(shown: Mapping[str, Audited]) -> Table:
    """Return time [h] and the 100 s means of what each method gives, less their mean [deg/h]."""
    fs = next(iter(shown.values())).thermal.record.sample_rate_hz
    table: Table = {}
    for name, one in shown.items():
        means = timed_means(one.compensated, fs) / DEG_H
        table[name] = means - means.mean()
    hours = timed_means(np.arange(one.compensated.size) / fs / 3600.0, fs)
    return {"time_h": hours, **table}


def deviations(shown: Mapping[str, Audited]) -> Table:
    """Return averaging time [s], and the Allan deviation of what each method gives and of the oracle [deg/h]."""
    curves = {name: one.audit.after.curve for name, one in shown.items()}
    oracle = next(iter(shown.values())).audit.oracle
    if oracle is not None:
        curves["oracle"] = oracle.curve
    tau = next(iter(curves.values())).tau
    return {"tau_s": tau, **{name: curve.deviation / DEG_H for name, curve in curves.items()}}


@mpl.rc_context(PRINT)
def draw_day(table: Table) -> Figure:
    """Draw figure 10; argument as from `day`."""
    figure, (rate, heat) = panels(3.0, 2)
    rate.plot(table["time_h"], table["rate_deg_h"], color=SENSORS[0], linewidth=0.7)
    drift = table["true_drift_deg_h"] - table["true_drift_deg_h"].mean() + table["rate_deg_h"].mean()
    rate.plot(table["time_h"], drift, color=TRUTH, linewidth=1.0, linestyle=LIMIT)
    heat.plot(table["time_h"], table["temperature_degc"], color=FILTERS[2])
    rate.set_ylabel("rate [deg/h]")
    heat.set_ylabel("temperature [°C]")
    _in_hours(heat, table["time_h"])
    legend(figure, [key("100 s means", color=SENSORS[0]), key("true drift", color=TRUTH, linestyle=LIMIT)], 2)
    return figure


@mpl.rc_context(PRINT)
def draw_modes(found: Decomposed) -> Figure:
    """Draw figure 11: least and largest sample of each of 400 stretches of every mode."""
    figure, axes = panels(0.36 * len(found.modes) + 0.6, len(found.modes))
    n_bin = found.modes.shape[1] // _BINS
    hours = (np.arange(_BINS) + 0.5) * n_bin / found.sample_rate_hz / 3600.0
    for k, (each, row) in enumerate(zip(axes, found.modes, strict=True)):
        stretches = (row - (row.mean() if k == len(axes) - 1 else 0.0))[: _BINS * n_bin].reshape(_BINS, n_bin) / DEG_H
        group = found.group_of(k)
        color = _COLORS[group]
        # In words too: printed in grey the colours are one.
        each.text(0.995, 0.93, group, transform=each.transAxes, ha="right", va="top", fontsize=5.0)
        each.fill_between(hours, stretches.min(axis=1), stretches.max(axis=1), color=color, linewidth=0.6)
        each.set_ylabel("r" if k == len(axes) - 1 else f"{k + 1}", rotation=0, labelpad=8)
        each.tick_params(labelsize=5.0)
        each.locator_params(axis="y", nbins=2)
    _in_hours(axes[-1], hours)
    legend(figure, [key("rate [deg/h]", linestyle="none")], 1)
    return figure


@mpl.rc_context(PRINT)
def draw_entropies(table: Table, found: Decomposed) -> Figure:
    """Draw figure 12; argument as from `entropies`, and the modes for their groups."""
    figure, (axes,) = panels(2.6)
    lines = {
        "permutation, scale 1": ("permutation_entropy", SENSORS[0], DOTTED),
        f"permutation, scale {SCALE}": (f"permutation_entropy_{SCALE}", SENSORS[0], (0, None)),
        f"sample, scale {SCALE}": (f"sample_entropy_{SCALE}", FILTERS[2], (0, None)),
    }
    handles = []
    for turn, (name, (column, color, dash)) in enumerate(lines.items()):
        style = marked(Mark(dash, SOLID[turn], turn), color)
        handles += axes.plot(table["mode"], table[column], color=color, linewidth=0.9, label=name, **style)
    for name, color in _COLORS.items():
        rows = [k + 1 for k in getattr(found.groups, name) if k + 1 <= table["mode"].size]
        if rows:
            axes.axvspan(rows[0] - 0.5, rows[-1] + 0.5, color=color, alpha=0.10, linewidth=0)
            middle = 0.5 * (rows[0] + rows[-1])
            place = axes.get_xaxis_transform()
            axes.text(middle, 1.01, name, ha="center", fontsize=6.5, color=color, transform=place)
    axes.axhline(0.5, color=INK, linewidth=0.7, linestyle=LIMIT)
    axes.set(xlabel="mode", ylabel="entropy [-]", xlim=(0.5, table["mode"].size + 0.5))
    axes.set_ylim(bottom=0.0)
    axes.locator_params(axis="x", integer=True)
    legend(figure, handles, 2)
    return figure


@mpl.rc_context(PRINT)
def draw_compensated(table: Table) -> Figure:
    """Draw figure 13; argument as from `rates`."""
    names = [name for name in table if name != "time_h"]
    figure, axes = panels(0.75 * len(names) + 0.5, len(names))
    # Stripes of a machine that fits single counts of the thermometer would hide everything else.
    largest = 1.15 * np.abs(table[ORIGINAL]).max()
    for each, name in zip(axes, names, strict=True):
        each.plot(table["time_h"], table[name], color=METHODS[name][0], linewidth=0.6)
        each.set_ylim(-largest, largest)
        each.set_title(name, fontsize=6.8, loc="left", pad=2)
        each.set_ylabel("[deg/h]", fontsize=6.0)
    _in_hours(axes[-1], table["time_h"])
    return figure


@mpl.rc_context(PRINT)
def draw_deviations(table: Table) -> Figure:
    """Draw figure 14; argument as from `deviations`."""
    figure, (axes,) = panels(3.4)
    styles = {**METHODS, "oracle": (TRUTH, DOTTED)}
    names = [name for name in table if name != "tau_s"]
    handles = []
    for turn, name in enumerate(names):
        color, dash = styles[name]
        style = marked(Mark(dash, SOLID[turn], turn), color, table["tau_s"].size)
        handles += axes.plot(table["tau_s"], table[name], color=color, linewidth=1.0, label=name, **style)
    logarithmic(axes, "xy")
    axes.set(xlabel="averaging time [s]", ylabel="Allan deviation [deg/h]")
    legend(figure, handles, 2)
    return figure


def _column(name: str) -> str:
    """Return a name as the head of a column: no blanks, commas or quotes."""
    return re.sub(r"[^a-z0-9]+", "_", name.lower().replace("'", "")).strip("_")


def _in_hours(axes: Any, hours: FloatArray) -> None:
    axes.set_xlabel("time [h]")
    axes.set_xlim(0.0, hours[-1])
    axes.xaxis.set_major_locator(mpl.ticker.MultipleLocator(4.0))


def _finite(value: float) -> float:
    return value if np.isfinite(value) else float("nan")
