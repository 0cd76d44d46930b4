"""Densities drawn: root density with its band above, cumulative rms of the rate and of the angle below."""

from __future__ import annotations

from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from testbed.pages.axes import marked
from testbed.pages.palette import color_of, series_marks
from testbed.pages.svg import STYLE
from testbed.units import DEG

if TYPE_CHECKING:
    from collections.abc import Sequence

    from testbed.judging.density import RateDensityEstimate

_SIZE_IN = (7.0, 7.5)
# Lines drawn in a figure: more points than pixels only make the file large.
_POINTS = 4000


def density_figure(estimates: Sequence[RateDensityEstimate]) -> Figure:
    """Draw densities and what they add up to.

    Parameters
    ----------
    estimates : sequence of RateDensityEstimate
        Each in the colour, dashes and mark of its name.

    Returns
    -------
    Figure
        Root density [deg/s/sqrt(Hz)] with its 95 % interval, cumulative rms [deg/s], cumulative rms [urad].
    """
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=_SIZE_IN, layout="constrained")
        top, middle, bottom = figure.subplots(3, 1, sharex=True)
        groups = [one.record.signal or f"columns/{one.record.name}" for one in estimates]
        marks = series_marks(groups)
        for one, group in zip(estimates, groups, strict=True):
            color, shown = color_of(group), _shown(one.freq_hz.size)
            style = {"color": color} | (marked(marks[group], color, shown.size) if group in marks else {})
            freq, density = one.freq_hz[shown], np.sqrt(one.density[shown]) / DEG
            low, high = np.sqrt(one.limits)
            top.fill_between(freq, density * low, density * high, color=color, alpha=0.25, linewidth=0)
            top.plot(freq, density, **style, linewidth=0.9, label=one.record.name.replace("$", r"\$"))
            rate, angle = one.cumulative()
            middle.plot(freq, rate[shown] / DEG, **style, linewidth=1.1)
            bottom.plot(freq, angle[shown] * 1e6, **style, linewidth=1.1)
        sides = "one-sided" if estimates[0].sides == 1 else "two-sided"
        top.set(xscale="log", yscale="log", ylabel=f"density, {sides} [deg/s/√Hz]")
        middle.set(ylabel="rms up to f [deg/s]")
        bottom.set(ylabel="angle rms up to f [µrad]", xlabel="frequency [Hz]")
        top.legend(loc="best", fontsize=7.5)
        for axes in (top, middle, bottom):
            axes.grid(visible=True, which="major")
    return figure


def _shown(n_freq: int) -> np.ndarray:
    """Return the places that are drawn: all, or as many as can be told apart on a logarithmic axis."""
    if n_freq <= _POINTS:
        return np.arange(n_freq)
    return np.unique(np.round(np.geomspace(1, n_freq, _POINTS)).astype(int)) - 1
