"""The figures of a report."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from testbed.pages.axes import DEGREE, HOURS_FROM, WIDTH_IN, arrange, draw, label, marked, on_area, time_axis
from testbed.pages.decades import decade_axis, frequency_axis
from testbed.pages.numbers import plain, significant
from testbed.pages.palette import series_marks
from testbed.pages.svg import INK, STYLE

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from matplotlib.axes import Axes

    from testbed.pages.envelope import Envelope
    from testbed.pages.palette import Mark
    from testbed.report.digest import Digest, ErrorTrace
    from testbed.runs.metrics import FloorDensity

MAX_LABELLED_LINES = 6
DOTTED = (0, (1.2, 2.2))

# Unit of the rates, and what deg/s is multiplied by for it.
Unit = tuple[str, float]
DEG_S: Unit = ("deg/s", 1.0)
DASHED = (0, (4.0, 2.4))


def rates_figure(digest: Digest, colors: Mapping[str, str], unit: Unit = DEG_S) -> Figure:
    """Draw the rates: the whole run of the sensors above, then a zoom of them, and of the filters below.

    The truth is dashed over the sensors, so that it hides none of them, and wide beneath the filters.

    Parameters
    ----------
    digest : Digest
        Traces of the run.
    colors : Mapping
        Group (``truth``, ``sensors/mhd_ars``, ...) to color.
    unit : tuple of str and float, optional
        Unit of the rates, and what deg/s is multiplied by for it.

    Returns
    -------
    Figure
        Two axes, three with filters: rate against s, against hours of a long run.
    """
    name, scale, marks = unit[0], unit[1] * DEGREE, series_marks(digest.rates)
    sensors = [group for group in digest.rates if group.startswith("sensors/")]
    filters = [group for group in digest.rates if group.startswith("fusion/")]
    # The widest first: what is narrower stands before it and hides nothing.
    sensors.sort(key=lambda group: -_highest([digest.rates[group].whole]))
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(WIDTH_IN, 7.4 if filters else 5.2))
        above, *zooms = figure.subplots(3 if filters else 2, 1, height_ratios=[2, 2.4, 2.4][: 3 if filters else 2])
        for axes, part in ((above, "whole"), (zooms[0], "zoom")):
            for group in sensors:
                draw(axes, getattr(digest.rates[group], part), colors[group], 0.9, scale=scale, mark=marks[group])
            if digest.has_truth:
                _dash_truth(axes, getattr(digest.rates["truth"], part), colors["truth"], scale)
        if filters and digest.has_truth:
            draw(zooms[1], digest.rates["truth"].zoom, colors["truth"], 4.2, scale=scale)
        # Later lines are thinner, so that lines which lie on each other all stay visible.
        for i, group in enumerate(filters):
            zoom = digest.rates[group].zoom
            draw(zooms[1], zoom, colors[group], 2.2 * 0.7**i, scale=scale, mark=marks[group])
        moved = _dot_command(zooms[-1], digest, scale)
        above.axvspan(*digest.zoom_s, color=INK, alpha=0.08, linewidth=0)
        span = f"{digest.zoom_s[0]:.4g} s to {digest.zoom_s[1]:.4g} s"
        above.set_title("Sensors, whole run (shaded: the zoom below)", loc="left")
        for axes, what in zip(zooms, ("Sensors", "Filters"), strict=False):
            axes.set_title(f"{what}, {span}", loc="left")
            axes.set_xlim(*digest.zoom_s)
        above.set_xlim(0, digest.duration_s)
        for axes in (above, *zooms):
            axes.set_ylabel(f"rate [{name}]")
            axes.grid(visible=True)
        time_axis(above, digest.duration_s, named=digest.duration_s >= HOURS_FROM)
        for axes in zooms:
            time_axis(axes, digest.zoom_s[1] - digest.zoom_s[0], named=axes is zooms[-1])
        handles: list[Line2D | Patch] = [
            Line2D([], [], color=colors[group], linewidth=2.2, label=label(group), **_in_legend(marks, colors, group))
            for group in digest.rates
            if group != "commanded"
        ]
        dotted = Line2D([], [], color=INK, linewidth=1.2, linestyle=DOTTED, label="commanded")
        arrange(figure, [*handles, dotted] if moved else handles, gap_in=0.62)
    return figure


def _in_legend(marks: Mapping[str, Mark], colors: Mapping[str, str], group: str) -> dict[str, Any]:
    """Return how the line of a filled area is in the legend: with its mark; the truth has none."""
    return on_area(marks[group], colors[group]) if group in marks else {"linestyle": DASHED}


def _dot_command(axes: Axes, digest: Digest, scale: float) -> bool:
    """Draw what was commanded, dotted; return whether there was anything.

    A command of nothing would only stretch the scale of a table that turns with the Earth.
    """
    if "commanded" not in digest.rates:
        return False
    commanded = digest.rates["commanded"].zoom
    middle = scale * (commanded.low + commanded.high) / 2
    if not np.any(middle):
        return False
    axes.plot(commanded.time, middle, color=INK, linewidth=0.8, linestyle=DOTTED)
    return True


def _dash_truth(axes: Axes, truth: Envelope, color: str, scale: float) -> None:
    """Draw the edges of the truth, dashed: what lies beneath shows through."""
    for edge in (truth.low, truth.high):
        axes.plot(truth.time, scale * edge, color=color, linewidth=1.5, linestyle=DASHED)


def _highest(envelopes: Sequence[Envelope]) -> float:
    """Return the largest size in any of them, 0 where nothing is finite (every reading lost)."""
    extremes = np.abs(np.concatenate([ends for one in envelopes for ends in (one.low, one.high)]))
    return float(np.max(extremes, where=np.isfinite(extremes), initial=0.0))


def errors_figure(digest: Digest, colors: Mapping[str, str], unit: Unit = DEG_S) -> Figure:
    """Draw the error of each filter over time in a panel of its own, with the band of two standard deviations it
    claims.

    Parameters
    ----------
    digest : Digest
        Traces of the run.
    colors : Mapping
        Group (``fusion/kalman``, ...) to color.
    unit : tuple of str and float, optional
        Unit of the rates, and what deg/s is multiplied by for it.

    Returns
    -------
    Figure
        One axes for each filter, error against s.
    """
    errors = digest.filter_errors
    limits = _common_limits(
        {name: unit[1] * _settled_extreme(trace, digest.settle_s) for name, trace in errors.items()}
    )
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(WIDTH_IN, 1.0 + 1.7 * len(errors)))
        panels = figure.subplots(len(errors), 1, sharex=True, squeeze=False)[:, 0]
        for axes, (name, trace) in zip(panels, errors.items(), strict=True):
            _error_panel(axes, trace, colors[f"fusion/{name}"], limits[name], unit)
            axes.axvspan(0, digest.settle_s, color=INK, alpha=0.08, linewidth=0)
            inside = "undefined" if trace.inside is None else f"{100 * trace.inside:.1f} %"
            axes.set_title(
                f"{label(name)}: {inside} of the samples inside ±2 std{_cut_note(trace, limits[name], unit)}",
                loc="left",
            )
        panels[-1].set_xlim(0, digest.duration_s)
        time_axis(panels[-1], digest.duration_s)
        handles: list[Line2D | Patch] = [
            Patch(facecolor="#8a8a8a", label="error (its extremes)"),
            Line2D([], [], color=INK, linewidth=1.1, linestyle=(0, (5, 2)), label="±2 std claimed"),
        ]
        if digest.settle_s > 0:
            handles.append(Patch(facecolor=INK, alpha=0.08, label="before settle, not judged"))
        arrange(figure, handles)
    return figure


def _error_panel(axes: Axes, trace: ErrorTrace, color: str, limit: float, unit: Unit) -> None:
    draw(axes, trace.whole, color, 0.6, scale=unit[1] * DEGREE)
    if trace.std is not None:
        for sign in (-2.0, 2.0):
            band = sign * unit[1] * np.degrees(trace.std.high)
            axes.plot(trace.std.time, band, color=INK, linewidth=1.1, linestyle=(0, (5, 2)))
    axes.set_ylim(-limit, limit)
    axes.set_ylabel(f"error [{unit[0]}]")
    axes.grid(visible=True)


def _settled_extreme(trace: ErrorTrace, settle_s: float) -> float:
    """Return the largest |error| and 2 std after settle [deg/s]; the start-up must not set the scale."""
    settled = trace.whole.time >= settle_s
    values = [np.abs(trace.whole.low[settled]), np.abs(trace.whole.high[settled])]
    if trace.std is not None:
        values.append(2.0 * trace.std.high[settled])
    finite = np.concatenate(values)
    finite = finite[np.isfinite(finite)]
    return float(np.degrees(finite.max())) if finite.size else 0.0


def _common_limits(extremes: Mapping[str, float]) -> dict[str, float]:
    """Return the half height of each panel [deg/s]: the same for all whose extremes lie within a factor of four of the
    next.
    """
    limits: dict[str, float] = {}
    previous, shared = 0.0, 0.0
    for name, extreme in sorted(extremes.items(), key=lambda item: -item[1]):
        shared = shared if previous and extreme > previous / 4 else 1.15 * extreme
        limits[name], previous = shared or 1.0, extreme
    return limits


def _cut_note(trace: ErrorTrace, limit: float, unit: Unit) -> str:
    highest = np.fmax.reduce(np.fmax(np.abs(trace.whole.low), np.abs(trace.whole.high)))
    reached = unit[1] * float(np.degrees(highest))
    return f" (start-up reaches {significant(reached, 2)} {unit[0]})" if reached > limit else ""


def spectrum_figure(
    digest: Digest, colors: Mapping[str, str], floor: FloorDensity | None, unit: Unit = DEG_S
) -> Figure:
    """Draw the two-sided root density of the errors after settle, of the rates where there is no truth, and of the
    noise floor if it is known.

    Parameters
    ----------
    digest : Digest
        Traces of the run.
    colors : Mapping
        Group (``sensors/mhd_ars``, ``fusion/kalman``, ...) to color.
    floor : FloorDensity or None
        Root density of the floor [deg/s/sqrt(Hz)].
    unit : tuple of str and float, optional
        Unit of the rates, and what deg/s is multiplied by for it.

    Returns
    -------
    Figure
        One axes, log-log, root density against Hz.
    """
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(WIDTH_IN, 4.6))
        axes = figure.subplots()
        axes.set_xscale("log")
        axes.set_yscale("log")
        handles: list[Line2D | Patch] = []
        traces = by_group(digest)
        marks = series_marks(traces)
        for group, trace in traces.items():
            shown = trace.density > 0
            root = unit[1] * np.degrees(np.sqrt(trace.density[shown]))
            style = marked(marks[group], colors[group], root.size)
            width = 0.9 if group.startswith("sensors/") else 1.9
            handles += axes.plot(
                trace.freq_hz[shown], root, color=colors[group], linewidth=width, label=label(group), **style
            )
        if floor is not None:
            handles += axes.plot(
                floor.frequency_hz,
                unit[1] * np.array(floor.density),
                color=INK,
                linewidth=1.5,
                linestyle=(0, (1, 1.2)),
                label="noise floor",
            )
        _frame_spectrum(axes, digest, unit)
        arrange(figure, handles)
    return figure


def by_group(digest: Digest) -> dict[str, ErrorTrace]:
    """Return the errors of sensors, then of filters, by group.

    Parameters
    ----------
    digest : Digest
        Traces of the run.
    """
    sensors = {f"sensors/{name}": trace for name, trace in digest.sensor_errors.items()}
    return sensors | {f"fusion/{name}": trace for name, trace in digest.filter_errors.items()}


def _frame_spectrum(axes: Axes, digest: Digest, unit: Unit) -> None:
    axes.set_xlabel("frequency [Hz]")
    of = "error" if digest.has_truth else "rate"
    axes.set_ylabel(f"{of} root density, two-sided [{unit[0]}/√Hz]")
    frequency_axis(axes)
    decade_axis(axes)
    axes.grid(visible=True)
    shown = [trace.freq_hz for trace in by_group(digest).values() if trace.freq_hz.size]
    if shown:
        axes.set_xlim(0.8 * min(freq[0] for freq in shown), 1.25 * max(freq[-1] for freq in shown))
    low, high = axes.get_xlim()
    lines = [freq for freq in digest.line_freq_hz if low <= freq <= high]
    for freq in lines:
        axes.axvline(freq, color=INK, linewidth=0.8, alpha=0.45, linestyle=(0, (1, 2)), zorder=0.5)
    # Beside others there is no room for the unit, which the axis has.
    unit_of = " Hz" if len(lines) <= 2 else ""
    for freq in lines if len(lines) <= MAX_LABELLED_LINES else []:
        axes.annotate(
            f"{plain(freq)}{unit_of}", (freq, 1.0), xycoords=axes.get_xaxis_transform(), xytext=(0, 3),
            textcoords="offset points", ha="center", fontsize=8,
        )  # fmt: skip


def thermal_figure(digest: Digest, colors: Mapping[str, str], unit: Unit = DEG_S) -> Figure:
    """Draw what the temperature does to the sensors that have a thermometer: its readings above, error and true drift
    below.

    Parameters
    ----------
    digest : Digest
        Traces of the run.
    colors : Mapping
        Group (``truth``, ``sensors/fog``, ...) to color.
    unit : tuple of str and float, optional
        Unit of the rates, and what deg/s is multiplied by for it.

    Returns
    -------
    Figure
        Two axes, degC and rate against s or h.
    """
    errors = {name: digest.sensor_errors[name].whole for name in digest.thermal}
    scale = unit[1] * DEGREE
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(WIDTH_IN, 5.0))
        above, below = figure.subplots(2, 1, sharex=True, height_ratios=[2, 3])
        handles: list[Line2D | Patch] = []
        marks = series_marks(f"sensors/{name}" for name in digest.thermal)
        for name, trace in digest.thermal.items():
            color, mark = colors[f"sensors/{name}"], marks[f"sensors/{name}"]
            inside = (trace.temperature.low + trace.temperature.high) / 2 - 273.15
            style = marked(mark, color, inside.size)
            words = f"{label(name)}: thermometer, error"
            handles += above.plot(trace.temperature.time, inside, color=color, linewidth=1.4, label=words, **style)
            draw(below, errors[name], color, 0.6, alpha=0.45, scale=scale, mark=mark)
            drift = scale * (trace.drift.low + trace.drift.high) / 2
            words = f"{label(name)}: true thermal drift"
            handles += below.plot(trace.drift.time, drift, color=INK, linewidth=1.4, linestyle=mark.dash, label=words)
        above.set_ylabel("temperature [°C]")
        below.set_ylabel(f"error [{unit[0]}]")
        below.set_xlim(0, digest.duration_s)
        time_axis(below, digest.duration_s)
        for axes in (above, below):
            axes.grid(visible=True)
        arrange(figure, handles)
    return figure
