"""The design page of a report: what is asked of the line of sight, who makes what is left of it, and its curves."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from testbed.pages.axes import WIDTH_IN, arrange, label, marked, on_area
from testbed.pages.decades import decade_axis, frequency_axis
from testbed.pages.numbers import significant
from testbed.pages.palette import series_marks
from testbed.pages.svg import INK, STYLE
from testbed.runs.table import window_text

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.axes import Axes

    from testbed.runs.metrics import PointingMetrics, RunMetrics

# Of the parts of a budget, by name: colour, and the hatch that is left of it in grey.
_PARTS = {
    "mirror": ("#5b8aa6", ""),
    "latency": ("#d98a2b", "////"),
    "knowledge": ("#2f9e58", "...."),
    "tracker_noise": ("#7377e8", "\\\\\\\\"),
    "saturation": ("#b3261e", "xxxx"),
}
_DOTTED = (0, (1.2, 1.6))


def sight_rows(metrics: RunMetrics) -> list[dict[str, Any]]:
    """Return a row per window and filter: name of the window, its errors by samples, and RPE by the spectrum [urad].

    Parameters
    ----------
    metrics : RunMetrics
        Of the run.
    """
    rows = []
    for name, sight in metrics.pointing.items():
        spectral = (sight.model_extra or {}).get("spectral", {}).get("rpe_urad", {})
        for key in sorted(sight.rpe_urad, key=float):
            errors = {kind: getattr(sight, f"{kind}_urad").get(key) for kind in ("rpe", "mpe", "pde", "pre")}
            rows.append({"filter": name, "window": window_text(key), "spectral": spectral.get(key), **errors})
    return rows


def inside_rows(sight: PointingMetrics) -> list[tuple[str, float, float | None]]:
    """Return what the knowledge is made of: name, share of the residual's variance [-], and rms where known [urad].

    Parameters
    ----------
    sight : PointingMetrics
        Of one filter.
    """
    if sight.budget is None:
        return []
    rows: list[tuple[str, float, float | None]] = []
    for name, share in sight.budget.knowledge.items():
        rms = sight.budget.knowledge_rms_urad.get(name)
        if isinstance(share, dict):
            rows.append((name, sum(share.values()), rms))
            rows += [(f"{name}: {term.replace('_', ' ')}", value, None) for term, value in share.items()]
        else:
            rows.append((name.replace("_", " "), share, rms))
    return rows


def sight_budget_figure(sights: Mapping[str, PointingMetrics]) -> Figure:
    """Draw who makes the residual of each filter: signed shares of its variance, side by side from zero.

    Parameters
    ----------
    sights : mapping of str to PointingMetrics
        By filter.

    Returns
    -------
    Figure
        One axes, share in per cent against filter.
    """
    known = {name: sight.budget for name, sight in sights.items() if sight.budget is not None}
    parts = [part for part in _PARTS if any(abs(one.shares.get(part, 0.0)) > 5e-4 for one in known.values())]
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(WIDTH_IN, 1.3 + 0.62 * max(len(known), 1)))
        axes = figure.subplots()
        for place, (_name, budget) in enumerate(known.items()):
            ends = {1.0: 0.0, -1.0: 0.0}
            for part in parts:
                share = 100.0 * budget.shares.get(part, 0.0)
                side = 1.0 if share >= 0.0 else -1.0
                axes.barh(place, share, left=ends[side], height=0.56, **_area(part))
                if abs(share) >= 7.0:
                    middle = ends[side] + 0.5 * share
                    text = f"{share:.0f} %".replace("-", "−")
                    axes.annotate(
                        text,
                        (middle, place),
                        ha="center",
                        va="center",
                        fontsize=8.5,
                        color="#ffffff",
                        bbox=_behind(part),
                    )
                ends[side] += share
            words = f"{significant(budget.total_urad)} µrad"
            axes.annotate(words, (ends[1.0], place), xytext=(6, 0), textcoords="offset points", ha="left", va="center")
        axes.axvline(0.0, color=INK, linewidth=0.8)
        axes.axvline(100.0, color=INK, linewidth=0.8, linestyle=_DOTTED)
        axes.set_yticks(range(len(known)), [label(name) for name in known])
        axes.set_ylim(len(known) - 0.45, -0.55)
        axes.margins(x=0.12)
        axes.set_xlabel("share of the residual's variance [%]; all of a bar add up to 100")
        axes.grid(visible=True, axis="x")
        arrange(figure, [Patch(label=part.replace("_", " "), **_area(part)) for part in parts])
        # Names stand on the left, 0.075 in a letter.
        longest = max(map(len, known), default=0)
        figure.subplots_adjust(left=max(1.35, 0.25 + 0.075 * longest) / WIDTH_IN)
    return figure


def _area(part: str) -> dict[str, Any]:
    color, hatch = _PARTS[part]
    return {"facecolor": color, "edgecolor": "#ffffff", "linewidth": 0.0, "hatch": hatch}


def _behind(part: str) -> dict[str, Any]:
    """Return the box behind a number, so that no hatch crosses it."""
    return {"facecolor": _PARTS[part][0], "edgecolor": "none", "pad": 1.5}


def sight_curves_figure(sights: Mapping[str, PointingMetrics], colors: Mapping[str, str]) -> Figure:
    """Draw where the residual is: its root density above, below it the rms up to each frequency.

    Parameters
    ----------
    sights : mapping of str to PointingMetrics
        By filter.
    colors : mapping
        Group (``fusion/kalman``, ...) to color.

    Returns
    -------
    Figure
        Two axes over one axis of frequency: urad/sqrt(Hz) and urad rms.
    """
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(WIDTH_IN, 6.4))
        above, below = figure.subplots(2, 1, sharex=True)
        for axes in (above, below):
            axes.set_xscale("log")
            axes.set_yscale("log")
        handles = [Line2D([], [], color=INK, linewidth=1.3, linestyle=(0, (5, 2)), label="tracker alone")]
        first = next(iter(sights.values()))
        _curves(above, below, first, "tracker_only", {"color": INK, "linewidth": 1.3, "linestyle": (0, (5, 2))})
        marks = series_marks(f"fusion/{name}" for name in sights)
        for name, sight in sights.items():
            color, mark = colors[f"fusion/{name}"], marks[f"fusion/{name}"]
            look = {"color": color, **marked(mark, color, len(sight.curves.get("frequency_hz", [])))}
            _curves(above, below, sight, "residual", {**look, "linewidth": 2.0, "linestyle": "-"})
            _curves(above, below, sight, "knowledge", {**look, "linewidth": 1.3, "linestyle": _DOTTED})
            style = on_area(mark, color)
            handles.append(Line2D([], [], color=color, linewidth=2.2, label=label(name), **style))
        handles.append(Line2D([], [], color=INK, linewidth=1.3, linestyle=_DOTTED, label="knowledge"))
        above.set_ylabel("density, two-sided [µrad/√Hz]")
        below.set_ylabel("rms below the frequency [µrad]")
        below.set_xlabel("frequency [Hz]")
        frequency_axis(below)
        for axes, decades in ((above, 6.0), (below, 3.5)):
            _last_decades(axes, decades)
            decade_axis(axes)
            axes.grid(visible=True)
        arrange(figure, [*handles], gap_in=0.2)
    return figure


def _curves(above: Axes, below: Axes, sight: PointingMetrics, signal: str, style: dict[str, Any]) -> None:
    curves = sight.curves
    freq = np.array(curves.get("frequency_hz", []), dtype=float)
    if not freq.size:
        return
    density = np.sqrt(np.array(curves[f"{signal}_urad2_hz"], dtype=float))
    sums = np.array(curves[f"{signal}_below_urad"], dtype=float)
    for axes, values in ((above, density), (below, sums)):
        axes.plot(freq, np.where(values > 0.0, values, np.nan), **style)


def _last_decades(axes: Axes, decades: float) -> None:
    """Show at most so many decades below the highest value: what lies deeper is nothing to anybody."""
    low, high = axes.get_ylim()
    axes.set_ylim(max(low, high / 10.0**decades), high)
