"""The noise budget of a report: which sensor is good where, what each leaves in the floor by band, and what the filters
made of it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from testbed.pages.axes import WIDTH_IN, arrange, label, marked
from testbed.pages.decades import decade_axis, frequency_axis
from testbed.pages.numbers import plain, significant
from testbed.pages.palette import series_marks
from testbed.pages.svg import INK, STYLE
from testbed.report.figures import DEG_S, Unit

if TYPE_CHECKING:
    from collections.abc import Mapping

    from testbed.report.digest import Digest
    from testbed.runs.metrics import Budget, RunMetrics, SourceMetrics


def budget_figure(budget: Budget, colors: Mapping[str, str], unit: Unit = DEG_S) -> Figure:
    """Draw the input-referred noise of every sensor, that of their best combination, and the crossovers.

    Parameters
    ----------
    budget : Budget
        Root densities [deg/s/sqrt(Hz)] against frequency [Hz].
    colors : Mapping
        Group (``sensors/mhd_ars``, ...) to color.
    unit : tuple of str and float, optional
        Unit of the rates, and what deg/s is multiplied by for it.

    Returns
    -------
    Figure
        One axes, log-log, root density against Hz.
    """
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(WIDTH_IN, 3.9))
        axes = figure.subplots()
        axes.set_xscale("log")
        axes.set_yscale("log")
        handles = []
        marks = series_marks(f"sensors/{name}" for name in budget.densities)
        for name, density in budget.densities.items():
            values, group = np.array([np.nan if one is None else one for one in density]), f"sensors/{name}"
            handles += axes.plot(
                budget.frequency_hz,
                unit[1] * values,
                color=colors[group],
                linewidth=1.9,
                label=label(name),
                **marked(marks[group], colors[group], values.size),
            )
        if len(budget.densities) > 1:
            handles += axes.plot(
                budget.frequency_hz,
                unit[1] * budget.combined(),
                color=INK,
                linewidth=1.5,
                linestyle=(0, (1, 1.2)),
                label="best combination (noise floor)",
            )
        low, high = budget.frequency_hz[0], budget.frequency_hz[-1]
        for freq in [freq for freq in budget.crossovers_hz if low <= freq <= high]:
            axes.axvline(freq, color=INK, linewidth=0.9, alpha=0.6, linestyle=(0, (5, 2)), zorder=0.5)
            axes.annotate(
                f"crossover {significant(freq)} Hz", (freq, 1.0), xycoords=axes.get_xaxis_transform(), xytext=(0, 3),
                textcoords="offset points", ha="center", fontsize=8,
            )  # fmt: skip
        axes.set_xlim(low, 1.1 * high)
        axes.set_xlabel("frequency [Hz]")
        axes.set_ylabel(f"noise, input-referred, two-sided [{unit[0]}/√Hz]")
        frequency_axis(axes)
        decade_axis(axes)
        axes.grid(visible=True)
        arrange(figure, [*handles])
    return figure


def band_rows(budget: Budget, digest: Digest) -> list[dict[str, Any]]:
    """Return a row per band: its name, what each sensor and all leave, and what each filter left; [deg/s].

    Parameters
    ----------
    budget : Budget
        Of the run.
    digest : Digest
        Errors of the filters by band, None where the record resolves no such band.
    """
    rows = []
    for i, band in enumerate(budget.bands):
        filters = {}
        for name, trace in digest.filter_errors.items():
            value = trace.band_rms[i] if trace.band_rms else None
            filters[name] = None if value is None else float(np.degrees(value))
        rows.append(
            {
                "name": f"below {plain(band.high_hz)}"
                if not band.low_hz
                else f"{plain(band.low_hz)}–{plain(band.high_hz)}",
                "sensors": band.sensors_deg_s,
                "floor": band.floor_deg_s,
                "filters": filters,
            }
        )
    return rows


def line_optima(metrics: RunMetrics) -> dict[float, float]:
    """Return the optimum of each commanded line alone [deg/s] by frequency [Hz]; nothing if none is known.

    Parameters
    ----------
    metrics : RunMetrics
        Of the run.
    """
    found: dict[float, float] = {}
    for source in metrics.fusion.values():
        found |= {line.frequency_hz: line.optimum_deg_s for line in source.lines or [] if line.optimum_deg_s}
    return found


def line_error(source: SourceMetrics, frequency_hz: float) -> float | None:
    """Return the error that a filter would have were this line alone [deg/s].

    Parameters
    ----------
    source : SourceMetrics
        The filter.
    frequency_hz : float
        The line [Hz].
    """
    return next((line.error_deg_s for line in source.lines or [] if line.frequency_hz == frequency_hz), None)
