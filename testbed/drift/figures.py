"""The three figures of an audit: drift over the record, Allan deviations, and what survives of true rate."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from testbed.allan.fit import term_variance
from testbed.drift.findings import DRIFT_PERIOD, LEAST_GAIN
from testbed.drift.quality import timed_means
from testbed.pages.axes import marked
from testbed.pages.palette import FILTERS, SENSORS, SOLID, TRUTH, Mark
from testbed.pages.svg import INK, STYLE
from testbed.units import CELSIUS, DEG_H

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.axes import Axes

    from testbed.compensation.record import GyroRecord
    from testbed.drift.findings import Audit
    from testbed.drift.quality import Quality
    from testbed.pages.palette import Dash
    from testbed.signals import FloatArray

SIZE_IN = (9.2, 4.6)
# Colour and line of each curve of an Allan figure, by what it is.
CURVES: dict[str, tuple[str, Dash]] = {
    "record": (SENSORS[0], (0, None)),
    "compensated": (FILTERS[0], (0, None)),
    "equal low-pass": (FILTERS[1], (0, (5, 2))),
    "oracle": (TRUTH, (0, (1.2, 1.6))),
}
_TERMS = ("quantization", "angle_random_walk", "bias_instability", "rate_random_walk", "rate_ramp")


def drift_figure(record: GyroRecord, compensated: FloatArray, drift: FloatArray | None = None) -> Figure:
    """Draw 100 s means of the record, of what was removed, of the true drift and of what is left; the temperature
    below.

    Parameters
    ----------
    record : GyroRecord
        As it was read.
    compensated : ndarray, shape (n_time,)
        Compensated rate [rad/s].
    drift : ndarray, shape (n_time,), optional
        True drift, if known [rad/s].

    Returns
    -------
    Figure
        Rates [deg/h], each less its mean, and temperature [degC] against time [h].
    """
    fs = record.sample_rate_hz
    hours = timed_means(np.arange(record.rate.size) / fs / 3600.0, fs)

    def shown(rate: FloatArray) -> FloatArray:
        means = timed_means(rate, fs) / DEG_H
        centred: FloatArray = means - means.mean()
        return centred

    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(SIZE_IN[0], 5.2), layout="constrained")
        top, middle, bottom = figure.subplots(3, 1, sharex=True, height_ratios=(2.2, 1.6, 1.0))
        top.plot(hours, shown(record.rate), color=SENSORS[0], linewidth=0.9, label="record")
        top.plot(hours, shown(record.rate - compensated), color=INK, linewidth=1.3, label="removed")
        if drift is not None:
            top.plot(hours, shown(drift), color=TRUTH, linewidth=1.3, linestyle=(0, (3, 1.5)), label="true drift")
        middle.plot(hours, shown(compensated), color=FILTERS[0], linewidth=0.9, label="compensated")
        bottom.plot(hours, timed_means(record.temperature, fs) - CELSIUS, color=SENSORS[3], linewidth=1.3)
        top.set_ylabel("rate [deg/h]")
        middle.set_ylabel("rate [deg/h]")
        bottom.set(ylabel="T [°C]", xlabel="time [h]", xlim=(0.0, float(hours[-1])))
        for axes in (top, middle):
            axes.legend(loc="upper left", bbox_to_anchor=(0.0, 1.14), ncols=3, fontsize=8)
        for axes in (top, middle, bottom):
            axes.grid(visible=True)
    return figure


def residual_allan_figure(qualities: Mapping[str, Quality], styles: Mapping[str, tuple[str, Dash]] = CURVES) -> Figure:
    """Draw Allan deviations with their 95 % bands, and the fitted sum of each that the noise model describes.

    Parameters
    ----------
    qualities : mapping of str to Quality
        By name.
    styles : mapping, optional
        Colour and line by name.

    Returns
    -------
    Figure
        Allan deviation [deg/h] against averaging time [s], both logarithmic.
    """
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=SIZE_IN, layout="constrained")
        axes = figure.subplots()
        for turn, (name, quality) in enumerate(qualities.items()):
            color, dash = styles[name]
            _draw_curve(axes, name, quality, color, Mark(dash, SOLID[turn % len(SOLID)], turn))
        axes.set(xscale="log", yscale="log", xlabel="averaging time τ [s]", ylabel="Allan deviation [deg/h]")
        axes.grid(visible=True, which="major")
        figure.legend(loc="outside upper left", ncols=2, fontsize=8)
    return figure


def _draw_curve(axes: Axes, name: str, quality: Quality, color: str, mark: Mark) -> None:
    curve = quality.curve
    axes.fill_between(curve.tau, curve.lower / DEG_H, curve.upper / DEG_H, color=color, alpha=0.13, linewidth=0)
    style = marked(mark, color, curve.tau.size)
    note = "" if quality.fit is not None else " (no Q, N, B: the noise model does not describe it)"
    axes.plot(curve.tau, curve.deviation / DEG_H, color=color, linewidth=1.4, label=name + note, **style)
    if quality.fit is not None:
        part = curve.between(0.0, quality.fitted_to)
        squares = zip(_TERMS, quality.fit.squares, strict=True)
        total = np.sqrt(sum(term_variance(part, term, square) for term, square in squares))
        axes.plot(part.tau[::3], total[::3] / DEG_H, mark.marker, color=color, markersize=2.6, markerfacecolor="none")


def gain_figure(audit: Audit) -> Figure:
    """Draw what survives of a true rate against its period, the equal-bandwidth low-pass beside it.

    Parameters
    ----------
    audit : Audit
        With the gains.

    Returns
    -------
    Figure
        Gain [-] against period [s].
    """
    period = np.array([line.period for line in audit.gains])
    gain = np.array([line.gain for line in audit.gains])
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(SIZE_IN[0], 3.2), layout="constrained")
        axes = figure.subplots()
        axes.axvspan(DRIFT_PERIOD, period[-1] * 1.2, color=SENSORS[3], alpha=0.10, linewidth=0)
        axes.plot([DRIFT_PERIOD, period[-1] * 1.2], [LEAST_GAIN] * 2, color=FILTERS[2], linewidth=1.0)
        axes.text(DRIFT_PERIOD * 1.05, LEAST_GAIN - 0.02, "below this: a leak", va="top", fontsize=8, color=FILTERS[2])
        axes.text(DRIFT_PERIOD * 1.05, 0.02, "drift band", fontsize=8, va="bottom")
        if audit.bandwidth_hz is not None:
            fine = np.geomspace(period[0], period[-1], 200)
            corner = audit.bandwidth_hz * (np.sqrt(2.0) - 1.0) ** -0.25
            color, line = CURVES["equal low-pass"]
            axes.plot(
                fine, 1.0 / (1.0 + (1.0 / fine / corner) ** 4), color=color, linestyle=line, label="equal low-pass"
            )
        axes.plot(period, gain, "o-", color=FILTERS[0], markersize=4, label="sines")
        steps: dict[str, tuple[float | None, Any]] = {
            "step": (audit.step_gain, (0, (5, 2))),
            "Earth-rate steps": (audit.earth_gain, (0, (1.2, 1.6))),
            "rate that follows T": (audit.heat_gain, (0, (7, 1.2, 1.5, 1.2))),
        }
        for label, (share, line) in steps.items():
            if share is not None:
                axes.axhline(share, color=INK, linewidth=0.9, linestyle=line, label=label)
        axes.set(xscale="log", xlabel="period of the true rate [s]", ylabel="gain [-]", ylim=(0.0, 1.19))
        axes.set_xlim(period[0] / 1.2, period[-1] * 1.2)
        axes.grid(visible=True)
        axes.legend(loc="upper left", ncols=5, fontsize=8)
    return figure
