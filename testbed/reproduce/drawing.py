"""Figures for print: panels as wide as a journal's column, drawn in the house style and saved beside their numbers."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, MaxNLocator

from testbed.pages.decades import label_powers
from testbed.pages.numbers import plain
from testbed.pages.svg import INK, STYLE
from testbed.runs.atomic import write_bytes

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.axes import Axes

    from testbed.signals import FloatArray

COLUMN_IN = 3.5
PRINT = {**STYLE, "font.size": 7.5, "axes.labelsize": 7.5, "axes.titlesize": 7.5, "legend.fontsize": 6.8}
LIMIT: Any = (0, (5, 2))
DOTTED: Any = (0, (1.2, 1))
MARKER: dict[str, Any] = {
    "marker": "o",
    "linestyle": "none",
    "markersize": 3.6,
    "markerfacecolor": "white",
    "markeredgewidth": 0.9,
}


def panels(height_in: float, n: int = 1) -> tuple[Figure, list[Axes]]:
    """Return a figure of `n` panels one above the other, as wide as a column and `height_in` [in] high."""
    figure = Figure(figsize=(COLUMN_IN, height_in), layout="constrained")
    axes = list(figure.subplots(n, 1, sharex=True, squeeze=False)[:, 0])
    for each in axes:
        each.grid(visible=True)
    return figure, axes


def key(label: str, **style: Any) -> Line2D:
    """Return an entry of the legend for a style that lines of several colors share."""
    return Line2D([], [], **({"color": INK} | style), label=label)


def legend(figure: Figure, handles: list[Line2D], columns: int) -> None:
    """Put the legend above the panels, where it hides nothing."""
    figure.legend(handles=handles, loc="outside upper center", ncols=columns)


def logarithmic(axes: Axes, which: str) -> None:
    """Make the axes named in `which` ("x", "y", "xy") logarithmic, with a label at every decade."""
    for name, axis, scale in (("x", axes.xaxis, axes.set_xscale), ("y", axes.yaxis, axes.set_yscale)):
        if name in which:
            scale("log")
            label_powers(axis, most=9)


def in_time(axes: Axes, t: FloatArray) -> None:
    """Let the time `t` [s] run along the lowest panel."""
    axes.set_xlabel("time [s]")
    axes.set_xlim(t[0], t[-1])
    axes.xaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 5, 10]))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: plain(value)))


def smooth(values: FloatArray, t: FloatArray, length: float) -> FloatArray:
    """Return the running mean over `length` [s], NaN where it would reach beyond the ends.

    Parameters
    ----------
    values : ndarray, shape (n_time,)
        Any unit.
    t : ndarray, shape (n_time,)
        Time, evenly spaced [s].
    length : float
        [s].
    """
    n = 2 * round(0.5 * length / (t[1] - t[0])) + 1
    mean = np.full_like(values, np.nan)
    mean[n // 2 : values.size - n // 2] = np.convolve(values, np.full(n, 1.0 / n), mode="valid")
    return mean


def save(figure: Figure, folder: Path, name: str) -> None:
    """Write `name`.svg and `name`.png into `folder`: no date and fixed ids, so that equal numbers give equal files."""
    figure.align_ylabels()
    with mpl.rc_context({**PRINT, "svg.hashsalt": name}):
        for kind, options in (("svg", {"metadata": {"Date": None}}), ("png", {"dpi": 300})):
            buffer = io.BytesIO()
            figure.savefig(buffer, format=kind, **options)
            write_bytes(folder / f"{name}.{kind}", buffer.getvalue())
